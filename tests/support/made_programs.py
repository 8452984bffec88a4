"""Programs that hypothesis makes up, of things without bodies, and what their records say, word for word."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from relgym.logic.situations import mixed, situation
from relgym.program import kernel
from relgym.program import records as ir
from relgym.program.tape import Tape, encoded

PREDICTED, NO_MODE, UNEXPLAINED, NO_ROLES, OUTSIDE, DEPENDS, UNSURE = range(7)
UNIT = 2.0**32
"""Votes are counted in integers of one in so many."""

SMALL = st.integers(-8, 8).map(lambda k: k / 4.0)
"""Numbers that come out equal often, and whose sums are exact."""


_NOTHING = (
    np.zeros((1, 0, 1, 1), bool),
    np.zeros((1, 0, 1), bool),
    np.zeros(1, np.int64),
    np.ones((1, 1), bool),
)
_ALONE = int(mixed(situation(*_NOTHING))[0])
"""The situation of what stands alone, of which no relation is asked."""
FAMILIAR, STRANGE = (ir.Experience(((1, (), ()),), seen) for seen in ((3, _ALONE), (_ALONE - 1,)))
"""Such a situation was seen, or it wasn't."""


def empty(width: int, registers: int, **fields: Any) -> ir.Program:
    """A program that says nothing, of one object `o` with so many numbers and no body."""
    known: dict[str, Any] = {
        "width": width,
        "registers": registers,
        "columns": tuple(f"o.p{k}" for k in range(width)),
        "bodies": (),
        "groups": (),
        "dimensions": 2,
        "up": 1,
        "turn": 1.0,
        "touch": 1e-3,
        "part": 1e-9,
        "precision": 0.0,
        "relations": (),
        "wanted": frozenset(),
        "facts": (),
        "others": (),
        "offsets": False,
        "parting": False,
        "everything": False,
        "motion": None,
        "answers": (),
        "kinematics": (),
        "angles": (),
    }
    return ir.Program(**known | fields)


class Told(NamedTuple):
    """What a program says of n scenes: next vectors ``(n, width)``, all else ``(n, answers)``."""

    after: NDArray[np.float64]
    outcomes: NDArray[np.int64]
    modes: NDArray[np.int64]
    margins: NDArray[np.float64]
    probabilities: NDArray[np.float64]
    intervals: NDArray[np.float64]


def by_kernel(program: ir.Program, vectors: NDArray[np.float64], *, tape: Tape | None = None) -> Told:
    """What the kernel says; it knows how right predictions were if the program does."""
    tape = tape or encoded(program)
    space, (n, count) = tape.space(), (len(vectors), len(program.answers))
    settling = any(a.trust is not None for a in program.answers)
    after, sure = np.empty(vectors.shape), np.full((2, n, count), np.nan)
    outcomes, modes = np.empty((n, count), dtype=np.int8), np.empty((n, count), dtype=np.int64)
    margins = np.empty((n, count))
    nobody = np.empty((0, count, tape.roles), dtype=np.int64), np.empty((0, count), dtype=np.int64)
    vectors = np.ascontiguousarray(vectors, dtype=np.float64)
    assert kernel.run(space, vectors, settling, after, outcomes, modes, margins, sure, *nobody) == 0
    return Told(after, outcomes.astype(np.int64), modes, margins, sure[0], sure[1])


def by_source(text: str, vectors: NDArray[np.float64]) -> Told:
    """What exported Python says."""
    module: dict[str, Any] = {"__name__": "exported"}
    exec(compile(text, "exported.py", "exec"), module)
    return Told(*module["predict"](vectors))


def by_records(program: ir.Program, vectors: NDArray[np.float64]) -> Told:
    """What the records say, one after the other as their docstrings have it."""
    rows = [_step(program, vector) for vector in vectors]
    n, count = len(vectors), len(program.answers)
    told = np.array([row for _, row in rows], dtype=np.float64).reshape(n, count, 5)
    after = np.array([a for a, _ in rows]).reshape(n, program.width)
    return Told(after, *(told[..., k].astype(np.int64) for k in (0, 1)), *(told[..., k] for k in (2, 3, 4)))


