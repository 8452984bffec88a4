"""A program as two flat arrays: whole numbers that say what to do, and the numbers to do it with.

One kernel, compiled once, runs them all, so a model that learns on needs no compiler. A record is a run of whole
numbers; where it holds others, it names where those begin (0: there is none). `Tape.code` begins with `HEADER` entries.
"""

from __future__ import annotations

import math
from array import array
from base64 import b64decode
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.program import records as ir

__all__ = ["Sizes", "Tape", "encoded", "kind_of", "ordered", "space_of"]

HEADER = 28
(
    WIDTH,
    REGISTERS,
    BODIES,
    AT_BODIES,
    ANSWERS,
    AT_ANSWERS,
    MOVERS,
    AT_MOVERS,
    PAIRS,
    AT_PAIRS,
    LAWS,
    AT_LAWS,
) = range(12)
(KINEMATICS, AT_KINEMATICS, ANGLES, AT_ANGLES, RELATIONS, FACTS, OTHERS) = range(12, 19)
(OFFSETS, PARTING, EVERYTHING, KEYS, DIMENSIONS, UP, NEXTS, AT_NEXTS, ASKED) = range(19, 28)
"""Entries of the header."""

(TURN, TOUCH, PART, PRECISION, SLACK) = range(5)
"""Entries that the numbers begin with."""

BODY = 26
"""Length of a body's record."""

RELATION_KINDS = {
    "approaching": 0,
    "approaching-fastest": 1,
    "intersect": 2,
    "on-top": 3,
    "smaller-than": 4,
    "less-than": 5,
    "greater-than": 8,
    "aligned": 11,
}
"""What a relation is, for the kernel; those along an axis count from here, in the axes' order."""


class Sizes(NamedTuple):
    """What a work space has room for: how many of each."""

    code: int
    numbers: int
    registers: int
    bodies: int
    corners: int
    contacts: int
    relations: int
    features: int
    modes: int
    variables: int
    roles: int
    keys: int
    answers: int
    shown: int
    remembered: int
    """Relational states that a kernel remembers answers of: a power of two."""


REMEMBERED, REMEMBERED_MODES, REMEMBERED_ROLES = 512, 8, 6
"""Relational states that a kernel remembers answers of (a power of two), and of how many modes and roles."""

MOST_CONTACTS = 128

MOST = Sizes(
    code=65536,
    numbers=131072,
    registers=4096,
    bodies=ir.MOST_BODIES,
    corners=16,
    contacts=MOST_CONTACTS,
    relations=16,
    features=64,
    modes=64,
    variables=12,
    roles=12,
    keys=256,
    answers=512,
    shown=512,
    remembered=REMEMBERED,
)
"""Of the work space that one kernel, compiled once, runs any program in."""

NOBODY = -(1 << 62)
"""No kind of predictions."""


