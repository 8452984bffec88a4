"""Decision lists over given conditions: ordered conjunctions, each of which leaves no doubt, then a default.

References
----------
R. L. Rivest, "Learning decision lists", Machine Learning 2 (1987); P. Clark and T. Niblett, "The CN2 induction
algorithm", Machine Learning 3 (1989).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ALTERNATIVES, ROUNDED, SEARCHED_CELLS

__all__ = ["Rule", "decision_list"]

_Bools = NDArray[np.bool_]
_Floats = NDArray[np.float64]
_Draft = tuple[tuple[int, ...], int]
"""Literals (condition k, or number of conditions + k for its negation) and the label."""


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule of a list.

    Attributes
    ----------
    tests
        (condition, whether it must hold) pairs, all of which must be so; none: always.
    label
        What follows.
    weight
        Of the examples that it decides.
    """

    tests: tuple[tuple[int, bool], ...]
    label: int
    weight: float


def decision_list(
    truth: _Bools,
    allowed: _Bools,
    weights: _Floats,
    cost: Sequence[float] | None = None,
    *,
    doubtful: _Bools | None = None,
    budget: float = 0.0,
) -> tuple[Rule, ...]:
    """A short list that gives every example a label that is allowed for it.

    Parameters
    ----------
    truth
        Which conditions hold, shape ``(n, conditions)``.
    allowed
        Which labels may be given, at least one to each example; shape ``(n, labels)``.
    weights
        Of the examples, shape ``(n,)``.
    cost
        What it costs to mention a condition; default: 1 each.
    doubtful, budget
        Examples that may be given another label, shape ``(n,)``, up to this share of all weight.

    Returns
    -------
    The rules; the last one has no tests. Where no conjunction tells two examples apart for which different labels are
    allowed, the weightier one decides.

    Notes
    -----
    The commonest labels are tried as the default, the shortest lists are improved, each with changes that look at
    `SEARCHED_CELLS` numbers at most, and of those found the cheapest is returned. Cost
    O(labels * rules * `ALTERNATIVES` * distinct rows * conditions).
    """
    prices = np.ones(truth.shape[1]) if cost is None else np.asarray(cost, dtype=np.float64)
    rows, labels, heavy, unsure = _distinct(truth, allowed, weights, doubtful)
    table = _Table(
        np.concatenate([rows, ~rows], axis=1),
        labels,
        heavy,
        np.concatenate([prices, prices]),
        unsure,
        budget * float(heavy.sum()),
    )
    drafts = []
    usual = np.argsort(-(labels * heavy[:, None]).sum(axis=0), kind="stable")[:ALTERNATIVES]
    for default in [k for k in usual.tolist() if labels[:, k].any()]:
        for by_weight in (True, False):
            rules = table.pruned(
                _covered(table, heavy if by_weight else np.ones(len(heavy)), default), default
            )
            drafts.append((table.price(rules), -float(heavy[labels[:, default]].sum()), default, rules))
    drafts.sort(key=lambda each: each[:3])
    found = []
    for _, share, default, rules in drafts[:ALTERNATIVES]:
        better = _improved(table, rules, default)
        found.append((table.price(better), share, default, better))
    _, _, default, rules = min(found, key=lambda each: each[:3])
    return _weighed(table, rules, default)


def _distinct(
    truth: _Bools, allowed: _Bools, weights: _Floats, doubtful: _Bools | None
) -> tuple[_Bools, _Bools, _Floats, _Bools]:
    """Rows that differ in conditions; where they disagree about the label, the weightier one decides."""
    rows, which = np.unique(truth, axis=0, return_inverse=True)
    which = which.reshape(-1)
    votes = np.zeros((len(rows), allowed.shape[1]))
    np.add.at(votes, which, allowed * weights[:, None])
    heavy: _Floats = np.bincount(which, weights, minlength=len(rows)).astype(np.float64)
    labels: _Bools = votes >= heavy[:, None] * (1.0 - ROUNDED)
    none = ~labels.any(axis=1)
    labels[none] = votes[none] >= votes[none].max(axis=1, keepdims=True)
    unsure = np.ones(len(rows), dtype=np.bool_)
    np.logical_and.at(unsure, which, np.zeros(len(which), dtype=np.bool_) if doubtful is None else doubtful)
    return rows, labels, heavy, unsure


@dataclass(eq=False)
class _Table:
    """Rows to be decided.

    Attributes
    ----------
    literals
        Truth of every condition, then of every negation, shape ``(n, 2 * conditions)``.
    labels
        Labels allowed, shape ``(n, labels)``.
    heavy, prices
        Weight of each row, and price of each literal.
    unsure, budget
        Rows that may be decided wrongly, of so much weight in all.
    """

    literals: _Bools
    labels: _Bools
    heavy: _Floats
    prices: _Floats
    unsure: _Bools
    budget: float
    _masks: dict[tuple[int, ...], _Bools] = field(default_factory=dict)

    def where(self, tests: tuple[int, ...]) -> _Bools:
        """Rows of which some tests hold."""
        if tests not in self._masks:
            self._masks[tests] = np.logical_and.reduce(self.literals[:, tests], axis=1)
        return self._masks[tests]

    def price(self, rules: Sequence[_Draft]) -> float:
        """What it costs to write down the rules; one more case of the rule before it is cheap."""
        total, last = 0.0, -1
        for tests, label in rules:
            total += (2.0 if label != last else 0.5) + float(self.prices[list(tests)].sum())
            last = label
        return total

    def right(self, rules: Sequence[_Draft], default: int) -> bool:
        """Whether rules decide every row as they may."""
        left, lost = np.ones(len(self.literals), dtype=np.bool_), 0.0
        for tests, label in (*rules, ((), default)):
            here = left & self.where(tests) if tests else left
            wrong = here & ~self.labels[:, label]
            if wrong.any():
                if (wrong & ~self.unsure).any():
                    return False
                lost += float(self.heavy[wrong].sum())
                if lost > self.budget:
                    return False
            left = left & ~here
        return True

    def pruned(self, rules: list[_Draft], default: int) -> list[_Draft]:
        """The rules without tests, and the list without rules, that nothing depends on."""
        number = len(rules) - 1
        while number >= 0:
            without = [*rules[:number], *rules[number + 1 :]]
            if self.right(without, default):
                rules = without
            else:
                for test in rules[number][0]:
                    tests, label = rules[number]
                    shorter = (tuple(k for k in tests if k != test), label)
                    changed = [*rules[:number], shorter, *rules[number + 1 :]]
                    if shorter[0] and self.right(changed, default):
                        rules = changed
            number -= 1
        return rules