# ---------------------------------------------------------------------- what the records say
def _step(p: ir.Program, now: Sequence[float]) -> tuple[list[float], list[tuple[float, ...]]]:
    x = [*now, *now, math.nan, 0.0, 1.0] + [math.nan] * (p.registers - 2 * p.width - 3)
    lost, told = set(), []
    for a in p.answers:
        for feature in a.features:
            x[feature.register] = math.prod((_factor(f, x) for f in feature.factors), start=1.0)
        guess = _guess(a, x)
        value, outcome, mode, margin = _modes(a, x)
        if lost & set(a.needs):
            outcome, margin = DEPENDS, 0.0
        if not math.isfinite(value) and outcome == PREDICTED:
            outcome = OUTSIDE
        if not math.isfinite(value) or outcome not in (PREDICTED, UNEXPLAINED):
            mode = 0
        sure = math.nan, math.nan
        if a.trust is None:
            value = value if math.isfinite(value) else guess
        else:
            value, outcome, mode, sure = _trusted(
                a, a.trust, x, p.width, (value, outcome, mode, margin, guess)
            )
        if math.isfinite(value):
            x[p.width + a.column] = value
        if outcome != PREDICTED:
            lost.add(a.key)
        told.append((outcome, mode, margin, *sure))
    for place, size, rate in p.kinematics:
        x[p.width + place] = x[place] + size * x[rate]
    for column in p.angles:
        x[p.width + column] -= 2 * math.pi * round(x[p.width + column] / (2 * math.pi))
    return x[p.width : 2 * p.width], told


def _sum(s: ir.Sum, x: Sequence[float]) -> float:
    found = 0.0
    for column, weight in s.terms:
        found += weight * (1.0 if column == ir.CONSTANT else x[column])
    return found


def _factor(f: ir.Factor, x: Sequence[float]) -> float:
    if not f.function:
        return x[f.column]
    return getattr(math, f.function)(f.frequency * x[f.column])


def _kept(a: ir.Answer, value: float, x: Sequence[float]) -> float:
    if a.reach is None or math.isnan(value):
        return value
    present = x[a.reach.present]
    return min(max(value, present + a.reach.least), present + a.reach.most)


def _leaf(tree: ir.Tree, x: Sequence[float]) -> int:
    node = 0
    while (record := tree.nodes[node])[0] >= 0:
        s = tree.sights[record[0]]
        value = x[s.column] - (x[s.minus] if s.minus >= 0 else 0.0)
        node = record[2] if value <= record[1] else record[3]
    return node


def _in_scope(a: ir.Answer, x: Sequence[float]) -> bool:
    return a.scope is None or a.scope[1][_leaf(a.scope[0], x)] == 1


def _guess(a: ir.Answer, x: Sequence[float]) -> float:
    best = a.guess if a.beyond is None or _in_scope(a, x) else a.beyond
    return math.nan if best is None else _kept(a, _sum(best, x), x)


def _modes(a: ir.Answer, x: list[float]) -> tuple[float, int, int, float]:
    if a.state != "modes":
        return math.nan, UNEXPLAINED if a.state == "lost" else NO_MODE, 0, 0.0
    if not _in_scope(a, x):
        return math.nan, UNEXPLAINED, 0, 0.0
    for mode in a.modes:
        x[mode.register] = math.nan if mode.function is None else _sum(mode.function, x)
    for f in a.follows:
        x[f.register] = x[f.column] + f.scale * x[f.value] if f.scale else x[f.column] * x[f.value]
    order, margin = ([0], math.inf) if a.vote is None else _ranked(a.vote, x)
    if a.vote is not None and a.vote.experience not in (None, FAMILIAR):
        winner = a.modes[order[0]]
        return (_kept(a, x[winner.register], x) if a.clipped else x[winner.register]), OUTSIDE, 0, 0.0
    for place, number in enumerate(order):
        chosen = a.modes[number]
        if chosen.function is None:
            continue
        value, mode = x[chosen.register], chosen.id
        value = _kept(a, value, x) if a.clipped else value
        if value < a.low[1]:
            mode, value = a.low
        elif value > a.high[1]:
            mode, value = a.high
        for each in a.stops:
            now = x[each.column]
            if isinstance(each, ir.Stop):
                held = each.side * (now + each.step * value - each.bound) >= 0.0
            else:
                held = abs(now - each.at) <= each.slack and math.isfinite(value)
            if held:
                value, mode = each.value, each.mode
        return value, PREDICTED if a.said else UNEXPLAINED, mode, margin if place == 0 else 0.0
    return math.nan, NO_ROLES, 0, 0.0


