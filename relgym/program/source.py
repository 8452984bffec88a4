"""A program as Python that people read and that runs without relgym: numpy alone.

What the model says is written out, a function for each mode, law and choice between two modes; how bodies and contacts
work in general is the same for all models and stands below it. Geometry is the kernel's own text.
"""

from __future__ import annotations

import ast
import keyword
import re
from collections.abc import Iterator
from pathlib import Path

from relgym.program import records as ir

__all__ = ["python_source"]

_OUTCOMES = ("PREDICTED", "NO_MODE", "UNEXPLAINED", "NO_ROLES", "OUTSIDE", "DEPENDS", "UNSURE")
_GEOMETRY = ("disc_and_polygon", "separation", "nearest", "polygons", "discs", "boxes")


def python_source(program: ir.Program, told: str, sentences: tuple[str, ...]) -> str:
    """A program as the text of a Python module.

    Parameters
    ----------
    program
        The program.
    told
        What the model says in words; it becomes the module's docstring.
    sentences
        What each outcome means, in the order of their numbers.

    Notes
    -----
    Whatever a program says can be written: the text grows with it, some lines for each mode, law and stage of a choice.
    Names are made of those of objects and properties; where two would be the same (``a_b.c`` and ``a.b_c``), all get
    numbers.
    """
    text = _Source(program, told, sentences).text()
    return text if _distinct(text) else _Source(program, told, sentences, numbered=True).text()