def _covered(table: _Table, size: _Floats, default: int) -> list[_Draft]:
    """Rules for all rows for which the default won't do, in the order in which they are found."""
    left = np.ones(len(table.literals), dtype=np.bool_)
    rules: list[_Draft] = []
    while (left & ~table.labels[:, default]).any():
        rule = _best(table.literals[left], table.labels[left], size[left], table.prices, default)
        rules.append(rule)
        left &= ~table.where(rule[0])
    return rules


def _best(literals: _Bools, labels: _Bools, size: _Floats, prices: _Floats, default: int) -> _Draft:
    """The conjunction that decides most rows for its price and is right of all of them."""
    needed = np.where(labels[:, default], 0.0, size)
    best: tuple[float, _Draft] | None = None
    for label in range(labels.shape[1]):
        found = _conjunction(literals, labels[:, label], needed, prices)
        if found is not None and (best is None or found[0] > best[0] + ROUNDED):
            best = (found[0], (found[1], label))
    assert best is not None, "rows that differ in no condition have a common label"
    return best[1]


def _conjunction(
    literals: _Bools, good: _Bools, needed: _Floats, prices: _Floats
) -> tuple[float, tuple[int, ...]] | None:
    """The best conjunction that holds of good rows alone, by what it gains for its price; None if none gains."""
    if not (good & (needed > 0.0)).any():
        return None
    count = literals.shape[1]
    beam: list[tuple[int, ...]] = [()]
    for _ in range(count // 2):
        masks = np.array([literals[:, tests].all(axis=1) for tests in beam])
        gain = (masks * (good * needed)) @ literals
        wrong = (masks & ~good).astype(np.float64) @ literals
        price = np.array([prices[list(tests)].sum() for tests in beam])[:, None] + prices
        for row, tests in enumerate(beam):  # neither the same test again nor its negation
            gain[row, list(tests)] = 0.0
            gain[row, [(k + count // 2) % count for k in tests]] = 0.0
        pure = (wrong == 0.0) & (gain > 0.0)
        if pure.any():
            value = np.where(pure, gain / (2.0 + price), -np.inf)
            row, k = divmod(int(np.argmax(value)), count)
            return float(value[row, k]), tuple(sorted((*beam[row], k)))
        # What holds of most rows that it gains, and of few others, is promising.
        promise = np.log2(1.0 + gain) - 2.0 * np.log2(1.0 + wrong)
        promise[gain <= 0.0] = -np.inf
        grown: dict[tuple[int, ...], None] = {}
        for place in np.argsort(-promise, axis=None, kind="stable")[: ALTERNATIVES**2].tolist():
            row, k = divmod(place, count)
            if promise[row, k] == -np.inf or len(grown) == ALTERNATIVES:
                break
            grown[tuple(sorted((*beam[row], k)))] = None
        if not grown:
            return None
        beam = list(grown)
    return None


def _improved(table: _Table, rules: list[_Draft], default: int) -> list[_Draft]:
    """The rules in an order, and with tests in others' places, that let more of them be left out."""
    price, cells, better = table.price(rules), 0, True
    while better and cells < SEARCHED_CELLS:
        better = False
        for changed in _variants(rules):
            cells += len(table.heavy) * len(rules)
            if cells >= SEARCHED_CELLS:
                break
            if not table.right(changed, default):
                continue
            shorter = table.pruned(changed, default)
            if (found := table.price(shorter)) < price - ROUNDED:
                rules, price, better = shorter, found, True
                break
    return rules


def _variants(rules: list[_Draft]) -> Iterator[list[_Draft]]:
    """One rule elsewhere, or with the tests of another one of the same label."""
    for i, j in permutations(range(len(rules)), 2):
        rest = [*rules[:i], *rules[i + 1 :]]
        moved = [*rest[:j], rules[i], *rest[j:]]
        yield moved
        if rules[i][1] == rules[j][1]:
            yield [
                (rules[j][0], label) if k == i else (tests, label) for k, (tests, label) in enumerate(rules)
            ]
            yield [(rules[j][0], r[1]) if k == j else r for k, r in enumerate(moved)]


def _weighed(table: _Table, rules: Sequence[_Draft], default: int) -> tuple[Rule, ...]:
    left = np.ones(len(table.literals), dtype=np.bool_)
    conditions = table.literals.shape[1] // 2
    found = []
    for tests, label in rules:
        here = left & table.where(tests)
        pairs = tuple((k % conditions, k < conditions) for k in tests)
        found.append(Rule(pairs, label, float(table.heavy[here].sum())))
        left &= ~here
    return (*found, Rule((), default, float(table.heavy[left].sum())))
