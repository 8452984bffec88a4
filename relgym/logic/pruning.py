"""Make a found clause as general as its training tuples allow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relgym.config.constants import ROUNDED, SAME_DIGITS
from relgym.logic.batch import extremes, matches
from relgym.logic.clause import Clause, Coverage, Literal
from relgym.logic.facts import Bool, Facts, Float, Int
from relgym.logic.thresholds import merit, rounding, simplest_between

__all__ = ["Problem", "center_thresholds", "prune"]


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Labelled, weighted tuples: `tuples` of shape (n, 1 + arity), `weights` and `positive` of shape (n,)."""

    facts: Facts
    tuples: Int
    weights: Float
    positive: Bool

    def matches(self, clause: Clause) -> Bool:
        """Return which tuples a clause matches, shape (n,)."""
        return matches(clause, self.facts, self.tuples)

    def count(self, chosen: Bool) -> Coverage:
        """Return the weight of the chosen positives and negatives."""
        good, bad = self.weights[chosen & self.positive], self.weights[chosen & ~self.positive]
        return Coverage(float(good.sum()), float(bad.sum()))


def prune(clause: Clause, problem: Problem) -> Clause:
    """Drop literals that keep no negative out.

    Parameters
    ----------
    clause
        As it came out of the search.
    problem
        Positives that are still to be covered, and *all* negatives: none may be admitted, decided before or
        not.

    Returns
    -------
    The clause in normal form: what is left in negated literals only has become ``*``.

    Notes
    -----
    Of several literals that can go, the one goes first whose absence covers most positives; on ties the last
    one. The original dropped literals from the last to the first on a quarter of the negatives, and so
    admitted some.
    """
    reached, admitted = _value(clause, problem)
    while len(clause) > 1:
        shorter = [clause.without(index) for index in reversed(range(len(clause)))]
        values = [_value(each, problem) for each in shorter]
        allowed = [
            (good, -place) for place, (good, bad) in enumerate(values) if bad <= admitted and good >= reached
        ]
        if not allowed:
            break
        best = -max(allowed)[1]
        clause, (reached, admitted) = shorter[best], values[best]
    return clause


def _value(clause: Clause, problem: Problem) -> tuple[float, float]:
    covered = problem.count(problem.matches(clause))
    # rounded: the same tuples summed in another order are the same weight
    return round(covered.positives, SAME_DIGITS), round(covered.negatives, SAME_DIGITS)


def center_thresholds(clause: Clause, problem: Problem) -> Clause:
    """Move every threshold to the middle of its gap, given the clause's other literals.

    Notes
    -----
    While the clause grew, a threshold stood between all values; now only the tuples that the other literals
    let through count, so the gap is wider. The move never lets a negative in nor a positive out.
    """
    for index, literal in enumerate(clause.literals):
        if literal.op is not None:
            clause = clause.replace(index, _centered(clause, index, literal, problem))
    return clause


def _centered(clause: Clause, index: int, literal: Literal, problem: Problem) -> Literal:
    values = extremes(clause, index, problem.facts, problem.tuples)
    below = (literal.op == "<=") != literal.negated
    inside = values <= literal.threshold if below else values > literal.threshold
    cut = _widest_cut(values, inside, problem, below)
    if cut is None:
        return literal
    low, high = cut
    threshold = simplest_between(low, high)
    return Literal(literal.relation, literal.args, literal.negated, literal.op, threshold)


def _widest_cut(values: Float, inside: Bool, problem: Problem, below: bool) -> tuple[float, float] | None:
    """Return the gap that divides best, and of equal ones that around zero, or else the widest.

    None of them may have more negatives or fewer positives inside than there are now.
    """
    order = np.argsort(values if below else -values, kind="stable")
    order = order[np.isfinite(values[order]) & (problem.weights[order] > 0)]
    if order.size < 2:
        return None
    positive = problem.positive[order]
    good = np.cumsum(np.where(positive, problem.weights[order], 0.0))[:-1]
    bad = np.cumsum(np.where(positive, 0.0, problem.weights[order]))[:-1]
    now = problem.count(inside & np.isfinite(values))
    ends = np.sort([values[order][:-1], values[order][1:]], axis=0)
    gaps = ends[1] - ends[0]
    slack = ROUNDED * (1.0 + now.total)
    allowed = (
        (gaps > rounding(values[order])) & (good >= now.positives - slack) & (bad <= now.negatives + slack)
    )
    if not allowed.any():
        return None
    best = np.where(allowed, good - bad, -np.inf).max() - slack
    place = int(np.argmax(np.where(allowed & (good - bad >= best), merit(ends[0], ends[1]), -1.0)))
    return float(ends[0, place]), float(ends[1, place])