class _Source:
    def __init__(
        self, program: ir.Program, told: str, sentences: tuple[str, ...], *, numbered: bool = False
    ) -> None:
        self.program, self.told, self.sentences = program, told, sentences
        self.numbered = numbered
        self.names: dict[int, str] = {}
        for k, name in enumerate(program.columns):
            constant = f"C{k}_{_constant(name)}" if numbered else _constant(name)
            self.names[k], self.names[program.width + k] = constant, f"NEXT + {constant}"
        for k, name in enumerate(("MISSING", "ZERO", "UNIT")):
            self.names[2 * program.width + k] = name
        self.lines: list[str] = []

    def text(self) -> str:
        """The module."""
        p = self.program
        add = self.lines.append
        add(
            f'"""{_doc(self.told)}\n\nMade by relgym; needs numpy alone. `step` predicts one scene, `predict` many.'
            '\n"""\n'
        )
        modules = [*(["base64"] if p.fits else []), *(["itertools"] if p.casts else []), "math"]
        add("".join(f"import {name}\n" for name in modules) + "\nimport numpy as np\n")
        add("# ---- the state vector")
        add(f"COLUMNS = {p.columns!r}")
        for k in range(p.width):
            add(f"{self.names[k]} = {k}")
        add(f"NEXT = {p.width}  # next values stand so much further on")
        add(f"MISSING, ZERO, UNIT = NEXT + {p.width}, NEXT + {p.width + 1}, NEXT + {p.width + 2}")
        add("")
        add("# ---- how a prediction came about")
        for k, (name, sentence) in enumerate(zip(_OUTCOMES, self.sentences, strict=True)):
            add(f"{name} = {k}  # {sentence}")
        add(f"FREE, TOUCHING = {ir.FREE}, {ir.TOUCHING}  # what laws of motion name in place of a mode\n")
        if p.bodies:
            self._bodies()
        if p.motion is not None:
            self._motion(p.motion)
        answers = [self._answer(k, a) for k, a in enumerate(p.answers)]
        self._step(answers)
        self._general()
        return "\n".join(self.lines).rstrip() + "\n"

    def _general(self) -> None:
        """What is the same for all models, as far as this one needs it."""
        p, add = self.program, self.lines.append
        votes = [a.vote for a in p.answers if a.vote is not None]
        trusts = [a.trust for a in p.answers if a.trust is not None]
        if p.bodies:
            add(_kernel_text(_GEOMETRY))
            add(_SCENE)
        if trusts:
            add(_TRUST)
        if p.fits:
            add(_REGRESSION)
        if p.casts or votes:
            add(_VOTES)
        if p.casts or any(vote.experience is not None for vote in votes):
            add(_SITUATIONS)
        if p.casts:
            add(_ROLES)
        if p.motion is not None:
            add(_COMPOSITION)

    # ------------------------------------------------------------------ numbers
    def x(self, column: int) -> str:
        """A register."""
        return f"x[{self.names[column]}]"

    def sum(self, s: ir.Sum, names: dict[int, str] | None = None) -> str:
        """A sum, in its order."""
        text = ""
        for column, weight in s.terms:
            if column == ir.CONSTANT and weight == 0.0 and len(s.terms) > 1:
                continue  # of an intercept that is none
            name = "" if column == ir.CONSTANT else names[column] if names is not None else self.x(column)
            size = name if name and abs(weight) == 1.0 else repr(abs(weight)) + (f" * {name}" if name else "")
            sign = "-" if weight < 0.0 else "+"
            text = f"{text} {sign} {size}" if text else ("-" if sign == "-" else "") + size
        return text or "0.0"

    # ------------------------------------------------------------------ bodies
    def _bodies(self) -> None:
        p, add = self.program, self.lines.append
        add(
            "# ---- bodies: name, shape, outline, type, and the columns of place, extents, angle, velocity, spin"
        )
        add("BODIES = (")
        for b, group in zip(p.bodies, p.groups, strict=True):
            columns = (*b.position, *b.extent, b.angle, *b.velocity, b.spin)
            add(f"    ({b.name!r}, {b.shape!r}, {b.outline!r}, {group},")
            add(f"     ({', '.join(self.names[c] for c in columns)}), {b.moves}, {b.spins}),")
        add(")")
        add(f"TURN = {p.turn!r}  # sense in which angles turn")
        add(f"TOUCH, PART, PRECISION = {p.touch!r}, {p.part!r}, {p.precision!r}")
        others = tuple(tuple(self.names[c] for c in row) for row in p.others)
        add("OTHERS = (" + " ".join(f"({', '.join(row)}{',' if row else ''})," for row in others) + ")")
        letters = tuple(name.removeprefix("normal-") for name in p.facts if name.startswith("normal-"))
        add(f"AXES, UP, FACTS = {letters!r}, {p.up}, {len(p.facts)}")
        add("DIMENSIONS = len(AXES)")
        if p.dimensions == 3 or p.casts:
            poses = (f"({', '.join(self.names[c] for c in b.pose)})" for b in p.bodies)
            add(f"POSES = ({', '.join(poses)},)")
        self._others_columns()
        add(f"OFFSETS, PARTING, MOVES = {p.offsets}, {p.parting}, {p.motion is not None}\n")

    def _others_columns(self) -> None:
        """Where each body has the numbers that players of roles are asked for."""
        terms = [
            term for a in self.program.answers for mode in a.modes for r in mode.roles for term in r.terms
        ]
        rows: dict[str, list[str]] = {}
        for _, columns in terms:
            row = rows.setdefault(self._property(columns), ["None"] * len(columns))
            for k, column in enumerate(columns):
                if column >= 0:
                    row[k] = self.names[column]
        if rows:
            self.lines.append(f"RELATIONS = {self.program.relations!r}")
            self.lines.append("OF = {  # where each body has a property")
            for name, row in rows.items():
                self.lines.append(f"    {name!r}: ({', '.join(row)},),")
            self.lines.append("}")

    def _property(self, columns: tuple[int, ...]) -> str:
        """What the bodies' columns hold, by its name; next values with a prime."""
        column = next(c for c in columns if c >= 0)
        width = self.program.width
        return self.program.columns[column % width].partition(".")[2] + ("'" if column >= width else "")

    def _motion(self, m: ir.Motion) -> None:
        add = self.lines.append
        add("# ---- laws of motion")
        for mover in m.movers:
            add(f"def {self._free(mover)}(x):")
            add(
                f'    """Next velocity of {self.program.bodies[mover.body].name} where it touches nothing."""'
            )
            add(f"    return [{', '.join(self.sum(s) for s in mover.free)}]\n")
        movers = [f"({v.body}, {self._free(v)}, {v.governed}, {v.moving})" for v in m.movers]
        add(f"MOVERS = ({', '.join(movers)},)  # body, law, components, of how many")
        letters = {
            "contact": "nt",
            "point": "nt",
            "turned": "ns",
            "centres": "ct",
            "own": "ab",
            "world": "xy",
        }
        for number, law in enumerate(m.laws):
            frame = letters[law.frame]
            names = {2 * k + j: f"{w}_{frame[k]}" for k in range(2) for j, w in enumerate("uv")}
            names |= {4 + k: f"J_{frame[k]}" for k in range(2)}
            for axis, rules in enumerate(law.rules):
                for k, rule in enumerate(rules):
                    given = ", ".join(names[j] for j in range(6))
                    add(f"\ndef law{number}_{frame[axis]}{k}({given}):")
                    add(
                        '    """Velocity after a contact along one axis; u: without it, v: now, J: impulse."""'
                    )
                    pieces = [self.sum(piece, names) for piece in rule.pieces]
                    text = pieces[0]
                    for piece in pieces[1:]:
                        text = f"{'largest' if rule.operator == 'max' else 'smallest'}({text}, {piece})"
                    add(f"    return {text}\n")
        add(
            "# laws in force, then others that explain as much: frame, rules of both axes with the senses in which"
        )
        add("# motion was seen to be turned back, and which rule holds for which pair")
        add("LAWS = (")
        for number, law in enumerate(m.laws):
            frame = letters[law.frame]
            written = [
                "("
                + " ".join(f"(law{number}_{frame[a]}{k}, {r.back}, {r.forth})," for k, r in enumerate(some))
                + ")"
                for a, some in enumerate(law.rules)
            ]
            add(f"    ({law.frame!r}, ({written[0]}, {written[1]}), {law.chosen!r}),")
        add(")")
        add(
            "# pairs that may meet: first and second body, share (a number, or two columns and a power), grip"
        )
        add("PAIRS = (")
        for pair in m.pairs:
            share = _number(pair.share.constant)
            if pair.share.columns is not None:
                columns = ", ".join(self.names[c] for c in pair.share.columns)
                share = f"({columns}, {pair.share.power})"
            add(f"    ({pair.first}, {pair.second}, {share}, {_number(pair.grip)}),")
        add(")")
        add(f"SLACK, SPINS = {m.slack!r}, {m.spins}\n")

    def _free(self, mover: ir.Mover) -> str:
        """The name of a mover's free law."""
        name = _name(self.program.bodies[mover.body].name)
        return f"free{mover.body}_{name}" if self.numbered else f"free_{name}"

    # ------------------------------------------------------------------ answers
    def _answer(self, number: int, a: ir.Answer) -> str:
        add = self.lines.append
        name = self._called(number)
        add(f"# ---- {a.object}.{a.property}")
        for feature in a.features:
            self.names[feature.register] = f"NEXT + {feature.register - self.program.width}"
        for follow in a.follows:
            self.names[follow.register] = f"NEXT + {follow.register - self.program.width}"
        for mode in a.modes:
            self.names[mode.register] = f"NEXT + {mode.register - self.program.width}"
            if mode.function is not None and (mode.casting is not None or not mode.roles):
                self._mode(name, mode)
        if a.vote is not None:
            for contest in a.vote.contests:
                self._contest(name, a, contest)
        add(f"def {name}(x, scene):")
        add(f'    """Next value of {a.object}.{a.property}: value, outcome, mode, margin, fallback value."""')
        for feature in a.features:
            factors = [
                self.x(f.column)
                if not f.function
                else f"math.{f.function}({f.frequency} * {self.x(f.column)})"
                for f in feature.factors
            ]
            add(f"    {self.x(feature.register)} = {' * '.join(factors)}  # {feature.name}")
        if a.guess is not None or a.beyond is not None:
            add(f"    guess = {self._guess(a)}")
        else:
            add("    guess = math.nan")
        self._said(name, a)
        add("")
        return name

    def _called(self, number: int) -> str:
        """The name of an answer's function, with which those of its parts begin."""
        a = self.program.answers[number]
        name = f"{_name(a.object)}_{_name(a.property)}"
        return f"a{number}_{name}" if self.numbered else name

    def _mode(self, name: str, mode: ir.Mode) -> None:
        """A mode as a function of the registers and of the bodies that are bound to its roles."""
        add = self.lines.append
        assert mode.function is not None, "asked of such alone"
        cast = {role.number + 1: _variable(role.place + 1) for role in mode.roles}
        who = ", ".join(cast.get(k, str(player)) for k, player in enumerate(mode.players))
        players = [f", {_variable(place + 1)}" for place in range(mode.casting.roles if mode.casting else 0)]
        if mode.roles and mode.casting is not None:
            self._casting(f"{name}_players_{mode.id}", mode.id, mode.casting)
        add(f"def {name}_mode_{mode.id}(x{''.join(players)}):")
        add(f'    """Mode {mode.id}, of {who}."""')
        text = self.sum(mode.function)
        for role in mode.roles:
            for weight, columns in role.terms:
                place = f"x[OF[{self._property(columns)!r}][{_variable(role.place + 1)}]]"
                text += f" {'-' if weight < 0.0 else '+'} {abs(weight)!r} * {place}"
        add(f"    return {text}\n")

    def _casting(self, name: str, mode: int, casting: ir.Casting) -> None:
        add, described = self.lines.append, list[str]()
        for k, d in enumerate(casting.descriptions):
            described.append(f"        ({d.objects}, {name}_{k}, {d.common!r}, {d.places!r}),\n")
            add(f"def {name}_{k}(target, B, shown, stands):")
            add(f'    """Log-odds that B is bound to role {", ".join(map(str, d.places))} of mode {mode}."""')
            for clause, score in d.clauses:
                add(f"    # {clause.text}")
                add(f"    if {self._clause(clause)[0]}:\n        return {_number(score)}")
            add(f"    return {_number(d.otherwise)}\n")
        add(f"def {name}(target, scene):")
        add(f'    """Bodies bound to the roles of mode {mode}; None: none are, or it is in doubt which."""')
        add("    # whom, how well, what all who did had in common (relations both ways, kinds), which roles")
        add(f"    described = (\n{''.join(described)}    )")
        add(f"    return players(described, {casting.roles}, {casting.lenient}, target, scene)\n")

    def _clipped(self, a: ir.Answer, value: str) -> str:
        if a.reach is None:
            return value
        low, high = _number(a.reach.least), _number(a.reach.most)
        return f"clipped({value}, {self.x(a.reach.present)}, {low}, {high})"

    def _guess(self, a: ir.Answer) -> str:
        whole = "math.nan" if a.guess is None else self.sum(a.guess)
        if a.beyond is not None and a.scope is not None:
            whole = f"({whole} if {self._tree(a.scope[0], a.scope[1])} else {self.sum(a.beyond)})"
        return self._clipped(a, whole)

    def _said(self, name: str, a: ir.Answer) -> None:
        add = self.lines.append
        if a.component >= 0:
            add(
                f"    velocity, known, touches = scene.motion[{a.component}][{a.body}], *scene.told[{a.body}]"
            )
            add("    if not known:\n        return math.nan, OUTSIDE, 0, 0.0, guess")
            add("    return velocity, PREDICTED, TOUCHING if touches else FREE, math.inf, guess")
            return
        if a.state != "modes":
            add(f"    return math.nan, {'UNEXPLAINED' if a.state == 'lost' else 'NO_MODE'}, 0, 0.0, guess")
            return
        self._by_modes(name, a)

    def _by_modes(self, name: str, a: ir.Answer) -> None:
        """The modes' values, who wins the vote, and what walls make of it."""
        add = self.lines.append
        if a.scope is not None:
            add(f"    if not {self._tree(*a.scope)}:\n        return math.nan, UNEXPLAINED, 0, 0.0, guess")
        for mode in a.modes:
            value = "math.nan" if mode.function is None or mode.roles else f"{name}_mode_{mode.id}(x)"
            add(f"    {self.x(mode.register)} = {value}")
        for f in a.follows:
            join = f"+ {f.scale!r} *" if f.scale else "*"
            add(f"    {self.x(f.register)} = {self.x(f.column)} {join} {self.x(f.value)}")
        if a.vote is None:
            add("    order, margin = (0,), math.inf")
        else:
            self._voted(name, a, a.vote)
        ids = ", ".join(f"({m.id}, {self.x(m.register)}, {m.function is not None})" for m in a.modes)
        add(f"    modes = ({ids},)")
        add("    for place, number in enumerate(order):")
        add("        mode, value, known = modes[number]")
        add("        if not known:\n            continue")
        cast = [
            f"{k}: ({name}_players_{m.id}, {name}_mode_{m.id})"
            for k, m in enumerate(a.modes)
            if m.roles and m.casting
        ]
        if any(m.roles for m in a.modes):
            add(f"        if number in {tuple(k for k, m in enumerate(a.modes) if m.roles)!r}:")
            add(f"            who, what = {{{', '.join(cast)}}}.get(number, (nobody, None))")
            add(f"            chosen = who({a.body}, scene)")
            add("            if chosen is None:")
            add(
                "                return math.nan, OUTSIDE, 0, 0.0, guess"
                if a.abstains
                else "                continue"
            )
            add("            value = what(x, *chosen)")
        if a.clipped:
            add(f"        value = {self._clipped(a, 'value')}")
        self._walls(a)
        said = "PREDICTED" if a.said else "UNEXPLAINED"
        add(f"        return value, {said}, mode, margin if place == 0 else 0.0, guess")
        add("    return math.nan, NO_ROLES, 0, 0.0, guess")

    def _walls(self, a: ir.Answer) -> None:
        """Limits and stops."""
        add = self.lines.append
        if a.low[0]:
            add(f"        if value < {a.low[1]!r}:\n            value, mode = {a.low[1]!r}, {a.low[0]}")
        if a.high[0]:
            add(f"        if value > {a.high[1]!r}:\n            value, mode = {a.high[1]!r}, {a.high[0]}")
        for each in a.stops:
            if isinstance(each, ir.Stop):
                held = (
                    f"{each.side!r} * ({self.x(each.column)} + {each.step!r} * value - {each.bound!r}) >= 0.0"
                )
            else:
                near = f"abs({self.x(each.column)} - {each.at!r}) <= {each.slack!r}"
                held = f"{near} and math.isfinite(value)"
            add(f"        if {held}:\n            value, mode = {each.value!r}, {each.mode}")

    def _voted(self, name: str, a: ir.Answer, vote: ir.Vote) -> None:
        add = self.lines.append
        if a.body < 0:
            add("    near, target, pair = (1, 1, 1), 0, [{}]")
            add("    stands = lambda relation, a, b: False")
        else:
            add(f"    near, target, pair = *scene.surroundings({a.body}),")
            add("    stands = scene.stands")
        add("    lead = (")
        for contest in vote.contests:
            i, j = a.modes[contest.first].id, a.modes[contest.second].id
            add(
                f"        ({contest.first}, {contest.second}, *{name}_{i}_or_{j}(x, near, target, pair, stands)),"
            )
        add("    )")
        add(f"    order, margin = ranked(lead, {vote.by_tie!r})")
        if (known := vote.experience) is not None:
            used = ", ".join(
                f"({context}, {tuple(self.program.relations[r] for r in relations)!r}, {unary!r})"
                for context, relations, unary in known.used
            )
            self.lines.insert(
                self._where(name), f"{_constant(name)}_SEEN = frozenset({sorted(known.seen)!r})\n"
            )
            add(f"    if situation(({used},), near, target, stands) not in {_constant(name)}_SEEN:")
            registers = ", ".join(self.x(mode.register) for mode in a.modes)
            value = f"({registers},)[order[0]]"
            add(f"        return {self._clipped(a, value) if a.clipped else value}, OUTSIDE, 0, 0.0, guess")

    def _where(self, name: str) -> int:
        return max(k for k, line in enumerate(self.lines) if line.startswith(f"def {name}(x, scene):"))

    # ------------------------------------------------------------------ conditions
    def _contest(self, name: str, a: ir.Answer, contest: ir.Contest) -> None:
        add = self.lines.append
        i, j = a.modes[contest.first].id, a.modes[contest.second].id
        add(f"def {name}_{i}_or_{j}(x, near, target, pair, stands):")
        add(f'    """Votes for mode {i} and for mode {j}, in units of 2**-32."""')
        add(f"    shown = near[{contest.context}]  # {ir.CONTEXTS[contest.context]}")
        for stage in contest.stages:
            self._stage(stage, contest)
        add("    raise AssertionError('the last stage decides')\n")

    def _stage(self, stage: ir.Stage, contest: ir.Contest) -> None:
        add, pad = self.lines.append, "    "
        tests = [self._test(t) for t in stage.tests]
        if stage.clause is not None:
            add(f"    # {stage.clause.text}")
            found = self._clause(stage.clause)
            bound = stage.tree is not None and any(s.feature >= 0 for s in stage.tree.sights)
            if bound:
                variables = ", ".join(_variable(v) for v in range(1, stage.clause.variables))
                add(
                    f"    found = [({variables},) for {found[1]}]"
                    if found[1]
                    else f"    found = [()] if {found[0]} else []"
                )
                tests.append("found")
            else:
                tests.append(found[0])
        if tests:
            add(f"    if {' and '.join(tests)}:")
            pad = "        "
        if stage.tree is None:
            add(f"{pad}return {contest.votes[stage.outcomes[0]]!r}")
            return
        self._branches(stage.tree, stage.outcomes, contest, pad)

    def _branches(
        self, tree: ir.Tree, outcomes: tuple[int, ...], contest: ir.Contest, pad: str, node: int = 0
    ) -> None:
        sight, threshold, below, above = tree.nodes[node]
        if sight < 0:
            said = f"return {contest.votes[outcomes[node]]!r}" if outcomes[node] >= 0 else "pass"
            self.lines.append(f"{pad}{said}")
            return
        self.lines.append(f"{pad}if {self._sight(tree.sights[sight])} <= {threshold!r}:")
        self._branches(tree, outcomes, contest, pad + "    ", below)
        self.lines.append(f"{pad}else:")
        self._branches(tree, outcomes, contest, pad + "    ", above)

    def _sight(self, s: ir.Sight) -> str:
        if s.column >= 0:
            return self.x(s.column) + (f" - {self.x(s.minus)}" if s.minus >= 0 else "")
        return f"least(pair[o[{s.variable - 1}]].get({s.feature}, math.nan) for o in found)"

    def _tree(self, tree: ir.Tree, outcomes: tuple[int, ...], node: int = 0) -> str:
        """A tree of yes and no, as one expression."""
        sight, threshold, below, above = tree.nodes[node]
        if sight < 0:
            return str(bool(outcomes[node]))
        test = f"{self._sight(tree.sights[sight])} <= {threshold!r}"
        yes, no = (self._tree(tree, outcomes, n) for n in (below, above))
        return f"({yes} if {test} else {no})"

    def _test(self, t: ir.Test) -> str:
        value = self.x(t.column) + (f" - {self.x(t.minus)}" if t.minus >= 0 else "")
        text = f"{value} {'<=' if t.at_most else '>'} {t.threshold!r}"
        return f"not {text}" if t.negated else text

    def _clause(self, clause: ir.Clause) -> tuple[str, str]:
        """A clause as a condition, and as what follows `for` in a comprehension (empty without variables)."""
        tests = [self._literal(each) for each in clause.literals]
        if clause.variables <= clause.arity:
            return " and ".join(tests) or "True", ""
        free = range(clause.arity, clause.variables)
        loops = " for ".join(f"{_variable(v)} in objects(shown)" for v in free)
        body = f"{loops} if {' and '.join(tests) or 'True'}"
        return f"any(True for {body})", body

    def _literal(self, each: ir.Literal) -> str:
        if isinstance(each, ir.Related):
            first, second = _variable(each.first), _variable(each.second)
            name = self.program.relations[each.relation]
            loops = " for ".join(
                f"{v} in objects(shown)" for v, k in (("P", each.first), ("Q", each.second)) if k == ir.ANY
            )
            first, second = (
                ("P" if each.first == ir.ANY else first),
                ("Q" if each.second == ir.ANY else second),
            )
            text = f"stands({name!r}, {first}, {second})"
            text = f"any({text} for {loops})" if loops else text
        elif isinstance(each, ir.IsA):
            if each.variable == ir.ANY:
                text = f"shown & {each.objects}"
            else:
                text = f"{each.objects} >> {_variable(each.variable)} & 1"
        else:
            who = "P" if each.variable == ir.ANY else _variable(each.variable)
            value = f"pair[{who}].get({each.feature}, math.nan)"
            text = f"{value} {'<=' if each.at_most else '>'} {each.threshold!r}"
            text = f"any({text} for P in objects(shown))" if each.variable == ir.ANY else text
        return f"not ({text})" if each.negated else f"({text})"

    # ------------------------------------------------------------------ who is believed
    def _squares(self) -> None:
        """What least squares say of each answer."""
        add = self.lines.append
        if not self.program.fits:
            return
        add(
            "# ---- least squares: columns with centre and scale, and what leverage is worked out from; then how far a"
        )
        add(
            "# word counts: squared distance at a leverage of 1, leverage in the midst, and the say of each rate"
        )
        add(f"RATES = {ir.RATES!r}")
        for number, fit in enumerate(self.program.fits):
            self._fit(number, fit)
        told = [
            self._regression(self._called(number), a.regression) if a.regression is not None else "None"
            for number, a in enumerate(self.program.answers)
        ]
        add("SQUARES = (  # of each answer below\n" + "".join(f"    {each},\n" for each in told) + ")\n")

    def _trust(self) -> None:
        """How right predictions of each kind were; of all objects of a type alike."""
        add, known, told = self.lines.append, list[tuple[ir.Belief, ...]](), list[str]()
        if all(a.trust is None for a in self.program.answers):
            return
        add(
            "# ---- how right predictions were: by outcome, mode (laws below 0), bin of the margin or, from 8 on, of"
        )
        add(
            "# how far from what was learned an approximation is asked (-1: all others, -2: of all other modes), and"
        )
        add("# whose values there are (bits of EXPERTS): who speaks, and how sure that is")
        add(f"EXPERTS = {ir.EXPERTS!r}")
        for a in self.program.answers:
            trust = a.trust
            if trust is None:
                told.append("None")
                continue
            if trust.beliefs not in known:
                known.append(trust.beliefs)
                add(f"BELIEFS_{len(known) - 1} = {{")
                for b in trust.beliefs:
                    sure = f"{_number(b.probability)}, {_number(b.interval)}, {b.claimed}"
                    add(f"    ({b.outcome}, {b.winner}, {b.lead}, {b.able}): ({b.speaker}, {sure}),")
                add("}")
            kind = f"{trust.lawful}, {trust.distant}, {trust.rests!r}"
            told.append(f"(BELIEFS_{known.index(trust.beliefs)}, {kind})")
        add(
            "# beliefs; whether of laws, and by how far a scene lies from what was learned; keys that modes rely on;"
        )
        add("# of each answer below")
        add("TRUST = (\n" + "".join(f"    {each},\n" for each in told) + ")\n")

    def _fit(self, number: int, fit: ir.Fit) -> None:
        """What regressions of one object look at: columns, centres and scales; means and spreads."""
        add = self.lines.append
        columns = (f"({self.names[c]}, {_number(m)}, {_number(s)})" for c, m, s in fit.columns)
        add(f"FIT_{number} = (\n    ({', '.join(columns)},),\n    (")
        for one in fit.leverage:
            add(f"        (({', '.join(map(_number, one.mean))},), {one.spread!r}),")
        add("    ),\n)")

    def _regression(self, name: str, r: ir.Regression) -> str:
        add = self.lines.append
        add(f"{name.upper()}_LEAST_SQUARES = (")
        weights = (f"({', '.join(map(_number, row))},)" for row in r.weights)
        trusted = (
            f"({_number(each.growth)}, {_number(each.least)}, ({', '.join(map(_number, each.say))}))"
            for each in r.trusted
        )
        add(f"    {self.names[r.present]}, FIT_{r.fit},\n    ({', '.join(weights)},),")
        add(f"    {_number(r.least)}, {_number(r.most)}, ({', '.join(trusted)},),\n)")
        return f"{name.upper()}_LEAST_SQUARES"

    # ------------------------------------------------------------------ the step
    def _step(self, answers: list[str]) -> None:
        p, add = self.program, self.lines.append
        self._squares()
        self._trust()
        add("# ---- all of it, in causal order: what, its column, its (type, property), those it depends on")
        add("ANSWERS = (")
        for name, a in zip(answers, p.answers, strict=True):
            add(f"    ({name}, {self.names[a.column]}, {a.key}, {a.needs!r}),")
        add(")")
        laws = ", ".join(f"({self.names[c]}, {step!r}, {self.names[r]})" for c, step, r in p.kinematics)
        add(f"KINEMATICS = ({laws}{',' if laws else ''})  # next value = value + step * rate")
        angles = ", ".join(self.names[c] for c in p.angles)
        add(f"ANGLES = ({angles}{',' if angles else ''})\n")
        scene = "Scene(x)" if p.bodies else "None"
        words = "regressed(x, SQUARES[number])" if p.fits else "math.nan, 0.0"
        other = f"guess if math.isfinite(guess) else {words}[0]" if p.fits else "guess"
        plain = f"        value = value if finite else {other}"
        if any(a.trust is not None for a in p.answers):
            plain = (
                f"        said = value, guess, {'*' if p.fits else ''}{words}\n"
                "        value, outcome, mode, sure = settled(number, said, outcome, mode, margin, x, odds)"
            )
        registers = str(p.registers - 2 * p.width)
        add(_STEP.replace("REGISTERS", registers).replace("SCENE", scene).replace("SETTLED", plain))


