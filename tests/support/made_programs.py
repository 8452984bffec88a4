"""Programs that are made up at random, of things without bodies, and what their records say, word for word."""

from __future__ import annotations

import functools
import itertools
import math
import random
import struct
from base64 import b64decode, b64encode
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.logic.situations import mixed, situation
from relgym.program import records as ir
from relgym.program.machine import make
from relgym.program.tape import Tape, encoded

PREDICTED, NO_MODE, UNEXPLAINED, NO_ROLES, OUTSIDE, DEPENDS, UNSURE = range(7)
UNIT = 2.0**32
"""Votes are counted in integers of one in so many."""


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
        "fits": (),
        "answers": (),
        "kinematics": (),
        "angles": (),
    }
    return ir.Program(**known | fields)


MACHINE = functools.cache(make)


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
    machine = MACHINE()
    assert machine is not None
    tape = tape or encoded(program)
    n, count = len(vectors), len(program.answers)
    settling = any(a.trust is not None for a in program.answers)
    after, sure = np.empty(vectors.shape), np.full((2, n, count), np.nan)
    outcomes, modes = np.empty((n, count), dtype=np.int8), np.empty((n, count), dtype=np.int64)
    told = outcomes, modes, np.empty((n, count)), sure
    assert machine.run(tape.space(), vectors, after, told, settling=settling) == 0
    return Told(after, outcomes.astype(np.int64), *told[1:3], *sure)


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
        value, outcome, mode, margin = _heard(value, outcome, mode, margin, depends=bool(lost & set(a.needs)))
        sure = math.nan, math.nan
        words = _regressed(p, a.regression, x)
        if a.trust is None:
            value = next((each for each in (value, guess) if math.isfinite(each)), words[0])
        else:
            value, outcome, mode, sure = _trusted(
                a, a.trust, x, p.width, (value, outcome, mode, margin, guess), words
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


def _heard(
    value: float, outcome: int, mode: int, margin: float, *, depends: bool
) -> tuple[float, int, int, float]:
    """What modes say, once it is known whether all that they depend on is, and whether it is a number."""
    if depends:
        outcome, margin = DEPENDS, 0.0
    if not math.isfinite(value) and outcome == PREDICTED:
        outcome = OUTSIDE
    told = math.isfinite(value) and outcome in (PREDICTED, UNEXPLAINED)
    return value, outcome, mode if told else 0, margin


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
        value, mode = _walled(a, x[chosen.register], chosen.id, x)
        return value, PREDICTED if a.said else UNEXPLAINED, mode, margin if place == 0 else 0.0
    return math.nan, NO_ROLES, 0, 0.0


def _walled(a: ir.Answer, value: float, mode: int, x: Sequence[float]) -> tuple[float, int]:
    """What reach, limits and stops make of a mode's value, and who gives it then."""
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
    return value, mode


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
    a: ir.Answer,
    trust: ir.Trust,
    x: Sequence[float],
    width: int,
    said: tuple[float, int, int, float, float],
    regressed: tuple[float, float],
) -> tuple[float, int, int, tuple[float, float]]:
    value, outcome, mode, margin, guess = said
    regression, far = regressed
    values = dict(zip(ir.EXPERTS, (value, guess, regression, math.nan, x[width + a.column]), strict=True))
    able = sum(1 << k for k, e in enumerate(ir.EXPERTS[:4]) if math.isfinite(values[e]))
    kind = PREDICTED if mode else outcome
    # Bins of leads: below 1/2, 1, 2, 4, 8, and more; 0: none, 7: nobody else was in it.
    lead = (
        0 if not margin > 0 else 7 if math.isinf(margin) else 1 + sum(margin >= 2.0**k for k in range(-1, 4))
    )
    if trust.distant and mode and far >= 2.0:  # below 4, 8, 16, 32, 64, and more
        lead = 8 + sum(far >= 2.0**k for k in range(2, 7))
    known = {(b.outcome, b.winner, b.lead, b.able): b for b in trust.beliefs}
    family = (mode > 0) - (mode < 0)
    keys = [(kind, mode, lead, able), (kind, mode, -1, able), (kind, family, -2, able)]
    b = next(known[key] for key in keys if key in known)
    if outcome == PREDICTED and not b.claimed:
        outcome = UNSURE
    elif outcome == UNEXPLAINED and b.claimed and mode:
        outcome = PREDICTED
    return values[ir.EXPERTS[b.speaker]], outcome, mode, (b.probability, b.interval)


