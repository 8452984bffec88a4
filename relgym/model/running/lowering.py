"""From what was learned to a program: a model laid over the objects of a scene (`relgym.program.records`).

What a program can't say is left to arrays (`relgym.model.predicting.querying`): laws of motion in space (and bodies
there but boxes that aren't turned, and spheres), other geometries than ``"arrays"``, functions that users registered,
roles of objects without a body that several could play, and scenes of more than `MOST_BODIES` bodies. `lowered` says so
by `relgym.program.records.BeyondError`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import consequence, difference, mode_value, turned
from relgym.classification.role_classifier import RoleClassifier
from relgym.classification.roles import _log_odds
from relgym.clustering.columns import PRIME, SlotSignature
from relgym.clustering.mode import Mode as LearnedMode
from relgym.clustering.roles import Binding
from relgym.config.constants import TOLD
from relgym.laws.book import LawBook
from relgym.laws.frames import FRAMES, POINT, axis_names
from relgym.laws.records import ONE, AxisLaw, PairLaw, Piece
from relgym.laws.shares import EXTENT
from relgym.laws.touching import Cast
from relgym.logic.clause import Clause, Literal
from relgym.model.parts import Parts
from relgym.model.percepts.perception import Percept, Perception, Situation
from relgym.model.percepts.scenes import angle_columns
from relgym.model.running.bodies import body_of, check_bodies, constants_of
from relgym.model.target.property_model import PropertyModel
from relgym.model.target.stops import Stop as LearnedStop
from relgym.numeric.tree import DecisionTree
from relgym.program import records as ir
from relgym.scene.axes import Axes
from relgym.scene.contacts import APPROACH_EPS
from relgym.scene.objects import TASK, SceneLayout, Target

__all__ = ["lowered"]


def lowered(parts: Parts, layout: SceneLayout) -> ir.Program:
    """The program of a model for scenes of a layout.

    Raises
    ------
    BeyondError
        Arrays must answer.

    Notes
    -----
    Cost: some milliseconds, O(objects * clauses).
    """
    return _Lowering(parts, layout).program()


class _Lowering:
    """Columns and bodies of a layout, and the program as far as it is written."""

    def __init__(self, parts: Parts, layout: SceneLayout) -> None:
        self.parts, self.layout = parts, layout
        self.perception: Perception = parts.perception
        self.axes = Axes.of(parts.schema)
        self.nan, self.zero, self.one = constants_of(layout)
        self.registers = self.one + 1
        self.keys: dict[tuple[str, str], int] = {}
        self.everything = False
        self.fits: dict[int, tuple[int, ir.Fit] | None] = {}  # of objects: their numbers, and what they are
        self.wanted: set[int] = set()
        check_bodies(self.axes, self.perception.extractor.geometry, layout)
        self.unary = {
            name: self._mask(row)
            for name, row in zip(
                self.perception._unary_names, self.perception.unary_table(layout), strict=True
            )
        }
        names = self.perception.extractor.names
        self.relation_numbers = {name: k for k, name in enumerate(names)}
        # Situations read only the layout of a percept, as far as they are asked here.
        nothing = np.empty((0, layout.width))
        self._percept = Percept(self.perception, layout, nothing, None)

    def _mask(self, flags: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> int:
        return sum(1 << int(k) for k in np.flatnonzero(flags))

    def register(self) -> int:
        """A new one."""
        self.registers += 1
        return self.registers - 1

    # ------------------------------------------------------------------ the whole
    def program(self) -> ir.Program:
        """The program."""
        parts, layout = self.parts, self.layout
        bodies = tuple(self._body(k) for k in range(len(layout.bodies)))
        names = sorted({layout.types[i].name for i in layout.bodies})
        groups = tuple(names.index(layout.types[i].name) for i in layout.bodies)
        if any(model.surmise for model in parts.models.values()):
            raise ir.BeyondError("modes that are never claimed")
        motion = self._motion() if parts.laws is not None and parts.laws.governed else None
        answers = tuple(
            self._answer(target, index) for target in parts.targets for index in layout.of_type(target.type)
        )
        kinematics = tuple(
            (
                layout.column(index, law.property),
                law.step,
                layout.column(index, law.rate) + layout.width * law.uses_next,
            )
            for law in parts.schema.derivations
            for index in layout.of_type(law.type)
        )
        extractor, perception = self.perception.extractor, self.perception
        others = tuple(
            tuple(self.nan if c == layout.width else int(c) for c in row)
            for row in perception.feature_columns(layout)
        )
        columns = tuple(
            f"{name}.{prop}"
            for name, t in zip(layout.names, layout.types, strict=True)
            for prop in t.properties
        )
        return ir.Program(
            layout.width,
            self.registers,
            columns,
            bodies,
            groups,
            len(self.axes.used),
            self.axes.up,
            self.axes.turn,
            extractor.eps,
            APPROACH_EPS,
            parts.schema.precision,
            tuple(extractor.names),
            frozenset(self.wanted),
            tuple(extractor.features),
            others,
            parts.schema.offsets,
            perception.parting,
            self.everything,
            motion,
            tuple(known[1] for known in self.fits.values() if known is not None),
            answers,
            kinematics,
            tuple(angle_columns(layout).tolist()),
        )

    def _body(self, number: int) -> ir.Body:
        t = self.layout.types[self.layout.bodies[number]]
        sources = None if self.parts.laws is None else self.parts.laws.learner.sources.get(t.name)
        return body_of(self.axes, self.layout, number, None if sources is None else sources.spin)

    # ------------------------------------------------------------------ laws of motion
    def _motion(self) -> ir.Motion:
        laws = self.parts.laws
        assert laws is not None, "asked only where laws govern something"
        if not self.axes.planar:
            raise ir.BeyondError("laws of motion in space")
        book: LawBook = laws.learner.book
        if book.turning:
            raise ir.BeyondError("laws at points of bodies that turn")
        cast = book.cast(self.layout)
        movers = tuple(self._mover(book, cast, body) for body in cast.movers)
        engaged = book._engaged_pairs(cast)
        pairs = tuple(self._pair(book, cast, k) for k in range(len(cast.first)))
        in_force = tuple(self._law(e.law, e.chosen) for e in engaged)
        return ir.Motion(movers, pairs, in_force, TOLD * book.tolerance, len(cast.velocities) > 2)

    def _mover(self, book: LawBook, cast: Cast, body: int) -> ir.Mover:
        sources, places = cast.sources[body]
        where = {
            name: self.nan if p == self.layout.width else int(p)
            for name, p in zip(sources.names, places, strict=True)
        }
        law = book.free_law(sources.type.name)
        free = () if law is None else tuple(_piece(piece, where) for piece in law.components)
        return ir.Mover(body, free, len(book.components(sources.type.name)), len(sources.moving))

    def _law(self, law: PairLaw, chosen: np.ndarray[tuple[int, int], np.dtype[np.intp]]) -> ir.Law:
        if law.frame not in FRAMES:
            raise ir.BeyondError(f"the frame {law.frame!r}")
        letters = axis_names(law.frame, 2)
        columns = {
            f"{what}_{letter}": 2 * k + j for k, letter in enumerate(letters) for j, what in enumerate("uv")
        }
        columns |= {f"J_{letter}": 2 * len(letters) + k for k, letter in enumerate(letters)}
        first, second = (tuple(_rule(rule, columns) for rule in rules) for rules in law.axes)
        numbers = tuple(tuple(int(n) for n in row) for row in chosen)
        return ir.Law(law.frame, (first, second), (numbers[0], numbers[1]))

    def _pair(self, book: LawBook, cast: Cast, k: int) -> ir.Pair:
        first, second = int(cast.first[k]), int(cast.second[k])
        grip = (
            book.pair.grip(cast.kinds[k]) if book.pair is not None and book.pair.frame == POINT else math.nan
        )
        if not cast.both[k]:
            return ir.Pair(first, second, ir.Share(), grip)
        known = book.shares.get(cast.kinds[k])
        if known is None or not known.property:
            return ir.Pair(first, second, ir.Share(math.nan if known is None else known.constant), grip)
        columns = [self._shared(cast, body, known.property) for body in (first, second)]
        return ir.Pair(first, second, ir.Share(1.0, (columns[0], columns[1]), known.power), grip)

    def _shared(self, cast: Cast, body: int, prop: str) -> int:
        if prop == EXTENT:
            return self._body(body).extent[0]
        sources, places = cast.sources[body]
        return int(places[sources.names.index(prop)])

    # ------------------------------------------------------------------ answers
    def _answer(self, target: Target, index: int) -> ir.Answer:
        parts, layout = self.parts, self.layout
        model = parts.models[target]
        body = layout.bodies.index(index) if index in layout.bodies else -1
        key = self.keys.setdefault((target.type, target.property), len(self.keys))
        needs = tuple(sorted(self.keys[pair] for pair in model.needs if pair in self.keys))
        situation = Situation(self._percept, index)
        signature = situation.signature
        gather = self.perception.gather(layout, signature, tuple(situation.plain.tolist()))
        one = _Columns(self, signature, gather.tolist())
        guess, beyond = (
            _bound_sum(model.fallback.guessing(signature, beyond=b), one.column) for b in (False, True)
        )
        scope = None
        bounded = guess is not None or beyond is not None or model.clusterer.approximate
        if (
            model.fallback.scope.tree is not None
            and (places := model.fallback.scope.places(signature)) is not None
        ):
            scope = self._scope_tree(model.fallback.scope.tree, [one.column(k) for k in places])
        column = layout.column(index, target.property)
        present = self.zero if target.type == TASK else column
        reach = (
            ir.Reach(present, float(model.fallback.scope.least), float(model.fallback.scope.most))
            if bounded
            else None
        )
        governed = parts.governs(target)
        laws = parts.laws
        component = laws._components[target.type, target.property] if governed and laws is not None else -1
        fields: dict[str, object] = {}
        regression = None
        if not governed:
            fields = self._modes(model, layout, index, body, situation, one)
            regression = (
                self._regression(target, index, signature, gather.tolist())
                if model.asks_regressions
                else None
            )
        return ir.Answer(
            layout.names[index],
            target.property,
            column,
            key,
            needs,
            body,
            component,
            scope=scope,
            reach=reach,
            guess=guess,
            beyond=beyond,
            regression=regression,
            features=tuple(one.features.values()),
            **fields,  # type: ignore[arg-type]
        )

    def _modes(
        self,
        model: PropertyModel,
        layout: SceneLayout,
        index: int,
        body: int,
        situation: Situation,
        one: _Columns,
    ) -> dict[str, object]:
        """What an answer by modes says besides."""
        ids = model.classifier.modes
        if model.lost or not ids:
            return {"state": "lost" if model.lost else "none", "modes": ()}
        signature = situation.signature
        found = tuple(self._mode(model, number, situation, one, body) for number in ids)
        registers = {mode.id: mode.register for mode in found}
        own = self._own_columns(model, layout, index, signature, one)
        scalars: dict[str, tuple[int, int]] = {name: (c, -1) for name, c in own.items()}
        scalars |= {mode_value(m): (r, -1) for m, r in registers.items()}
        scalars |= {difference(i, j): (registers[i], registers[j]) for i in ids for j in ids if i < j}
        follows: list[ir.Follow] = []
        vocabulary = model.classifier.vocabulary
        asked = _names_tested(model.classifier.classifiers)
        for name, k in vocabulary.follows:
            for m in ids:
                if (said := consequence(name, k, m)) in asked:
                    follows.append(ir.Follow(self.register(), own[name], registers[m], k))
                    scalars[said] = (follows[-1].register, -1)
        for m in ids if vocabulary.present else ():
            if (said := turned(m, vocabulary.present)) in asked:
                follows.append(ir.Follow(self.register(), own[vocabulary.present], registers[m], 0.0))
                scalars[said] = (follows[-1].register, -1)
        vote = self._vote(model, scalars, body) if len(ids) > 1 else None
        limits = model.limits
        return {
            "follows": tuple(follows),
            "said": not model.undecided,
            "abstains": model.config.abstain,
            "modes": found,
            "vote": vote,
            "clipped": model.clusterer.approximate,
            "low": (limits.low, float(limits.least)),
            "high": (limits.high, float(limits.most)),
            "stops": tuple(self._stops(model, signature, one)),
        }

    def _regression(
        self, target: Target, index: int, signature: SlotSignature, gather: list[int]
    ) -> ir.Regression | None:
        """Least squares of a target's changes; None while there is nothing."""
        learned = self.parts.regressions[target.type]
        if (told := learned.sums(target.property)) is None:
            return None
        if index not in self.fits:
            known = learned.fit(signature)
            self.fits[index] = None
            if known is not None:
                places, centre, scale, reach = known
                columns = tuple((gather[p], c, s) for p, c, s in zip(places, centre, scale, strict=True))
                number = sum(each is not None for each in self.fits.values())
                self.fits[index] = number, ir.Fit(columns, tuple(ir.Leverage(*each) for each in reach))
        if (fit := self.fits[index]) is None:
            return None
        weights, bounds = told
        number = learned.targets.index(target.property)
        trusted = tuple(
            ir.Trusted(growth, least, tuple(say)) for growth, least, *say in learned.trusted[number].tolist()
        )
        column = self.layout.column(index, target.property)
        return ir.Regression(fit[0], column, weights, *bounds, trusted)

    def _own_columns(
        self,
        model: PropertyModel,
        layout: SceneLayout,
        index: int,
        signature: SlotSignature,
        one: _Columns,
    ) -> dict[str, int]:
        """Columns of the own features of a target's classifiers, by name."""
        base = self.perception.own_columns(layout, index)
        columns = [self.nan if c == layout.width else int(c) for c in base]
        for place in model.conditions.places(signature):
            columns.append(self.nan if place < 0 else one.column(place))
        return dict(zip(model.classifier.vocabulary.own, columns, strict=True))

    def _stops(
        self, model: PropertyModel, signature: SlotSignature, one: _Columns
    ) -> list[ir.Stop | ir.Landing]:
        found: list[ir.Stop | ir.Landing] = []
        for each in model.stops.every:
            name = each.property if isinstance(each, LearnedStop) else each.property + PRIME
            if not signature.has(0, name):
                continue
            column = one.column(signature.column(0, name))
            if isinstance(each, LearnedStop):
                found.append(ir.Stop(each.mode, each.value, column, each.step, each.bound, each.side))
            else:
                found.append(ir.Landing(each.mode, each.value, column, each.at, each.slack))
        return found

    # ------------------------------------------------------------------ modes and roles
    def _mode(
        self, model: PropertyModel, number: int, situation: Situation, one: _Columns, body: int
    ) -> ir.Mode:
        mode = model.mode(number)
        signature, layout = situation.signature, self.layout
        binding = model.functions.binding(signature, number)
        register = self.register()
        if binding is None:
            return ir.Mode(number, register, None)
        function = _bound_sum(binding, one.column, whole=True)
        plain = situation.plain
        players = (
            layout.names[int(plain[0])],
            *(layout.names[int(plain[s])] if s >= 0 else None for s in binding.forced),
        )
        if not binding.open:
            return ir.Mode(number, register, function, (), None, players)
        if body < 0:
            raise ir.BeyondError("roles that several could play, of an object without a body")
        return ir.Mode(
            number,
            register,
            function,
            self._roles(model, mode, binding),
            self._casting(model.casting.classifiers.get(number)),
            players,
        )

    def _roles(self, model: PropertyModel, mode: LearnedMode, binding: Binding) -> tuple[ir.Role, ...]:
        layout, found, place = self.layout, [], 0
        for k, (role, forced) in enumerate(zip(mode.open_roles, binding.forced, strict=True)):
            embodied = role.type in model.casting.vocabulary.unary
            if forced < 0:
                if not embodied:
                    raise ir.BeyondError("a role that several objects without a body could play")
                terms = []
                for prop, weight in role.terms:
                    bare, primed = prop.rstrip(PRIME), prop.endswith(PRIME)
                    columns = tuple(
                        layout.column(i, bare) + layout.width * primed
                        if layout.types[i].name == role.type
                        else -1
                        for i in layout.bodies
                    )
                    terms.append((weight, columns))
                found.append(ir.Role(place, tuple(terms), k))
            place += embodied
        return tuple(found)

    def _casting(self, classifier: RoleClassifier | None) -> ir.Casting | None:
        if classifier is None:
            return None
        self.everything = True
        self.wanted |= set(self.relation_numbers.values())  # they say in which order bodies are looked at
        descriptions = []
        for d in classifier.descriptions:
            clauses: tuple[tuple[ir.Clause, float], ...] = ()
            otherwise = 0.0
            if d.definition is not None:
                clauses = tuple(
                    (self._clause(clause, 2), _log_odds(coverage))
                    for clause, coverage in zip(d.definition.clauses, d.definition.coverage, strict=True)
                )
                missed = d.definition.uncovered
                otherwise = _log_odds(missed) if missed.positives > 0 else math.nan
            common = None
            if d.common is not None:
                count = len(self.relation_numbers)
                towards, back = (np.flatnonzero(d.common[s : s + count]).tolist() for s in (0, count))
                among = (1 << len(self.layout.bodies)) - 1
                for name, has in zip(self.unary, d.common[2 * count :], strict=True):
                    among &= self.unary[name] if has else among
                common = (tuple(towards), tuple(back), among)
            descriptions.append(
                ir.Description(self.unary[d.kind.type], clauses, otherwise, common, tuple(d.places))
            )
        lenient = classifier.errors > 0 or not self.parts.config.abstain
        return ir.Casting(tuple(descriptions), len(classifier.kinds), lenient)

    # ------------------------------------------------------------------ votes
    def _vote(self, model: PropertyModel, scalars: Mapping[str, tuple[int, int]], body: int) -> ir.Vote:
        classifier, modes = model.classifier, model.classifier.modes
        contests = tuple(
            self._contest(c, modes, scalars, classifier._voting._votes[k], body, classifier.vocabulary.pair)
            for k, c in enumerate(classifier._voting._classifiers)
        )
        experience = None
        if model.config.abstain:
            known, v = classifier._familiarity(), classifier.vocabulary
            used = tuple(
                (
                    ir.CONTEXTS.index(context),
                    tuple(relations),
                    tuple(self.unary[v.unary[k]] if body >= 0 else 0 for k in unary),
                )
                for context, relations, unary in known.used
            )
            self.everything |= body >= 0 and any(context == "all" for context, _, _ in known.used)
            self.wanted |= {r for _, relations, _ in known.used for r in relations}
            experience = ir.Experience(used, tuple(sorted(int(s) for s in known.seen)))
        by_tie = tuple(classifier._voting._by_tie(classifier.counts))
        return ir.Vote(contests, by_tie, experience)

    def _contest(
        self,
        c: BinaryClassifier,
        modes: tuple[int, ...],
        scalars: Mapping[str, tuple[int, int]],
        votes: list[tuple[int, int]],
        body: int,
        pair: tuple[str, ...],
    ) -> ir.Contest:
        last, stages = len(c.definition.clauses), []
        self.everything |= body >= 0 and c.context == "all"
        for number, clause in enumerate((*c.definition.clauses, None)):
            tree = c.fall_through_tree if number == last else c.clause_trees[number]
            tests, said = [], None
            if clause is not None:
                tests = [
                    self._test(literal, scalars) for literal in clause if literal.op and not literal.args
                ]
                said = self._clause(clause, 1, pair, bodiless=body < 0)
            names = {(stage, leaf): n for (stage, leaf), n in c.outcome_of.items() if stage == number}
            if tree is None:
                stages.append(ir.Stage(said, tuple(tests), None, (names[number, -1],)))
                continue
            sights = self._sights(c, clause, tree, scalars)
            outcomes = tuple(names.get((number, node), -1) for node in range(len(tree.column)))
            stages.append(ir.Stage(said, tuple(tests), _tree(tree, sights), outcomes))
        places = modes.index(c.i), modes.index(c.j)
        return ir.Contest(*places, ir.CONTEXTS.index(c.context), tuple(stages), tuple(votes))

    def _sights(
        self,
        c: BinaryClassifier,
        clause: Clause | None,
        tree: DecisionTree,
        scalars: Mapping[str, tuple[int, int]],
    ) -> list[ir.Sight]:
        """What each column of a tree looks at; columns that it doesn't test may be anything."""
        wanted = {k for k in tree.column if k >= 0}
        names, found = c.scope.scalars, list[ir.Sight]()
        bound = (
            [] if clause is None else [(v, f) for v in range(1, clause.variables) for _, f in c.scope.pair]
        )
        for k in range(len(names) + len(bound)):
            if k not in wanted:
                found.append(ir.Sight())
            elif k < len(names):
                found.append(ir.Sight(*scalars[names[k]]))
            else:
                found.append(ir.Sight(-1, -1, *bound[k - len(names)]))
        return found

    def _test(self, literal: Literal, scalars: Mapping[str, tuple[int, int]]) -> ir.Test:
        column, minus = scalars[literal.relation]
        return ir.Test(column, minus, literal.op == "<=", literal.threshold, literal.negated)

    def _clause(
        self, clause: Clause, arity: int, pair: tuple[str, ...] = (), *, bodiless: bool = False
    ) -> ir.Clause:
        literals: list[ir.Literal] = []
        for literal in clause:
            args = literal.args
            if literal.op is not None:
                if args:
                    feature = pair.index(literal.relation)
                    at_most = literal.op == "<="
                    literals.append(
                        ir.PairTest(feature, args[1], at_most, literal.threshold, literal.negated)
                    )
            elif literal.relation in self.relation_numbers:
                first, second = args
                number = self.relation_numbers[literal.relation]
                self.wanted.add(number)
                literals.append(ir.Related(number, first, second, literal.negated))
            else:
                objects = 0 if bodiless else self.unary[literal.relation]
                literals.append(ir.IsA(objects, args[0], literal.negated))
        return ir.Clause(arity, max(arity, clause.variables), tuple(literals), str(clause))

    def _scope_tree(self, tree: DecisionTree, columns: list[int]) -> tuple[ir.Tree, tuple[int, ...]]:
        sights = [ir.Sight(column, -1) for column in columns]
        outcomes = tuple(int(tree.says_yes(node)) for node in range(len(tree.column)))
        return _tree(tree, sights), outcomes