def _variable(number: int) -> str:
    return "target" if number == 0 else chr(ord("A") + number)


def _name(text: str) -> str:
    found = re.sub(r"\W+", "_", text).lower()
    return f"{found}_" if keyword.iskeyword(found) else found


def _constant(text: str) -> str:
    found = re.sub(r"\W+", "_", text).upper()
    return f"C_{found}" if not found[0].isalpha() else found


def _number(value: float) -> str:
    if value != value:
        return "math.nan"
    return repr(value) if abs(value) != float("inf") else ("-" if value < 0 else "") + "math.inf"


def _distinct(text: str) -> bool:
    """Whether a module gives each of its names once."""
    names: list[str] = []
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef):
            names.append(node.name)
        elif isinstance(node, ast.Assign):
            names += [n.id for target in node.targets for n in ast.walk(target) if isinstance(n, ast.Name)]
    return len(set(names)) == len(names)


def _doc(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"""', "'''").strip()


def _kernel_text(names: tuple[str, ...]) -> str:
    """Functions of the kernel, as they stand there."""
    text = (Path(__file__).parent / "kernel.py").read_text(encoding="utf-8")
    return "\n\n".join(_functions(text, names)) + "\n"


def _functions(text: str, names: tuple[str, ...]) -> Iterator[str]:
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef) and node.name in names:
            yield "\n".join(text.splitlines()[node.lineno - 1 : node.end_lineno])


_STEP = '''def step(now):
    """Predict what follows one state vector.

    Returns the next state vector, and for every entry of ANSWERS its outcome, mode, margin, how probably it is
    right, and the half width of its 95 % interval.
    """
    x = [*now, *now, math.nan, 0.0, 1.0] + [math.nan] * (REGISTERS - 3)
    scene, lost, odds, told = SCENE, set(), {}, []
    for number, (answer, column, key, needs) in enumerate(ANSWERS):
        value, outcome, mode, margin, guess = answer(x, scene)
        if not lost.isdisjoint(needs):
            outcome, margin = DEPENDS, 0.0
        finite = math.isfinite(value)
        if not finite and outcome == PREDICTED:
            outcome = OUTSIDE
        if not (finite and outcome in (PREDICTED, UNEXPLAINED)):
            mode = 0
        sure = math.nan, math.nan
SETTLED
        if math.isfinite(value):
            x[NEXT + column] = value
        if outcome != PREDICTED:
            lost.add(key)
        if sure[0] < odds.get(key, 1.0):
            odds[key] = sure[0]
        told.append((outcome, mode, margin, *sure))
    for place, size, rate in KINEMATICS:
        x[NEXT + place] = x[place] + size * x[rate]
    for column in ANGLES:
        x[NEXT + column] -= 2.0 * math.pi * float(np.round(x[NEXT + column] / (2.0 * math.pi)))
    return x[NEXT : 2 * NEXT], told


def predict(vectors):
    """Predict what follows n state vectors, shape (n, width).

    Returns the next ones, then outcomes, modes, margins, probabilities and intervals, shape (n, answers) each.
    """
    found = [step([float(v) for v in row]) for row in np.asarray(vectors, dtype=np.float64)]
    after = np.array([row for row, _ in found]).reshape(len(found), NEXT)
    told = np.array([row for _, row in found], dtype=np.float64).reshape(len(found), len(ANSWERS), 5)
    return after, told[..., 0].astype(int), told[..., 1].astype(int), told[..., 2], told[..., 3], told[..., 4]


def clipped(value, present, low, high):
    """A value, as far as changes may go."""
    return value if value != value else min(max(value, present + low), present + high)


def largest(a, b):
    """The larger one; NaN if either is."""
    return math.nan if a != a or b != b else a if a >= b else b


def smallest(a, b):
    """The smaller one; NaN if either is."""
    return math.nan if a != a or b != b else a if a <= b else b

'''

_VOTES = '''
def objects(some):
    """Numbers of the objects of a set."""
    return [k for k in range(some.bit_length()) if some >> k & 1]


def least(values):
    """The least number; NaN if there is none."""
    return min((v for v in values if v == v), default=math.nan)


def ranked(votes, by_tie):
    """Places of the modes, the winner first, and its lead: who has least votes drops out, until one is left."""
    lead = [[0] * len(by_tie) for _ in by_tie]
    for a, b, for_a, for_b in votes:
        lead[a][b], lead[b][a] = for_a - for_b, for_b - for_a
    totals, alive, out, margin = [sum(row) for row in lead], list(by_tie), [], 0
    while len(alive) > 1:
        fewest = min(totals[m] for m in alive)
        worst = next(m for m in reversed(alive) if totals[m] == fewest)
        alive.remove(worst)
        out.append(worst)
        margin = lead[alive[0]][worst]
        for m in alive:
            totals[m] -= lead[m][worst]
    return [*alive, *reversed(out)], margin / 2.0**32

'''

_SITUATIONS = '''
GOLDEN, WHOLE = 0x9E3779B97F4A7C15, (1 << 64) - 1


def mixed(h):
    """Scramble 64 bits (splitmix64)."""
    h = ((h ^ (h >> 30)) * 0xBF58476D1CE4E5B9) & WHOLE
    h = ((h ^ (h >> 27)) * 0x94D049BB133111EB) & WHOLE
    return h ^ (h >> 31)


def hashed(bits):
    """A number for a row of truths."""
    return mixed((sum(mixed((k + 1) * GOLDEN & WHOLE) for k, bit in enumerate(bits) if bit) + GOLDEN) & WHOLE)


def situation(used, near, target, stands):
    """A number for what some relations say of who is near: the set of what each of them is to the others."""
    number = 0
    for context, relations, kinds in used:
        there = objects(near[context])
        told = {
            k: hashed(
                [kind >> k & 1 for kind in kinds]
                + [k != target and stands(r, k, target) for r in relations]
                + [k != target and stands(r, target, k) for r in relations]
                + [k == target]
            )
            for k in there
        }
        whole = set()
        for k in there:
            around = {
                mixed((hashed([j != k and stands(r, k, j) for r in relations]) + told[j]) & WHOLE) for j in there
            }
            whole.add(mixed((told[k] + sum(around)) & WHOLE))
        number = mixed((number + sum(whole)) & WHOLE)
    return number

'''

_TRUST = '''
def settled(number, said, outcome, mode, margin, x, odds):
    """Value, outcome and mode of a prediction, once it is known how right such ones were, and how sure that is."""
    value, guess, regression, far = said
    if TRUST[number] is None:
        known = next((each for each in (value, guess) if math.isfinite(each)), regression)
        return known, outcome, mode, (math.nan, math.nan)
    beliefs, lawful, distant, rests = TRUST[number]
    present = x[NEXT + ANSWERS[number][1]]
    values = value, guess, regression, math.nan, present
    able = sum(1 << k for k, each in enumerate(values[:3]) if math.isfinite(each))
    winner = -mode if lawful else mode
    lead = 0
    if margin > 0.0:
        lead = 7 if margin == math.inf else min(max(math.frexp(margin)[1] + 2, 1), 6)
    if distant and mode and far >= 2.0:  # of an approximation, further than most of what it was made of
        lead = 13 if far == math.inf else min(6 + math.frexp(far)[1], 13)
    if not mode and able & 1:  # who would have given a value isn't said to have won
        lead = 1
    kind = PREDICTED if mode else outcome
    known = beliefs.get((kind, winner, lead, able)) or beliefs.get((kind, winner, -1, able))
    known = known or beliefs[kind, (winner > 0) - (winner < 0), -2, able]
    speaker, probability, interval, claimed = known
    if EXPERTS[speaker] == "own" and winner > 0:  # its record is of steps in which what it relies on was right
        probability *= math.prod(odds.get(key, 1.0) for key in rests)
    if not claimed:
        outcome = UNSURE if outcome == PREDICTED else outcome
    elif outcome == UNEXPLAINED and winner:
        outcome = PREDICTED
    return values[speaker], outcome, mode, (probability, interval)

'''

_REGRESSION = '''
SPREADS = {}  # what leverage is worked out from, by the text that says it


def spread(text, width):
    """Entries on and below the diagonal, those below it twice; what the text says is read once."""
    if text not in SPREADS:
        upper = np.zeros((width, width))
        upper[np.triu_indices(width)] = np.frombuffer(base64.b64decode(text), dtype="<f4")
        SPREADS[text] = (upper + np.triu(upper, 1)).T
    return SPREADS[text]


def in_order(terms):
    """The sum of some terms, one after the other."""
    return float(np.add.accumulate(np.array(terms))[-1])


def regressed(x, squares):
    """The next value by least squares on some numbers and on their products, each as far as the leverage allows.

    And the squared distance from what was learned, 1 in the mean.
    """
    if squares is None:
        return math.nan, 0.0
    present, fit, weights, least, most, trusted = squares
    columns, reach = fit
    z = [(x[c] - centre) / scale for c, centre, scale in columns]
    both = z, z + [z[i] * z[j] for i in range(len(z)) for j in range(i, len(z))]
    with np.errstate(over="ignore", invalid="ignore"):
        words = [in_order(np.array([1.0, *shown]) * np.array(row)) for shown, row in zip(both, weights)]
    words = [min(max(word, least), most) if word == word else word for word in words]
    whole, distance = 0.0, math.nan
    for word, shown, (mean, text), (growth, midst, say) in zip(words, both, reach, trusted):
        off = np.array(shown) - np.array(mean)
        with np.errstate(over="ignore", invalid="ignore"):
            far = in_order(off * np.add.accumulate(spread(text, len(mean)) * off[:, None])[-1])
        h = (far if far >= 0.0 else math.inf) + midst
        if distance != distance:
            distance = h / min(1.0, len(mean) * midst)
        share = say[0]
        for weight, rate in zip(say[1:], RATES[1:]):
            share = share + weight / (1.0 + rate * (h * growth))
        if math.isfinite(word):
            whole = whole + share * (word - whole)
    return x[present] + whole if math.isfinite(words[0]) else math.nan, distance

'''

_ROLES = '''
def players(described, roles, lenient, target, scene):
    """The bodies that fill all roles best, together; None where there are none, or others fill them as well."""
    order, shown, options = lined_up(scene, target), (1 << len(BODIES)) - 1, []
    for whom, likely, common, places in described:
        some = []
        for at, each in enumerate(order):
            score = likely(target, each, shown, scene.stands) if whom >> each & 1 else math.nan
            if score == score:
                some.append((score, typical(common, each, target, scene.stands), at, each))
        some.sort(key=lambda one: (-one[0], -one[1]))
        options.append(list(itertools.combinations(some[: roles + 1], len(places))))
    best, single = None, True
    for way in itertools.product(*options):
        chosen = [one for part in way for one in part]
        if len({one[3] for one in chosen}) < len(chosen):
            continue
        score, common = 0.0, 0
        for one in chosen:
            score, common = score + one[0], common + one[1]
        worth = float(np.round(score * 1e9)), common
        if best is not None and worth == best[0]:
            single = False
        if best is None or worth > best[0]:
            best, single = (worth, way), True
    if best is None or not (lenient or (single and best[0][1] == roles)):
        return None
    found = [None] * roles
    for (_, _, _, places), part in zip(described, best[1]):
        for place, one in zip(places, sorted(part, key=lambda one: one[2])):
            found[place] = one[3]
    return found


def nobody(target, scene):
    """Nothing is known of who is bound to the roles."""
    return None


def typical(common, each, target, stands):
    """Whether a body has all that players so far had in common: relations both ways, and kinds."""
    if common is None:
        return False
    towards, back, among = common
    return (
        bool(among >> each & 1)
        and all(stands(RELATIONS[r], each, target) for r in towards)
        and all(stands(RELATIONS[r], target, each) for r in back)
    )


def lined_up(scene, t):
    """The other bodies as t sees them: by type, by what they are to t, to the others, then nearer ones first."""
    if ("order", t) in scene.seen:
        return scene.seen["order", t]
    others = [k for k in range(len(BODIES)) if k != t]
    kind = [body[3] for body in BODIES]
    toward = {k: both_ways(scene, k, t) for k in others}
    keys = {k: (kind[k], -toward[k]) for k in others}
    if len(set(keys.values())) < len(others):  # some are alike
        kinds = sorted({kind[k] for k in others})
        for k in others:
            around = 0
            for j in others:
                if j != k:
                    bits = both_ways(scene, k, j) + ((kinds.index(kind[j]) + 1) << 2 * len(RELATIONS))
                    around += mixed((mixed((bits + GOLDEN) & WHOLE) + toward[j] + GOLDEN) & WHOLE)
            near = float(np.round(scene.measured(min(k, t), max(k, t))[0] / 1e-9))
            keys[k] = (*keys[k], around & WHOLE, near, *(scene.x[c] for c in POSES[k]))
    scene.seen["order", t] = sorted(others, key=keys.__getitem__)
    return scene.seen["order", t]


def both_ways(scene, a, b):
    """Which relations hold between two bodies either way round, as bits."""
    bits = 0
    for r in RELATIONS:
        bits = bits << 2 | scene.stands(r, a, b) << 1 | scene.stands(r, b, a)
    return bits

'''

_SCENE = '''
def dot(a, b):
    """The inner product of two vectors."""
    found = a[0] * b[0]
    for p, q in zip(a[1:], b[1:]):
        found += p * q
    return found


def solids(offset, reach, spheres):
    """Signed distance and normal of two spheres, or of two boxes that aren't turned, in space."""
    if spheres:
        length = math.sqrt(dot(offset, offset))
        if not length > 0.0:
            return length - reach[0], *offset[:2], 1.0
        return length - reach[0], *(each / length for each in offset)
    gaps = [abs(a) - r for a, r in zip(offset, reach)]
    depth = max(gaps)
    if depth > 0.0:
        apart = [max(gap, 0.0) for gap in gaps]
        depth = math.sqrt(dot(apart, apart))
        normal = [each / depth for each in apart]
    else:
        normal = [float(k == gaps.index(depth)) for k in range(3)]
    return depth, *(-n if a < 0.0 else n for a, n in zip(offset, normal))


class Scene:
    """The bodies of a scene: who touches whom, and how they lie to each other; worked out when asked for."""

    def __init__(self, x):
        self.x, self.known, self.lines, self.seen = x, {}, {}, {}
        self.low, self.high, self.place = [], [], []
        for k, (name, shape, outline, _, columns, _, _) in enumerate(BODIES):
            self.place.append([x[c] for c in columns[:DIMENSIONS]])
            extents, angle = [x[c] for c in columns[3 : 3 + DIMENSIONS]], x[columns[6]]
            uneven = shape == "round" and max(abs(e - extents[0]) for e in extents) > 1e-9 * extents[0]
            if uneven or not all(e > 0.0 for e in extents):
                raise ValueError(f"{name}: extents must be positive, and of what is round equal; got {extents}")
            if DIMENSIONS == 3 and shape != "round" and any(x[c] != 0.0 for c in POSES[k][3:6]):
                raise ValueError(f"{name}: boxes in space must not be turned")
            if shape == "round" or DIMENSIONS == 3:
                halves = [0.5 * (extents[0] if shape == "round" else e) for e in extents]
                low, high = [-half for half in halves], halves
            elif angle == 0.0:
                corners = [[a * e for a in axis] for axis, e in zip(zip(*outline), extents)]
                low, high = [min(axis) for axis in corners], [max(axis) for axis in corners]
            else:
                starts = self.edges(k)[:2, 0]
                low, high = starts.min(axis=1).tolist(), starts.max(axis=1).tolist()
            self.low.append(low)
            self.high.append(high)
        if MOVES:
            move(self)

    def column(self, body, number):
        """A number of a body: 0-2 place, 3-5 extents, 6 angle, 7-9 velocity, 10 spin."""
        return self.x[BODIES[body][4][number]]

    def edges(self, k):
        """Starts, outward normals and lengths of a polygon's edges, shape (5, 1, edges)."""
        if k not in self.lines:
            outline = BODIES[k][2]
            width, height, angle = self.column(k, 3), self.column(k, 4), self.column(k, 6) * TURN
            cos, sin = (1.0, 0.0) if angle == 0.0 else (math.cos(angle), math.sin(angle))
            rows = []
            for (ax, ay), (bx, by) in zip(outline, (*outline[1:], outline[0])):
                a, b, along, up = ax * width, ay * height, (bx - ax) * width, (by - ay) * height
                length = math.sqrt(along * along + up * up)
                across, down = up / length, -along / length
                rows.append((cos * a + -sin * b, sin * a + cos * b, cos * across + -sin * down,
                             sin * across + cos * down, length))
            self.lines[k] = np.array(rows).T[:, None]
        return self.lines[k]

    def measured(self, i, j):
        """Signed distance and normal of bodies i < j; the normal points from j to i."""
        if (i, j) not in self.known:
            self.known[i, j] = self._measured(i, j)
        return self.known[i, j]

    def _measured(self, i, j):
        kinds, offset = (BODIES[i][1], BODIES[j][1]), [p - q for p, q in zip(self.place[i], self.place[j])]
        if DIMENSIONS == 3:
            reach = [a + b for a, b in zip(self.high[i], self.high[j])]
            return solids(offset, reach, kinds[0] == "round")
        x, y = offset
        wide_i, wide_j, tall_i, tall_j = *(self.column(k, 3) for k in (i, j)), *(self.column(k, 4) for k in (i, j))
        if kinds == ("round", "round"):
            return discs(x, y, 0.5 * wide_i + 0.5 * wide_j)
        if kinds[0] == "round":
            return disc_and_polygon(x, y, 0.5 * wide_i, self.edges(j), 0, len(BODIES[j][2]))
        if kinds[1] == "round":
            d, nx, ny = disc_and_polygon(-x, -y, 0.5 * wide_j, self.edges(i), 0, len(BODIES[i][2]))
            return d, -nx, -ny
        if kinds == ("box", "box") and self.column(i, 6) == 0.0 and self.column(j, 6) == 0.0:
            return boxes(x, y, 0.5 * wide_i + 0.5 * wide_j, 0.5 * tall_i + 0.5 * tall_j)
        count_i, count_j = len(BODIES[i][2]), len(BODIES[j][2])
        edge = np.zeros((5, 2, max(count_i, count_j)))
        edge[:, 0, :count_i], edge[:, 1, :count_j] = self.edges(i)[:, 0], self.edges(j)[:, 0]
        return polygons(x, y, edge, 0, count_i, 1, count_j)

    def normal(self, a, b):
        """Unit vector from b to a."""
        _, *normal = self.measured(min(a, b), max(a, b))
        return normal if a < b else [-n for n in normal]

    def limit(self, a, b, least, numbers):
        """Distance up to which two bodies touch, or speed up to which they don't part."""
        sizes = (abs(self.column(k, n)) for k in (a, b) for n in numbers) if PRECISION else ()
        return least + PRECISION * max((1.0, *sizes)) if PRECISION else least

    def touching(self, a, b):
        """Whether two bodies touch."""
        key = "touch", min(a, b), max(a, b)
        if key not in self.seen:
            self.seen[key] = self.measured(*key[1:])[0] <= self.limit(a, b, TOUCH, range(6))
        return self.seen[key]

    def velocity(self, a, b):
        """Relative velocity of two bodies."""
        return [self.column(a, 7 + d) - self.column(b, 7 + d) for d in range(DIMENSIONS)]

    def parting(self, a, b):
        """Normal speed beyond which two bodies part."""
        return self.limit(a, b, PART, (7, 8, 9))

    def closing(self, a, b):
        """Normal speed of two bodies that touch and don't part; infinite of others."""
        a, b = min(a, b), max(a, b)
        if not (BODIES[a][5] or BODIES[b][5]) or not self.touching(a, b):
            return math.inf
        speed = dot(self.velocity(a, b), self.normal(a, b))
        return speed if speed <= self.parting(a, b) else math.inf

    def stands(self, relation, a, b):
        """Whether a relation holds of two bodies."""
        if a == b:
            return False
        key = relation, a, b
        if key not in self.seen:
            self.seen[key] = self._stands(relation, a, b)
        return self.seen[key]

    def _stands(self, relation, a, b):
        if relation == "intersect":
            return self.touching(a, b)
        if relation.startswith("approaching"):
            own = self.closing(a, b)
            if relation == "approaching" or own == math.inf:
                return own < math.inf
            others = (self.closing(a, k) for k in range(len(BODIES)) if k not in (a, b))
            return all(own <= other + self.parting(a, b) for other in others)
        wide = [[high - low for low, high in zip(self.low[k], self.high[k])] for k in (a, b)]
        if relation == "smaller-than":
            return 1.1 * math.sqrt(dot(wide[0], wide[0])) < math.sqrt(dot(wide[1], wide[1]))
        if relation == "on-top":
            return self.touching(a, b) and all(
                self.beside(b, a, d) if d == UP else self.overlap(a, b, d) >= 0.1 * wide[0][d]
                for d in range(DIMENSIONS)
            )
        axis, _, kind = relation.partition("-")
        axis = AXES.index(axis)
        less, greater = self.beside(a, b, axis), self.beside(b, a, axis)
        return {"less-than": less, "greater-than": greater, "aligned": not (less or greater)}[kind]

    def overlap(self, a, b, axis):
        """How far the extents of two bodies overlap along an axis."""
        offset = self.place[a][axis] - self.place[b][axis]
        low, high = self.low[a][axis] + offset, self.high[a][axis] + offset
        return min(high, self.high[b][axis]) - max(low, self.low[b][axis])

    def beside(self, a, b, axis):
        """Whether a lies on the low side of b along an axis, up to a twentieth of the smaller extent."""
        (low_a, high_a), (low_b, high_b) = ((self.low[k][axis], self.high[k][axis]) for k in (a, b))
        offset = self.place[a][axis] - self.place[b][axis]
        return (low_b - high_a) - offset >= -(0.05 * min(high_a - low_a, high_b - low_b))

    def surroundings(self, t):
        """What t approaches fastest, what is close to it, and all, as bits; t; features of pairs by number."""
        if t in self.seen:
            return self.seen[t]
        count = len(BODIES)
        pair, touched, leaving, speeds = [{} for _ in range(count)], [], set(), {}
        for k in range(count):
            if k == t:
                continue
            near = self.touching(t, k)
            pair[k] |= {FACTS + f: self.x[c] for f, c in enumerate(OTHERS[k])}
            if not near and not OFFSETS:
                continue
            v, n = self.velocity(t, k), self.normal(t, k)
            distance, approach = self.measured(min(t, k), max(t, k))[0], dot(v, n)
            if near:
                touched.append(k)
                pair[k][DIMENSIONS + 1] = speeds[k] = approach
                if approach > self.parting(t, k):
                    leaving.add(k)
                else:
                    pair[k] |= {0: distance, **{1 + d: each for d, each in enumerate(n)}}
                    if DIMENSIONS == 2:
                        pair[k][DIMENSIONS + 2] = n[0] * v[1] - n[1] * v[0]
                    else:
                        across = [a - approach * b for a, b in zip(v, n)]
                        pair[k][DIMENSIONS + 2] = math.sqrt(dot(across, across))
            if OFFSETS:
                pair[k] |= {0: distance, DIMENSIONS + 1: approach}
                pair[k] |= {DIMENSIONS + 3 + d: self.place[t][d] - self.place[k][d] for d in range(DIMENSIONS)}
        others = [k for k in range(count) if k != t]
        close = touched or [min(others, key=lambda k: self.measured(min(t, k), max(t, k))[0])] if others else []
        kept = [k for k in close if k not in leaving] if PARTING else close
        held = [k for k in touched if k not in leaving]
        fastest = min((speeds[k] for k in held), default=math.inf)
        struck = [k for k in held if speeds[k] <= fastest + self.parting(t, k)] if PARTING else close
        bits = [sum(1 << k for k in {t, *some}) for some in (struck, kept or close, range(count))]
        self.seen[t] = bits, t, pair
        return self.seen[t]

'''

_COMPOSITION = '''
def axes_of(frame, c, slip):
    """The two unit vectors of a contact's frame."""
    if frame == "world":
        return (1.0, 0.0), (0.0, 1.0)
    if frame == "own":
        cos, sin = math.cos(c["angle"]), math.sin(c["angle"])
        return (cos, sin), (-sin, cos)
    nx, ny = c["centres"] if frame == "centres" else c["normal"]
    tx, ty = -ny, nx
    if frame != "turned" and slip[0] * tx + slip[1] * ty < 0.0:
        tx, ty = -tx, -ty
    return (nx, ny), (tx, ty)


def relative(frame, v, c):
    """Relative velocity at a contact: of the centres, or of the points that touch."""
    a, b = c["bodies"]
    x, y = v[0][a] - v[0][b], v[1][a] - v[1][b]
    if frame == "point":
        turning = v[2][a] * c["arms"][0] + v[2][b] * c["arms"][1]
        x, y = x - turning * -c["normal"][1], y - turning * c["normal"][0]
    return x, y


def push(frame, v, c, x, y):
    """Let a change of the relative velocity act on both bodies, and on their spins."""
    (a, b), (nx, ny), share, slide = c["bodies"], c["normal"], c["share"], (x, y)
    if frame == "point":
        along = x * nx + y * ny
        along_x, along_y = along * nx, along * ny
        slide = along_x + c["grip"] * (x - along_x), along_y + c["grip"] * (y - along_y)
        rest = (1.0 - c["grip"]) * (x * -ny + y * nx)
        both = c["arms"][0] != 0.0 and c["arms"][1] != 0.0
        for body, arm, part in ((a, c["arms"][0], share), (b, c["arms"][1], 1.0 - share)):
            if arm != 0.0:
                v[2][body] -= (part if both else 1.0) * rest / arm
    for d in range(2):
        v[d][a] += share * slide[d]
        v[d][b] -= (1.0 - share) * slide[d]


def respond(law, c, now, free):
    """Change of the relative velocity at a contact, by the law's rule for each axis."""
    frame, rules, chosen = law
    axes, given, impulses, change = axes_of(frame, c, free), [], [math.nan, math.nan], [0.0, 0.0]
    for x, y in axes:
        given += [free[0] * x + free[1] * y, now[0] * x + now[1] * y]
    for k, (x, y) in enumerate(axes):
        u, number = given[2 * k], chosen[k][c["pair"]]
        after = u if number < 0 else rules[k][number][0](*given, *impulses)
        impulses[k] = after - u
        change = [change[0] + impulses[k] * x, change[1] + impulses[k] * y]
    return change


def compose(law, contacts, now, free):
    """Let each contact answer to all others, until nothing changes; next velocities, and whether it settled."""
    frame, v = law[0], [list(row) for row in free]
    still = largest(1e-15, 8.0 * 2.0**-52 * worst(abs(value) for row in v for value in row))
    for c in contacts:
        c["impulse"], c["before"] = (0.0, 0.0), (0.0, 0.0)
    for sweep in range(1, 401):
        for c in contacts:
            (x, y), (jx, jy) = relative(frame, v, c), c["impulse"]
            new = respond(law, c, relative(frame, now, c), (x - jx, y - jy))
            c["step"] = new[0] - jx, new[1] - jy
            push(frame, v, c, *c["step"])
            c["impulse"] = new[0], new[1]
        moved = worst(abs(value) for c in contacts for value in c["step"])
        if len(contacts) == 1 or not moved > still:
            return v, True
        if sweep % 10 == 0:  # steps that go on alike are continued to where they end
            kept = along = 0.0
            for c in contacts:
                (ex, ey), (dx, dy) = c["before"], c["step"]
                kept, along = kept + (ex * ex + ey * ey), along + (ex * dx + ey * dy)
            ratio = min(max(along / (kept if kept > 0.0 else 1.0), 0.0), 1.0 - 1.0 / 100.0)
            steps = ratio / (1.0 - ratio) if ratio > 0.5 else 0.0
            for c in contacts:
                (dx, dy), (jx, jy) = c["step"], c["impulse"]
                push(frame, v, c, steps * dx, steps * dy)
                c["impulse"] = jx + steps * dx, jy + steps * dy
        for c in contacts:
            c["before"] = c["step"]
    return v, False


def worst(values):
    """The largest number; NaN if one is."""
    found = 0.0
    for value in values:
        found = largest(found, value)
    return found


def precedented(law, contacts, v):
    """Whether no contact turns a body back in a sense in which none was seen to."""
    frame, rules, chosen = law
    for c in contacts:
        after = relative(frame, v, c)
        free = after[0] - c["impulse"][0], after[1] - c["impulse"][1]
        for k, (x, y) in enumerate(axes_of(frame, c, free)):
            value, without = after[0] * x + after[1] * y, free[0] * x + free[1] * y
            _, back, forth = rules[k][chosen[k][c["pair"]]]
            if value < -SLACK and without >= -SLACK and not back:
                return False
            if value > SLACK and without <= SLACK and not forth:
                return False
    return True


def contacts_of(scene):
    """All contacts of those who move: directions, and who takes which part of what happens there."""
    found = []
    for number, (a, b, share, grip) in enumerate(PAIRS):
        if not scene.touching(a, b):
            continue
        (px, py), (qx, qy) = scene.place[a], scene.place[b]
        length = math.sqrt((px - qx) * (px - qx) + (py - qy) * (py - qy))
        length = length if length > 0.0 else 1.0
        arms = [0.5 * TURN * scene.column(k, 3) if BODIES[k][6] else 0.0 for k in (a, b)]
        if isinstance(share, tuple):
            mine = theirs = 1.0
            for _ in range(share[2]):
                mine, theirs = mine * scene.x[share[0]], theirs * scene.x[share[1]]
            share = math.nan if mine + theirs == 0.0 else theirs / (mine + theirs)
        found.append({
            "pair": number, "bodies": (a, b), "normal": scene.normal(a, b), "share": share, "arms": arms,
            "centres": ((px - qx) / length, (py - qy) / length), "angle": TURN * scene.column(a, 6),
            "grip": grip if arms[0] != 0.0 or arms[1] != 0.0 else 1.0,
        })
    return found


def move(scene):
    """Next velocities of all movers, and whether they are known: `scene.motion` and `scene.told`."""
    count = len(BODIES)
    now = [[scene.column(k, n) for k in range(count)] for n in (7, 8, 10)]
    free, known = [list(row) for row in now], [False] * count
    for body, law, governed, moving in MOVERS:
        values = [*law(scene.x), *[math.nan] * 3][:moving]
        for d, value in enumerate(values):
            free[d][body] = value
        known[body] = all(math.isfinite(value) for value in values[:governed])
    contacts = contacts_of(scene)
    involved = {k for c in contacts for k in c["bodies"]}
    v = free
    if contacts and not LAWS:
        known = [k and body not in involved for body, k in enumerate(known)]
    elif contacts:
        law, point = LAWS[0], LAWS[0][0] == "point"
        whole = free if SPINS else [*free[:2], [0.0] * count]
        after, settled = compose(law, contacts, now, whole)
        lawful = all(
            min(chosen[c["pair"]] for chosen in law[2]) >= 0
            and math.isfinite(c["share"])
            and (not point or math.isfinite(c["grip"]))
            for c in contacts
        )
        governed = 3 if point and SPINS else 2
        stated = {k: lawful and all(math.isfinite(after[d][k]) for d in range(governed)) for k in involved}
        sure = settled and lawful and precedented(law, contacts, after)
        others = [compose(other, contacts, now, whole)[0] for other in LAWS[1:]]
        for k in involved:
            agreed = all(abs(r[d][k] - after[d][k]) <= SLACK for r in others for d in range(governed))
            known[k] = known[k] and stated[k] and sure and agreed
        v = [[after[d][k] if stated.get(k) else free[d][k] for k in range(count)] for d in range(3)]
    scene.motion, scene.told = v, [(known[k], k in involved) for k in range(count)]

'''
