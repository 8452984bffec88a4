"""Decision lists over given conditions: ordered conjunctions, each of which leaves no doubt, then a default.

References
----------
R. L. Rivest, "Learning decision lists", Machine Learning 2 (1987); P. Clark and T. Niblett, "The CN2 induction
algorithm", Machine Learning 3 (1989).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Rule", "decision_list"]

BEAM: Final = 12
"""So many conjunctions are grown at once."""

_Bools = NDArray[np.bool_]
_Floats = NDArray[np.float64]


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
    truth: _Bools, allowed: _Bools, weights: _Floats, cost: Sequence[float] | None = None
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

    Returns
    -------
    The rules; the last one has no tests. Where no conjunction tells two examples apart for which different labels are
    allowed, the weightier one decides.

    Notes
    -----
    Every label is tried as the default; of the lists found the cheapest is returned. Cost
    O(labels * rules * `BEAM` * distinct rows * conditions).
    """
    prices = np.ones(truth.shape[1]) if cost is None else np.asarray(cost, dtype=np.float64)
    rows, labels, heavy = _distinct(truth, allowed, weights)
    literals = np.concatenate([rows, ~rows], axis=1)
    both = np.concatenate([prices, prices])
    found = []
    for default in np.flatnonzero(labels.any(axis=0)).tolist():
        for by_weight in (True, False):
            size = heavy if by_weight else np.ones(len(heavy))
            rules = _covered(literals, labels, size, both, default)
            rules = _improved(literals, labels, _pruned(literals, labels, rules, default), both, default)
            price = _price(rules, both)
            share = float(heavy[labels[:, default]].sum())
            found.append(((price, -share, default), rules, default))
    _, rules, default = min(found, key=lambda each: each[0])
    return _weighed(literals, heavy, rules, default, truth.shape[1])


_Draft = tuple[tuple[int, ...], int]
"""Literals (condition k, or number of conditions + k for its negation) and the label."""


def _distinct(truth: _Bools, allowed: _Bools, weights: _Floats) -> tuple[_Bools, _Bools, _Floats]:
    """Rows that differ in conditions; where they disagree about the label, the weightier one decides."""
    rows, which = np.unique(truth, axis=0, return_inverse=True)
    which = which.reshape(-1)
    votes = np.zeros((len(rows), allowed.shape[1]))
    np.add.at(votes, which, allowed * weights[:, None])
    heavy = np.bincount(which, weights, minlength=len(rows))
    labels = votes >= heavy[:, None] * (1.0 - 1e-9)
    none = ~labels.any(axis=1)
    labels[none] = votes[none] >= votes[none].max(axis=1, keepdims=True)
    return rows, labels, heavy


def _covered(literals: _Bools, labels: _Bools, size: _Floats, prices: _Floats, default: int) -> list[_Draft]:
    """Rules for all rows for which the default won't do, in the order in which they are found."""
    left = np.ones(len(literals), dtype=np.bool_)
    rules: list[_Draft] = []
    while (left & ~labels[:, default]).any():
        rule = _best(literals[left], labels[left], size[left], prices, default)
        rules.append(rule)
        left &= ~literals[:, rule[0]].all(axis=1)
    return rules


def _best(literals: _Bools, labels: _Bools, size: _Floats, prices: _Floats, default: int) -> _Draft:
    """The conjunction that decides most rows for its price and is right of all of them."""
    needed = np.where(labels[:, default], 0.0, size)
    most = literals.shape[1] // 2
    best: tuple[float, _Draft] | None = None
    for label in range(labels.shape[1]):
        good = labels[:, label]
        if not (good & (needed > 0)).any():
            continue
        beam: list[tuple[int, ...]] = [()]
        for _ in range(most):
            grown: dict[tuple[int, ...], tuple[float, float]] = {}
            for tests in beam:
                here = literals[:, tests].all(axis=1)
                gain = (here * good * needed) @ literals
                wrong = (here & ~good).astype(np.float64) @ literals
                for k in np.flatnonzero(gain > 0).tolist():
                    if k in tests or (k + most) % (2 * most) in tests:
                        continue
                    grown[tuple(sorted((*tests, k)))] = (float(wrong[k]), float(gain[k]))
            scored = sorted(grown.items(), key=lambda g: (-_score(g[1], g[0], prices), g[0]))
            for tests, (wrong_rows, gained) in scored:
                if wrong_rows == 0:
                    value = gained / (2.0 + prices[list(tests)].sum())
                    if best is None or value > best[0] + 1e-12:
                        best = (value, (tests, label))
            if best is not None or not grown:
                break
            beam = [tests for tests, _ in scored[:BEAM]]
    assert best is not None, "rows that differ in no condition have a common label"
    return best[1]


def _score(counts: tuple[float, float], tests: tuple[int, ...], prices: _Floats) -> float:
    """How promising a conjunction is, from the rows that it gets wrong and what it gains."""
    wrong, gained = counts
    return float(np.log2(1.0 + gained) - 2.0 * np.log2(1.0 + wrong) - 0.25 * prices[list(tests)].sum())


def _pruned(literals: _Bools, labels: _Bools, rules: list[_Draft], default: int) -> list[_Draft]:
    """The rules without tests, and the list without rules, that nothing depends on."""
    number = len(rules) - 1
    while number >= 0:
        without = [*rules[:number], *rules[number + 1 :]]
        if _right(literals, labels, without, default):
            rules = without
        else:
            for test in rules[number][0]:
                tests, label = rules[number]
                shorter = (tuple(k for k in tests if k != test), label)
                changed = [*rules[:number], shorter, *rules[number + 1 :]]
                if shorter[0] and _right(literals, labels, changed, default):
                    rules = changed
        number -= 1
    return rules


def _improved(
    literals: _Bools, labels: _Bools, rules: list[_Draft], prices: _Floats, default: int
) -> list[_Draft]:
    """The rules in an order, and with tests in others' places, that let more of them be left out."""
    price = _price(rules, prices)
    better = True
    while better:
        better = False
        for changed in _variants(rules):
            if not _right(literals, labels, changed, default):
                continue
            shorter = _pruned(literals, labels, changed, default)
            if (found := _price(shorter, prices)) < price - 1e-9:
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
            yield [(rules[j][0], label) if k == i else (tests, label) for k, (tests, label) in enumerate(rules)]
            at = moved.index(rules[i])
            yield [(rules[j][0], r[1]) if k == at else r for k, r in enumerate(moved)]


def _price(rules: Sequence[_Draft], prices: _Floats) -> float:
    """What it costs to write down the rules."""
    return float(sum(2.0 + sum(prices[k] for k in tests) for tests, _ in rules))


def _right(literals: _Bools, labels: _Bools, rules: Sequence[_Draft], default: int) -> bool:
    left = np.ones(len(literals), dtype=np.bool_)
    for tests, label in rules:
        here = left & literals[:, tests].all(axis=1)
        if (here & ~labels[:, label]).any():
            return False
        left &= ~here
    return bool(labels[left, default].all())


def _weighed(
    literals: _Bools, heavy: _Floats, rules: Sequence[_Draft], default: int, conditions: int
) -> tuple[Rule, ...]:
    left = np.ones(len(literals), dtype=np.bool_)
    found = []
    for tests, label in rules:
        here = left & literals[:, tests].all(axis=1)
        pairs = tuple((k % conditions, k < conditions) for k in tests)
        found.append(Rule(pairs, label, float(heavy[here].sum())))
        left &= ~here
    return (*found, Rule((), default, float(heavy[left].sum())))