def space_of(most: Sizes) -> np.dtype[np.void]:
    """Where a scene is worked on, in fixed places: a kernel is handed one address, whatever the program."""
    bodies, modes, answers = most.bodies, most.modes, most.answers
    fields: list[tuple[str, Any, tuple[int, ...]]] = [
        ("code", np.int64, (most.code,)),  # the tape
        ("numbers", np.float64, (most.numbers,)),
        ("x", np.float64, (most.registers,)),  # registers
        ("body", np.float64, (bodies, 12)),  # place, bounding box, sizes for coarse numbers, size of the box
        ("placed", np.int64, (bodies,)),  # whether a body's edges are worked out
        ("edge", np.float64, (5, bodies, most.corners)),  # starts, outward normals, lengths
        ("gap", np.float64, (4, bodies, bodies)),  # distance and normal, first < second
        ("known", np.int64, (2, bodies, bodies)),  # when measured; when touching was asked for, and 1 if so
        ("velocity", np.float64, (4, 3, bodies)),  # now, next if free, next, next by an alternative law
        ("contact", np.float64, (most.contacts, 16)),
        ("pair", np.int64, (most.contacts, 3)),  # its number, first and second body
        ("features", np.float64, (6,)),  # what laws read of a contact
        ("body_flags", np.int64, (4, bodies)),  # stated, known, involved, stated by the law in force
        ("told", np.float64, (bodies, most.features)),  # pair features of a target
        # Contexts of a target; whose they are; among whom relations are known; the time; whether they are written out.
        ("masks", np.int64, (7,)),
        ("kinds", np.int64, (bodies, bodies)),  # how bodies stand to each other: bits of kinds of relations
        ("rows", np.int64, (most.relations, bodies)),  # to whom an object stands in a relation
        ("columns", np.int64, (most.relations, bodies)),  # who stands in a relation to an object
        ("value", np.int64, (most.variables,)),  # objects of variables
        ("left", np.int64, (most.variables,)),  # objects still to try
        ("found", np.int64, (most.variables,)),  # objects that a variable can stand for
        ("votes", np.int64, (modes, modes)),  # by how much a mode leads
        ("order", np.int64, (3, modes)),
        ("hashes", np.uint64, (3, bodies + 1)),
        ("lost", np.int64, (most.keys,)),  # properties that could not be predicted
        ("odds", np.float64, (most.keys,)),  # how probably those that were are right, at least
        ("lineup", np.int64, (1, bodies)),  # bodies in canonical order
        ("options", np.float64, ((most.roles + 1) ** 2, 4)),  # candidates of roles
        ("cast", np.int64, (5, max(bodies, most.roles) + 2)),
        ("outcomes", np.int64, (answers,)),  # of each answer
        ("modes", np.int64, (answers,)),
        ("margins", np.float64, (answers,)),
        ("players", np.int64, (answers, most.roles)),  # bodies bound to its roles
        # The last kind of an answer's predictions, and what is made of it.
        ("believed", np.int64, (answers, 2)),
        ("sure", np.float64, (answers, 2)),  # probability and interval of each answer
        # What others say of an answer: 0: nothing, 1: it is known, 2: it isn't; and its value.
        ("given", np.int64, (answers,)),
        ("given_values", np.float64, (answers,)),
        ("touched", np.int64, (answers,)),  # whom a mover touches; or the mode that gave a value
        # What the winner, the guess and both regressions say of each answer, and what no program knows; NaN: nothing.
        ("experts", np.float64, (answers, 4)),
        ("fitted", np.int64, (1,)),  # what regressions look at lies in `shown`; 0: nothing does
        ("shown", np.float64, (2, most.shown)),  # that, and how far from what they know
        ("leverage", np.float64, (2,)),  # of both regressions there
        ("far", np.int64, (answers,)),  # the bin of how far that is from what was learned
        ("state", np.uint64, (1,)),  # all relations that are known, as a number
        ("memory_keys", np.uint64, (most.remembered,)),
        ("memory", np.int64, (most.remembered, 2 + REMEMBERED_MODES * (2 + REMEMBERED_ROLES))),
    ]
    return np.dtype(fields, align=True)


SPACE = space_of(MOST)
"""The work space of the kernel that is compiled once."""


@dataclass(frozen=True, slots=True)
class Tape:
    """The two arrays, and how large a scene's work space must be.

    Attributes
    ----------
    code
        Whole numbers, shape ``(c,)``.
    numbers
        Shape ``(m,)``.
    sizes
        The least that a work space must have room for.
    votes
        Of every answer that is voted for, in order: where the votes of each contest begin in the code, and where its
        modes stand in the order in which they win ties.
    reaches
        Of every answer, where among the numbers bounds of regressions' changes stand, and how far they are trusted; -1:
        there are none.
    """

    code: NDArray[np.int64]
    numbers: NDArray[np.float64]
    sizes: Sizes
    votes: tuple[tuple[tuple[int, ...], int], ...] = ()
    reaches: tuple[int, ...] = ()

    def space(self) -> NDArray[np.void]:
        """A work space with the tape in it, shape ``(1,)``."""
        found = np.zeros(1, dtype=SPACE)
        self.lay(found)
        return found

    def lay(self, space: NDArray[np.void]) -> None:
        """Put the tape into a work space, in place of another one; nothing of that is remembered."""
        space["code"][0, : len(self.code)], space["numbers"][0, : len(self.numbers)] = self.code, self.numbers
        space["memory_keys"], space["believed"] = 0, NOBODY