def _ranked(vote: ir.Vote, x: Sequence[float]) -> tuple[list[int], float]:
    """Who has fewest votes of those still in drops out; of equals the one that loses ties."""
    lead = {pair: 0 for pair in itertools.permutations(vote.by_tie, 2)}
    for c in vote.contests:
        first, second = c.votes[_outcome(c, x)]
        lead[c.first, c.second], lead[c.second, c.first] = first - second, second - first
    left, out = list(vote.by_tie), list[int]()
    while len(left) > 1:
        totals = {m: sum(lead[m, k] for k in left if k != m) for m in left}
        worst = min(left, key=lambda m: (totals[m], -left.index(m)))
        left.remove(worst)
        out.insert(0, worst)
    return [left[0], *out], lead[left[0], out[0]] / UNIT


def _outcome(c: ir.Contest, x: Sequence[float]) -> int:
    for stage in c.stages:
        if all(_passes(t, x) for t in stage.tests):
            outcome = stage.outcomes[0 if stage.tree is None else _leaf(stage.tree, x)]
            if outcome >= 0:
                return outcome
    raise AssertionError("the last stage decides")


def _passes(t: ir.Test, x: Sequence[float]) -> bool:
    value = x[t.column] - (x[t.minus] if t.minus >= 0 else 0.0)
    return (value <= t.threshold if t.at_most else value > t.threshold) != t.negated


def _trusted(
    a: ir.Answer, trust: ir.Trust, x: Sequence[float], width: int, said: tuple[float, int, int, float, float]
) -> tuple[float, int, int, tuple[float, float]]:
    value, outcome, mode, margin, guess = said
    latest = math.nan if trust.latest is None else _sum(trust.latest[1], x)
    values = {"own": value, "guess": guess, "latest": latest, "persistence": x[width + a.column]}
    able = sum(1 << ir.EXPERTS.index(e) for e in ("own", "guess", "latest") if math.isfinite(values[e]))
    kind = PREDICTED if mode else outcome
    # Bins of leads: up to 1/2, 1, 2, 4, 8 and more; 0: none, 7: nobody else was in it.
    lead = (
        0 if not margin > 0 else 7 if math.isinf(margin) else 1 + sum(margin >= 2.0**k for k in range(-2, 3))
    )
    known = {(b.outcome, b.winner, b.lead, b.able): b for b in trust.beliefs}
    family = (mode > 0) - (mode < 0)
    keys = [(kind, mode, lead, able), (kind, mode, -1, able), (kind, family, -2, able)]
    b = next(known[key] for key in keys if key in known)
    if outcome == PREDICTED and not b.claimed:
        outcome = UNSURE
    elif outcome == UNEXPLAINED and b.claimed and mode:
        outcome = PREDICTED
    if ir.EXPERTS[b.speaker] == "latest" and mode and trust.latest is not None:
        mode = trust.latest[0]
    return values[ir.EXPERTS[b.speaker]], outcome, mode, (b.probability, b.interval)