def _regressed(p: ir.Program, r: ir.Regression | None, x: Sequence[float]) -> tuple[float, float]:
    """What regressions say, each as far as its leverage allows; how far the first one is asked."""
    if r is None:
        return math.nan, 0.0
    fit, distances, whole = p.fits[r.fit], list[float](), 0.0
    shown = [(x[c] - centre) / scale for c, centre, scale in fit.columns]
    both = shown, shown + [a * b for a, b in itertools.combinations_with_replacement(shown, 2)]
    for z, row, reach, known in zip(both, r.weights, fit.leverage, r.trusted, strict=False):
        word = row[0]
        for weight, each in zip(row[1:], z, strict=True):
            word += weight * each
        word = min(max(word, r.least), r.most)
        entries = iter(struct.unpack(f"<{len(z) * (len(z) + 1) // 2}f", b64decode(reach.spread)))
        off, far = [a - b for a, b in zip(z, reach.mean, strict=True)], 0.0
        for i in range(len(z)):
            along = 0.0
            for j in range(i, len(z)):
                along += next(entries) * (1.0 if i == j else 2.0) * off[j]
            far += off[i] * along
        h = (far if far >= 0.0 else math.inf) + known.least
        distances.append(h / min(1.0, len(z) * known.least))
        share = known.say[0]
        for k, weight in enumerate(known.say[1:]):  # 1/64, 1/16, 1/4, 1, 4, 16, 64
            share += weight / (1.0 + 4.0 ** (k - 3) * (h * known.growth))
        whole += share * (word - whole)
    return x[r.present] + whole, distances[0]


# ---------------------------------------------------------------------- making them up
def made(seed: int) -> tuple[ir.Program, NDArray[np.float64]]:
    """A program of one thing without a body, with anything that such ones may hold, and four state vectors for it."""
    maker = _Maker(random.Random(seed))
    return maker.program(), np.array([[maker.small() for _ in range(maker.width)] for _ in range(4)])