def encoded(program: ir.Program) -> Tape:
    """The tape of a program.

    Raises
    ------
    BeyondError
        There is no room for it in a work space.
    """
    writer = _Writer(program)
    tape = writer.tape()
    what = {
        "shown": "columns of regressions",
        "registers": "numbers",
        "bodies": "bodies",
        "corners": "corners of a body",
        "relations": "relations",
        "features": "features of pairs",
        "modes": "modes",
        "variables": "variables of a clause",
        "roles": "roles of a mode",
        "keys": "properties",
        "code": "whole numbers",
        "numbers": "constants",
        "answers": "answers",
    }
    for name, words in what.items():
        size, most = getattr(tape.sizes, name), getattr(MOST, name)
        if size > most:
            raise ir.BeyondError(f"{size} {words}, of which there may be {most}")
    return tape


class _Writer:
    def __init__(self, program: ir.Program) -> None:
        self.program = program
        self.code = array("q", [0] * HEADER)
        slack = 0.0 if program.motion is None else program.motion.slack
        self.numbers = array("d", [program.turn, program.touch, program.part, program.precision, slack])
        self.roles = 1
        self.variables = 1
        self.reads: set[int] = set()
        self.votes: list[tuple[tuple[int, ...], int]] = []
        self.reaches: list[int] = []
        self.fits: list[int] = []
        self.spreads: dict[ir.Leverage, int] = {}
        self.shown = 0

    def put(self, *values: int) -> int:
        """Append whole numbers; where they begin."""
        self.code.extend(values)
        return len(self.code) - len(values)

    def col(self, *columns: int) -> list[int]:
        """Columns, of which note is taken that somebody reads them."""
        self.reads.update(columns)
        return list(columns)

    def num(self, *values: float) -> int:
        """Append numbers; where they begin."""
        self.numbers.extend(values)
        return len(self.numbers) - len(values)

    def tape(self) -> Tape:
        """Write everything."""
        p, head = self.program, self.code
        head[WIDTH], head[REGISTERS], head[BODIES] = p.width, p.registers, len(p.bodies)
        bodies = [v for k in range(len(p.bodies)) for v in self._body(k)]
        head[AT_BODIES] = self.put(*bodies)
        head[RELATIONS], head[FACTS] = len(p.relations), len(p.facts)
        wanted = p.wanted
        kinds = [self._relation(name) if k in wanted else -1 for k, name in enumerate(p.relations)]
        # Behind the bodies: kinds of the relations (-1: nobody asks), then the columns of the others' numbers.
        self.put(*kinds)
        head[ASKED] = sum(1 << kind for kind in set(kinds) if kind >= 0)
        width = len(p.others[0]) if p.others else 0
        head[OTHERS] = width
        self.put(*self.col(*(c for row in p.others for c in row)))
        head[OFFSETS], head[PARTING], head[EVERYTHING] = p.offsets, p.parting, p.everything
        head[DIMENSIONS], head[UP] = p.dimensions, p.up
        head[KEYS] = 1 + max((a.key for a in p.answers), default=0)
        if p.motion is not None:
            self._motion(p.motion)
        self.fits = [self._fit(fit) for fit in p.fits]
        answers = [self._answer(a) for a in p.answers]
        head[ANSWERS], head[AT_ANSWERS] = len(answers), self.put(*answers)
        at = self.num(*(step for _, step, _ in p.kinematics))
        head[KINEMATICS] = len(p.kinematics)
        head[AT_KINEMATICS] = self.put(
            *(v for k, (place, _, rate) in enumerate(p.kinematics) for v in (place, *self.col(rate), at + k))
        )
        head[ANGLES], head[AT_ANGLES] = len(p.angles), self.put(*p.angles)
        self._note_nexts()
        return Tape(
            np.array(self.code, dtype=np.int64),
            np.array(self.numbers),
            self._sizes(),
            tuple(self.votes),
            tuple(self.reaches),
        )

    def _sizes(self) -> Sizes:
        p = self.program
        return Sizes(
            code=len(self.code),
            numbers=len(self.numbers),
            registers=p.registers,
            bodies=len(p.bodies),
            corners=max((len(b.outline) for b in p.bodies), default=0),
            contacts=0 if p.motion is None else min(len(p.motion.pairs), MOST_CONTACTS),
            relations=len(p.relations),
            features=len(p.facts) + self.code[OTHERS],
            modes=max((len(a.modes) for a in p.answers), default=0),
            variables=self.variables,
            roles=self.roles,
            keys=self.code[KEYS],
            answers=len(p.answers),
            shown=self.shown,
            remembered=0,
        )

    def _note_nexts(self) -> None:
        """Which next values a step reads or writes."""
        p, head = self.program, self.code
        written = {a.column for a in p.answers} | {place for place, _, _ in p.kinematics} | set(p.angles)
        nexts = sorted(written | {c - p.width for c in self.reads if p.width <= c < 2 * p.width})
        head[NEXTS], head[AT_NEXTS] = len(nexts), self.put(*nexts)

    def _relation(self, name: str) -> int:
        if name in RELATION_KINDS:
            return RELATION_KINDS[name]
        axis, _, kind = name.partition("-")
        letters = [n.removeprefix("normal-") for n in self.program.facts if n.startswith("normal-")]
        return RELATION_KINDS[kind] + letters.index(axis)

    def _body(self, number: int) -> list[int]:
        b = self.program.bodies[number]
        shape = {"round": 0, "polygon": 1, "box": 2}[b.shape]
        xs, ys = [x for x, _ in b.outline] or [0.0], [y for _, y in b.outline] or [0.0]
        least = self.num(min(xs), min(ys), max(xs), max(ys), *(v for corner in b.outline for v in corner))
        flags = [b.moves, b.spin, b.spins, self.program.groups[number]]
        self.col(*b.position[:2], *b.extent[:2], b.angle, *b.velocity, b.spin)
        if self.program.precision or self.program.dimensions == 3:
            self.col(*b.position, *b.extent)
        if self.program.dimensions == 3 or self.program.casts:
            self.col(*b.pose)
        return [
            shape,
            len(b.outline),
            least,
            *b.position,
            *b.extent,
            b.angle,
            *b.velocity,
            *map(int, flags),
            *b.pose,
        ]

    def _sum(self, s: ir.Sum) -> int:
        at = self.num(*(w for _, w in s.terms))
        return self.put(len(s.terms), at, *self.col(*(c for c, _ in s.terms)))

    def _rule(self, s: ir.Sum) -> int:
        """A sum over what laws read of a contact, not over registers."""
        at = self.num(*(w for _, w in s.terms))
        return self.put(len(s.terms), at, *(c for c, _ in s.terms))

    # ------------------------------------------------------------------ motion
    def _motion(self, m: ir.Motion) -> None:
        head = self.code
        movers = []
        for mover in m.movers:
            free = [self._sum(s) for s in mover.free]
            movers.append(self.put(mover.body, mover.governed, mover.moving, len(free), *free))
        at_movers = self.put(*movers)
        pairs = [v for pair in m.pairs for v in self._pair(pair)]
        at_pairs = self.put(*pairs)
        laws = [self._law(law) for law in m.laws]
        at_laws = self.put(*laws)
        head[MOVERS], head[AT_MOVERS] = len(m.movers), at_movers
        head[PAIRS], head[AT_PAIRS] = len(m.pairs), at_pairs
        head[LAWS], head[AT_LAWS] = len(m.laws), at_laws

    def _pair(self, pair: ir.Pair) -> list[int]:
        """First, second, power (0: constant), two columns, where share and grip are."""
        share = pair.share
        at = self.num(share.constant, pair.grip)
        if share.columns is None:
            return [pair.first, pair.second, 0, 0, 0, at]
        return [pair.first, pair.second, share.power, *self.col(*share.columns), at]

    def _law(self, law: ir.Law) -> int:
        rules = []
        for along in law.rules:
            written = []
            for rule in along:
                pieces = [self._rule(piece) for piece in rule.pieces]
                written.append(self.put(rule.operator == "max", rule.back, rule.forth, len(pieces), *pieces))
            rules.append(self.put(*written))
        chosen = [self.put(*row) for row in law.chosen]
        return self.put(ir.FRAMES.index(law.frame), *rules, *chosen)

    # ------------------------------------------------------------------ conditions
    def _clause(self, clause: ir.Clause) -> int:
        """Levels: each binds one more variable and tests all literals that became decidable with it."""
        bound, waiting, levels = set(range(clause.arity)), list(clause.literals), list[int]()
        fresh = [v for v in range(clause.arity, clause.variables)]
        variable = -2  # none: -1 is `ANY`
        while True:
            ready = [each for each in waiting if _variables(each) <= bound]
            waiting = [each for each in waiting if each not in ready]
            written = [self._literal(each) for each in ready]
            levels.append(self.put(variable, len(written), *written))
            if not fresh:
                break
            variable = max(
                fresh, key=lambda v: (sum(_variables(each) <= bound | {v} for each in waiting), -v)
            )
            fresh.remove(variable)
            bound.add(variable)
        self.variables = max(self.variables, clause.variables + 1)
        return self.put(clause.arity, clause.variables, len(levels), *levels)

    def _literal(self, literal: ir.Literal) -> int:
        if isinstance(literal, ir.Related):
            return self.put(1, literal.relation, literal.first, literal.second, literal.negated, 0)
        if isinstance(literal, ir.PairTest):
            at = self.num(literal.threshold)
            return self.put(2, literal.feature, literal.variable, literal.at_most, literal.negated, at)
        return self.put(3, literal.objects, literal.variable, 0, literal.negated, 0)

    def _tree(self, tree: ir.Tree | None) -> int:
        if tree is None:
            return 0
        sights = [self.put(*self.col(s.column, s.minus), s.variable, s.feature) for s in tree.sights]
        at = self.num(*(t for _, t, _, _ in tree.nodes))
        nodes = [v for s, _, b, a in tree.nodes for v in (sights[s] if s >= 0 else 0, b, a)]
        return self.put(len(tree.nodes), at, *nodes)

    def _stage(self, stage: ir.Stage) -> int:
        clause = 0 if stage.clause is None else self._clause(stage.clause)
        at = self.num(*(t.threshold for t in stage.tests))
        tests = self.put(
            *(
                v
                for k, t in enumerate(stage.tests)
                for v in (*self.col(t.column, t.minus), t.at_most, t.negated, at + k)
            )
        )
        tree = self._tree(stage.tree)
        outcomes = self.put(*stage.outcomes)
        return self.put(clause, len(stage.tests), tests, tree, outcomes)

    def _vote(self, vote: ir.Vote | None) -> int:
        if vote is None:
            return 0
        contests, places = [], []
        for c in vote.contests:
            stages = [self._stage(stage) for stage in c.stages]
            places.append(votes := self.put(*(v for pair in c.votes for v in pair)))
            contests.append(self.put(c.first, c.second, c.context, votes, len(stages), *stages))
        by_tie = self.put(*vote.by_tie)
        self.votes.append((tuple(places), by_tie))
        experience = 0
        if (known := vote.experience) is not None:
            seen = np.array(known.seen, dtype=np.uint64).view(np.int64).tolist()
            at = self.put(*seen)
            used = [
                self.put(context, len(relations), len(unary), *relations, *unary)
                for context, relations, unary in known.used
            ]
            experience = self.put(len(used), len(seen), at, *used)
        return self.put(len(contests), by_tie, experience, *contests)

    # ------------------------------------------------------------------ roles and answers
    def _casting(self, casting: ir.Casting | None) -> int:
        if casting is None:
            return 0
        found = []
        for d in casting.descriptions:
            clauses = [self._clause(clause) for clause, _ in d.clauses]
            at = self.num(*(score for _, score in d.clauses), d.otherwise)
            common = 0
            if d.common is not None:
                towards, back, among = d.common
                common = self.put(among, len(towards), len(back), *towards, *back)
            found.append(self.put(d.objects, at, common, len(clauses), len(d.places), *clauses, *d.places))
        self.roles = max(self.roles, casting.roles)
        return self.put(len(found), casting.roles, int(casting.lenient), *found)

    def _mode(self, mode: ir.Mode) -> int:
        function = 0 if mode.function is None else self._sum(mode.function)
        roles = []
        for role in mode.roles:
            at = self.num(*(w for w, _ in role.terms))
            columns = self.col(*(c for _, row in role.terms for c in row))
            roles.append(self.put(role.place, len(role.terms), at, role.number, *columns))
            self.roles = max(self.roles, role.number + 1)
        casting = self._casting(mode.casting)
        return self.put(mode.id, mode.register, function, casting, len(roles), *roles)

    def _answer(self, a: ir.Answer) -> int:
        features = [self._feature(f) for f in a.features]
        follows = [
            v
            for f in a.follows
            for v in (f.register, *self.col(f.column), f.value, self.num(f.scale), f.scale == 0.0)
        ]
        modes = [self._mode(mode) for mode in a.modes]
        stops = [self._stop(each) for each in a.stops]
        tree, outcomes = a.scope if a.scope is not None else (None, ())
        reach = a.reach or ir.Reach(a.column, -math.inf, math.inf)
        numbers = self.num(reach.least, reach.most, a.low[1], a.high[1])
        lists = [self.put(len(v), *v) for v in (list(a.needs), features, modes, stops)]
        at_follows = self.put(len(a.follows), *follows)
        state = ("modes", "lost", "none").index(a.state)
        return self.put(
            a.column,  # 0
            a.key,
            a.body,
            a.component,
            lists[0],
            lists[1],
            at_follows,
            state,
            int(a.said),
            int(a.abstains),
            lists[2],  # 10
            self._vote(a.vote),
            self._tree(tree),
            self.put(*outcomes),
            int(a.clipped),
            *self.col(reach.present if a.reach is not None else -1),
            0 if a.guess is None else self._sum(a.guess),
            0 if a.beyond is None else self._sum(a.beyond),
            numbers,
            a.low[0],
            a.high[0],  # 20
            lists[3],
            int(any(mode.roles for mode in a.modes)),
            int(a.vote is not None and _relational(a.vote)),
            int(a.vote is not None and _narrow(a.vote)),
            self._trust(a.trust),  # 25
            self._regression(a.regression),
        )

    def _trust(self, trust: ir.Trust | None) -> int:
        """Beliefs in the order of their kinds' numbers: kinds, who speaks and whether that is claimed, and how sure."""
        if trust is None:
            return 0
        some = ordered(trust.beliefs)
        kinds = self.put(*map(_kind, some))
        said = self.put(*(v for each in some for v in (each.speaker, each.claimed)))
        at = self.num(*(v for each in some for v in (each.probability, each.interval)))
        rests = self.put(len(trust.rests), *trust.rests)
        return self.put(len(some), kinds, said, at, trust.lawful, trust.distant, rests)

    def _fit(self, fit: ir.Fit) -> int:
        """How many columns, which, their centres and scales; then of each regression where its leverage is told.

        That is its mean, and the entries of the spread on and above its diagonal, row by row, those above it twice.
        """
        d = len(fit.columns)
        at = self.num(*(v for _, centre, scale in fit.columns for v in (centre, scale)))
        columns = self.put(*self.col(*(c for c, _, _ in fit.columns)))
        reach = []
        for one in fit.leverage:
            width = len(one.mean)
            self.shown = max(self.shown, width)
            if one in self.spreads:  # other objects of the type have the same
                reach.append(self.spreads[one])
                continue
            entries = np.frombuffer(b64decode(one.spread), dtype="<f4").astype(np.float64)
            first, second = np.triu_indices(width)
            doubled = np.where(first == second, entries, 2.0 * entries)
            reach.append(self.num(*one.mean))
            self.numbers.frombytes(doubled.tobytes())
            self.spreads[one] = reach[-1]
        return self.put(d, columns, at, len(reach), *reach)

    def _regression(self, r: ir.Regression | None) -> int:
        """What it looks at, the present value's column, where bounds stand and how far it is trusted, and weights."""
        if r is None:
            self.reaches.append(-1)
            return 0
        weights = [self.num(*row) for row in r.weights]
        reach = self.num(
            r.least, r.most, *(v for each in r.trusted for v in (each.growth, each.least, *each.say))
        )
        self.reaches.append(reach)
        return self.put(self.fits[r.fit], *self.col(r.present), reach, *weights)

    def _feature(self, feature: ir.Feature) -> int:
        kinds = {"": 0, "sin": 1, "cos": 2}
        factors = [v for f in feature.factors for v in (*self.col(f.column), kinds[f.function], f.frequency)]
        return self.put(feature.register, len(feature.factors), *factors)

    def _stop(self, each: ir.Stop | ir.Landing) -> int:
        if isinstance(each, ir.Stop):
            at = self.num(each.value, each.step, each.bound, each.side)
            return self.put(0, each.mode, *self.col(each.column), at)
        return self.put(1, each.mode, *self.col(each.column), self.num(each.value, each.at, each.slack))