class _Columns:
    """Registers of one object's regression columns; features get theirs when first asked for."""

    def __init__(self, lowering: _Lowering, signature: SlotSignature, gather: list[int]) -> None:
        self._lowering, self._signature, self._gather = lowering, signature, gather
        self.features: dict[int, ir.Feature] = {}

    def column(self, index: int) -> int:
        """The register of a column of the regression row."""
        width = len(self._signature.columns)
        if index < width:
            return self._gather[index]
        if index not in self.features:
            feature = self._signature.features[index - width]
            factors = []
            for atom in feature.atoms:
                if atom.function not in ("", "sin", "cos"):
                    raise ir.BeyondError(f"the function {atom.function!r}, which a user registered")
                factors.append(ir.Factor(self._gather[atom.column], atom.function, atom.frequency))
            register = self._lowering.register()
            self.features[index] = ir.Feature(register, tuple(factors), feature.name)
        return self.features[index].register


def _bound_sum(
    binding: Binding | None, column: Callable[[int], int], *, whole: bool = False
) -> ir.Sum | None:
    """The fixed part of a binding; None where it is open, unless that is wanted."""
    if binding is None or (binding.open and not whole):
        return None
    terms = [(ir.CONSTANT, float(binding.intercept))]
    return ir.Sum((*terms, *((column(c), float(w)) for c, w in binding.fixed)))


def _piece(piece: Piece, where: Mapping[str, int]) -> ir.Sum:
    return ir.Sum(tuple((ir.CONSTANT if name == ONE else where[name], w) for name, w in piece.terms))


def _rule(rule: AxisLaw, columns: Mapping[str, int]) -> ir.AxisRule:
    pieces = tuple(_piece(piece, columns) for piece in rule.pieces)
    return ir.AxisRule(rule.operator, pieces, *rule.signs)


def _tree(tree: DecisionTree, sights: list[ir.Sight]) -> ir.Tree:
    nodes = zip(tree.column, tree.threshold, tree.below, tree.above, strict=True)
    return ir.Tree(tuple(sights), tuple((int(c), float(t), int(b), int(a)) for c, t, b, a in nodes))


def _names_tested(classifiers: tuple[BinaryClassifier, ...]) -> set[str]:
    """Names of all numbers that clauses and trees look at."""
    names: set[str] = set()
    for c in classifiers:
        names |= {literal.relation for clause in c.definition.clauses for literal in clause if literal.op}
        trees = [tree for tree in (*c.clause_trees, c.fall_through_tree) if tree is not None]
        names |= {tree.columns[k] for tree in trees for k in tree.column if k >= 0}
    return names