# ---------------------------------------------------------------------- making them up
@st.composite
def programs(draw: st.DrawFn, *, trusting: bool | None = None) -> ir.Program:
    """Programs of one thing without a body, with everything that such ones may hold."""
    width = draw(st.integers(1, 4))
    maker = _Maker(draw, width)
    told = draw(st.lists(st.integers(0, width - 1), max_size=3, unique=True))
    answers = []
    for key, column in enumerate(told):
        answers.append(maker.answer(key, column, draw(st.booleans()) if trusting is None else trusting))
    places = draw(st.lists(st.integers(0, width - 1), max_size=2, unique=True))
    kinematics = tuple((k, draw(SMALL), draw(st.integers(0, 2 * width - 1))) for k in places if k not in told)
    angles = tuple(draw(st.lists(st.integers(0, width - 1), max_size=2, unique=True)))
    return empty(width, maker.registers, answers=tuple(answers), kinematics=kinematics, angles=angles)


class _Maker:
    def __init__(self, draw: st.DrawFn, width: int) -> None:
        self.draw, self.width, self.registers = draw, width, 2 * width + 3

    def register(self) -> int:
        self.registers += 1
        return self.registers - 1

    def sum(self, able: Sequence[int]) -> ir.Sum:
        terms = st.tuples(st.sampled_from([ir.CONSTANT, *able]), SMALL)
        return ir.Sum(tuple(self.draw(st.lists(terms, max_size=3))))

    def tree(self, able: Sequence[int], outcomes: st.SearchStrategy[int]) -> tuple[ir.Tree, tuple[int, ...]]:
        """A tree of two tests at most, and an outcome for each node."""
        minus = st.sampled_from([-1, *able])
        sights = [ir.Sight(self.draw(st.sampled_from(able)), self.draw(minus)) for _ in range(2)]
        shapes: list[list[tuple[int, int, int]]] = [
            [(-1, 0, 0)],
            [(0, 1, 2), (-1, 1, 1), (-1, 2, 2)],
            [(0, 1, 4), (1, 2, 3), (-1, 2, 2), (-1, 3, 3), (-1, 4, 4)],
            [(1, 1, 2), (-1, 1, 1), (0, 3, 4), (-1, 3, 3), (-1, 4, 4)],
        ]
        nodes = [
            (sight, self.draw(SMALL) if sight >= 0 else 0.0, below, above)
            for sight, below, above in self.draw(st.sampled_from(shapes))
        ]
        return ir.Tree(tuple(sights), tuple(nodes)), tuple(self.draw(outcomes) for _ in nodes)

    def contest(self, first: int, second: int, able: Sequence[int]) -> ir.Contest:
        votes = tuple(
            (self.draw(st.integers(-3, 0)) << 30, self.draw(st.integers(-3, 0)) << 30) for _ in range(3)
        )
        test = st.builds(
            ir.Test,
            st.sampled_from(able),
            st.sampled_from([-1, *able]),
            st.booleans(),
            SMALL,
            st.booleans(),
        )
        stages = []
        for _ in range(self.draw(st.integers(0, 2))):
            tests = tuple(self.draw(st.lists(test, min_size=1, max_size=2)))
            if self.draw(st.booleans()):
                stages.append(ir.Stage(ir.Clause(1, 1, ()), tests, None, (self.draw(st.integers(0, 2)),)))
            else:
                tree, outcomes = self.tree(able, st.integers(-1, 2))
                stages.append(ir.Stage(ir.Clause(1, 1, ()), tests, tree, outcomes))
        tree, outcomes = self.tree(able, st.integers(0, 2))
        stages.append(ir.Stage(None, (), tree, outcomes))
        return ir.Contest(first, second, self.draw(st.integers(0, 2)), tuple(stages), votes)

    def answer(self, key: int, column: int, trusting: bool) -> ir.Answer:
        draw, able = self.draw, list(range(2 * self.width))
        factor = st.builds(
            ir.Factor, st.sampled_from(able), st.sampled_from(("", "sin", "cos")), st.integers(1, 3)
        )
        features = tuple(
            ir.Feature(self.register(), tuple(draw(st.lists(factor, min_size=1, max_size=2))), "a product")
            for _ in range(draw(st.integers(0, 2)))
        )
        able += [f.register for f in features]
        a = ir.Answer("o", f"p{column}", column, key, tuple(range(draw(st.integers(0, key)))), -1)
        state = draw(st.sampled_from(("modes", "modes", "modes", "lost", "none")))
        a = replace(a, features=features, state=state, said=draw(st.booleans()), abstains=draw(st.booleans()))
        if draw(st.booleans()):
            a = replace(a, scope=self.tree(able, st.integers(0, 1)))
        if draw(st.booleans()):
            a = replace(a, guess=self.sum(able))
        if a.scope is not None and draw(st.booleans()):
            a = replace(a, beyond=self.sum(able))
        if draw(st.booleans()):
            least = draw(st.integers(-4, 0)) / 2
            present = draw(st.sampled_from((column, 2 * self.width + 1)))
            a = replace(a, reach=ir.Reach(present, least, least + draw(st.integers(0, 4)) / 2))
            a = replace(a, clipped=draw(st.booleans()))
        if state == "modes":
            a = self.modes(a, able)
        elif draw(st.booleans()):  # it isn't asked, but may be the one that held last
            a = replace(a, modes=(ir.Mode(9, self.register(), self.sum(able)),))
        bound = [(mode.id, mode.function) for mode in a.modes if mode.function is not None]
        latest = draw(st.sampled_from([None, *bound])) if trusting else None
        return replace(a, trust=self.trust(a, latest)) if trusting else a

    def modes(self, a: ir.Answer, able: list[int]) -> ir.Answer:
        draw, count = self.draw, self.draw(st.integers(1, 4))
        modes = tuple(
            ir.Mode(k + 1, self.register(), self.sum(able) if draw(st.integers(0, 4)) else None)
            for k in range(count)
        )
        able = able + [m.register for m in modes]
        follows = tuple(
            ir.Follow(self.register(), draw(st.sampled_from(able)), m.register, draw(SMALL))
            for m in modes
            if draw(st.booleans())
        )
        able += [f.register for f in follows]
        vote = None
        if count > 1:
            pairs = itertools.combinations(range(count), 2)
            contests = tuple(self.contest(*pair, able) for pair in pairs)
            by_tie = tuple(draw(st.permutations(range(count))))
            known = draw(st.sampled_from((None, None, FAMILIAR, STRANGE)))
            vote = ir.Vote(contests, by_tie, known)
        low = draw(st.sampled_from(((0, -math.inf), (7, -0.5))))
        high = draw(st.sampled_from(((0, math.inf), (8, 0.75))))
        place = st.sampled_from(range(2 * self.width))
        stop = st.builds(ir.Stop, st.just(5), SMALL, place, SMALL, SMALL, st.sampled_from((-1.0, 1.0)))
        landing = st.builds(ir.Landing, st.just(6), SMALL, place, SMALL, st.sampled_from((0.0, 0.25)))
        stops = tuple(draw(st.lists(stop | landing, max_size=2)))
        return replace(a, modes=modes, follows=follows, vote=vote, low=low, high=high, stops=stops)

    def trust(self, a: ir.Answer, latest: tuple[int, ir.Sum] | None) -> ir.Trust:
        """Something about every kind of predictions, and more about some of them."""
        draw = self.draw
        able = [
            bits
            for bits in (0, 1, 2, 3, 16, 17, 18, 19)
            if (a.guess or a.beyond or not bits & 2) and (latest or not bits & 16)
        ]
        kinds = [(outcome, who, -2) for outcome in range(6) for who in (-1, 0, 1)]
        some = st.tuples(st.integers(0, 5), st.integers(1, 8), st.integers(-1, 7))
        kinds += draw(st.lists(some, max_size=6, unique=True))
        beliefs = []
        for outcome, winner, lead in kinds:
            for bits in able:
                speakers = [k for k in (0, 1, 4) if bits >> k & 1]
                speaker = draw(st.sampled_from([*speakers, 5]))
                sure = draw(st.sampled_from((math.nan, 0.5, 0.99)))
                beliefs.append(
                    ir.Belief(outcome, winner, lead, bits, speaker, sure, 0.125, draw(st.booleans()))
                )
        return ir.Trust(tuple(beliefs), False, latest, None)