class _Maker:
    """Draws programs; numbers are few, and come out equal often."""

    def __init__(self, rng: random.Random) -> None:
        self.rng, self.width = rng, rng.randint(1, 4)
        self.registers = 2 * self.width + 3
        self.fits = tuple(self.fit() for _ in range(rng.randint(0, 2)))

    def program(self) -> ir.Program:
        rng, width = self.rng, self.width
        told = rng.sample(range(width), rng.randint(0, min(3, width)))
        answers = tuple(self.answer(key, column, trusting=self.coin()) for key, column in enumerate(told))
        places = [k for k in range(width) if k not in told and self.coin()]
        kinematics = tuple((k, self.small(), rng.randrange(2 * width)) for k in places)
        angles = tuple(k for k in range(width) if rng.random() < 0.2)
        return empty(
            width, self.registers, answers=answers, kinematics=kinematics, angles=angles, fits=self.fits
        )

    def coin(self) -> bool:
        return self.rng.random() < 0.5

    def small(self) -> float:
        return self.rng.randint(-8, 8) / 4.0

    def register(self) -> int:
        self.registers += 1
        return self.registers - 1

    def sum(self, able: Sequence[int]) -> ir.Sum:
        terms = [(self.rng.choice([ir.CONSTANT, *able]), self.small()) for _ in range(self.rng.randint(0, 3))]
        return ir.Sum(tuple(terms))

    def tree(self, able: Sequence[int], outcomes: Sequence[int]) -> tuple[ir.Tree, tuple[int, ...]]:
        """A tree of two tests at most, and an outcome for each node."""
        sights = tuple(ir.Sight(self.rng.choice(able), self.rng.choice([-1, *able])) for _ in range(2))
        shapes: list[list[tuple[int, int, int]]] = [
            [(-1, 0, 0)],
            [(0, 1, 2), (-1, 1, 1), (-1, 2, 2)],
            [(0, 1, 4), (1, 2, 3), (-1, 2, 2), (-1, 3, 3), (-1, 4, 4)],
            [(1, 1, 2), (-1, 1, 1), (0, 3, 4), (-1, 3, 3), (-1, 4, 4)],
        ]
        nodes = tuple(
            (sight, self.small() if sight >= 0 else 0.0, below, above)
            for sight, below, above in self.rng.choice(shapes)
        )
        return ir.Tree(sights, nodes), tuple(self.rng.choice(outcomes) for _ in nodes)

    def test(self, able: Sequence[int]) -> ir.Test:
        minus = self.rng.choice([-1, *able])
        return ir.Test(self.rng.choice(able), minus, self.coin(), self.small(), self.coin())

    def contest(self, first: int, second: int, able: Sequence[int]) -> ir.Contest:
        rng, always = self.rng, ir.Clause(1, 1, ())
        votes = tuple((rng.randint(-9, 0) << 31, rng.randint(-9, 0) << 30) for _ in range(3))
        stages = []
        for _ in range(rng.randint(0, 2)):
            tests = tuple(self.test(able) for _ in range(rng.randint(1, 2)))
            tree, outcomes = (None, (rng.randrange(3),)) if self.coin() else self.tree(able, range(-1, 3))
            stages.append(ir.Stage(always, tests, tree, outcomes))
        tree, outcomes = self.tree(able, range(3))
        stages.append(ir.Stage(None, (), tree, outcomes))
        return ir.Contest(first, second, rng.randrange(3), tuple(stages), votes)

    def factor(self, able: Sequence[int]) -> ir.Factor:
        return ir.Factor(self.rng.choice(able), self.rng.choice(("", "sin", "cos")), self.rng.randint(1, 3))

    def answer(self, key: int, column: int, *, trusting: bool) -> ir.Answer:
        rng, able = self.rng, list(range(2 * self.width))
        features = tuple(
            ir.Feature(
                self.register(), tuple(self.factor(able) for _ in range(rng.randint(1, 2))), "a product"
            )
            for _ in range(rng.randint(0, 2))
        )
        able += [f.register for f in features]
        a = ir.Answer("o", f"p{column}", column, key, tuple(k for k in range(key) if self.coin()), -1)
        state = rng.choice(("modes", "modes", "modes", "lost", "none"))
        a = replace(a, features=features, state=state, said=self.coin(), abstains=self.coin())
        a = replace(
            a,
            scope=self.tree(able, range(2)) if self.coin() else None,
            guess=self.sum(able) if self.coin() else None,
        )
        if a.scope is not None and self.coin():
            a = replace(a, beyond=self.sum(able))
        if self.coin():
            least = rng.randint(-4, 0) / 2
            present = rng.choice((column, 2 * self.width + 1))
            reach = ir.Reach(present, least, least + rng.randint(0, 4) / 2)
            a = replace(a, reach=reach, clipped=self.coin())
        if state == "modes":
            a = self.modes(a, able)
        if self.fits and self.coin():
            a = replace(a, regression=self.regression(column))
        return replace(a, trust=self.trust(a)) if trusting else a

    def fit(self) -> ir.Fit:
        """What one or two regressions look at."""
        rng, count = self.rng, self.rng.randint(1, self.width)
        columns = tuple(
            (c, self.small(), rng.randint(1, 4) / 2.0) for c in rng.sample(range(self.width), count)
        )
        widths = (count, count + count * (count + 1) // 2)[: rng.randint(1, 2)]
        return ir.Fit(columns, tuple(self.leverage(width) for width in widths))

    def leverage(self, width: int) -> ir.Leverage:
        entries = [self.small() for _ in range(width * (width + 1) // 2)]
        spread = b64encode(struct.pack(f"<{len(entries)}f", *entries)).decode()
        return ir.Leverage(tuple(self.small() for _ in range(width)), spread)

    def regression(self, column: int) -> ir.Regression:
        number, rng = self.rng.randrange(len(self.fits)), self.rng
        widths = [len(each.mean) for each in self.fits[number].leverage]
        weights = tuple(tuple(self.small() for _ in range(width + 1)) for width in widths)
        trusted = tuple(
            ir.Trusted(
                rng.choice((1.0, 0.5, 3.0)),
                1.0 / rng.randint(1, 9),
                tuple(rng.choice((0.0, 0.125)) for _ in ir.RATES),
            )
            for _ in widths
        )
        least = rng.randint(-9, 0) / 2
        return ir.Regression(number, column, weights, least, least + rng.randint(0, 12) / 2, trusted)

    def modes(self, a: ir.Answer, able: list[int]) -> ir.Answer:
        rng, count = self.rng, self.rng.randint(1, 4)
        modes = tuple(
            ir.Mode(k + 1, self.register(), self.sum(able) if rng.random() < 0.8 else None)
            for k in range(count)
        )
        able = able + [m.register for m in modes]
        follows = tuple(
            ir.Follow(self.register(), rng.choice(able), m.register, self.small())
            for m in modes
            if self.coin()
        )
        able += [f.register for f in follows]
        vote = None
        if count > 1:
            pairs = itertools.combinations(range(count), 2)
            contests = tuple(self.contest(*pair, able) for pair in pairs)
            by_tie = tuple(rng.sample(range(count), count))
            vote = ir.Vote(contests, by_tie, rng.choice((None, None, FAMILIAR, STRANGE)))
        low = rng.choice(((0, -math.inf), (7, -0.5)))
        high = rng.choice(((0, math.inf), (8, 0.75)))
        stops = tuple(self.wall() for _ in range(rng.randint(0, 2)))
        return replace(a, modes=modes, follows=follows, vote=vote, low=low, high=high, stops=stops)

    def wall(self) -> ir.Stop | ir.Landing:
        place, value = self.rng.randrange(2 * self.width), self.small()
        if self.coin():
            return ir.Landing(6, value, place, self.small(), self.rng.choice((0.0, 0.25)))
        return ir.Stop(5, value, place, self.small(), self.small(), self.rng.choice((-1.0, 1.0)))

    def trust(self, a: ir.Answer) -> ir.Trust:
        """Something about every kind of predictions, and more about some of them."""
        rng = self.rng
        able = [
            bits
            for bits in range(8)
            if (a.guess or a.beyond or not bits & 2) and (a.regression or not bits & 4)
        ]
        kinds = [(outcome, who, -2) for outcome in range(6) for who in (-1, 0, 1)]
        winners = [*(mode.id for mode in a.modes), 5, 7]
        some = itertools.product((PREDICTED, UNEXPLAINED), winners, range(-1, 14))
        kinds += [kind for kind in some if self.coin()]
        beliefs = []
        for outcome, winner, lead in kinds:
            for bits in able:
                speaker = rng.choice([*(k for k in range(3) if bits >> k & 1), 4])
                sure, width = rng.choice((math.nan, 0.5, 0.99)), rng.randint(1, 99) / 8.0
                beliefs.append(ir.Belief(outcome, winner, lead, bits, speaker, sure, width, self.coin()))
        return ir.Trust(tuple(beliefs), False, a.regression is not None and self.coin())