def ordered(beliefs: Iterable[ir.Belief]) -> list[ir.Belief]:
    """Beliefs in the order in which they stand on the tape: that of their kinds' numbers."""
    return sorted(beliefs, key=_kind)


def kind_of(number: int) -> tuple[int, int, int]:
    """Outcome, winner and lead of a kind of predictions, from its number as the kernel works it out."""
    rest, outcome = divmod(number // 16, 8)
    return outcome, rest // 16, rest % 16 - 2


def _kind(belief: ir.Belief) -> int:
    return ((belief.winner * 16 + belief.lead + 2) * 8 + belief.outcome) * 16 + belief.able


def _variables(literal: ir.Literal) -> set[int]:
    """Variables of a literal, `ANY` left aside."""
    args = (literal.first, literal.second) if isinstance(literal, ir.Related) else (literal.variable,)
    return {a for a in args if a != ir.ANY}


def _relational(vote: ir.Vote) -> bool:
    """Whether relations alone decide a vote, and no number does."""
    stages = [stage for contest in vote.contests for stage in contest.stages]
    literals = [each for stage in stages if stage.clause is not None for each in stage.clause.literals]
    numeric = any(stage.tests or stage.tree is not None for stage in stages)
    return not numeric and not any(isinstance(each, ir.PairTest) for each in literals)


def _narrow(vote: ir.Vote) -> bool:
    """Whether a vote asks what is near the target, or for features of pairs."""
    stages = [stage for contest in vote.contests for stage in contest.stages]
    literals = [each for stage in stages if stage.clause is not None for each in stage.clause.literals]
    sights = [sight for stage in stages if stage.tree is not None for sight in stage.tree.sights]
    contexts = {contest.context for contest in vote.contests}
    contexts |= {context for context, _, _ in vote.experience.used} if vote.experience is not None else set()
    return (
        contexts != {ir.CONTEXTS.index("all")}
        or any(isinstance(each, ir.PairTest) for each in literals)
        or any(sight.feature >= 0 for sight in sights)
    )
