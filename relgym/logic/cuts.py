"""Thresholds as candidate literals: counts on either side of all of them at once, by histogram."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.logic.facts import Float, Int
from relgym.logic.growing import Counts, Score, Tensor, Weights
from relgym.logic.tables import Defined, NumericStack
from relgym.logic.thresholds import Bins

__all__ = ["Cuts", "best_cuts"]


class Cuts:
    """Counts on either side of every threshold of every function in a stack, by histogram.

    Parameters
    ----------
    stack
        F functions in at most B bins.
    marginal
        Shape (K, …, K, n): number of bindings per choice of the functions' existential arguments.
    weights
        Weights of the tuples.
    """

    def __init__(self, stack: NumericStack, marginal: Tensor, weights: Weights) -> None:
        self._rows = len(stack.templates)
        self._count = stack.bins.count
        self._weights = weights
        size = marginal.shape[-1]
        index = stack.bins.index.reshape(len(stack.templates), -1, size)
        flat = marginal.reshape(-1, size)
        self._bindings = self._expanded(flat, stack.defined)
        active = flat > 0
        self._lowest = np.where(active, index, self._count).min(axis=1)
        highest = np.where(active & (index < self._count), index, -1).max(axis=1)
        self._highest = np.where(highest < 0, self._count, highest)

    def some(self) -> Iterator[tuple[str, Counts]]:
        """Yield for each operator what is left if some binding must lie on that side."""
        good, bad = self._bindings
        low = self._cumulative(self._lowest, np.ones(self._lowest.shape))
        high = self._cumulative(self._highest, np.ones(self._highest.shape))
        yield "<=", Counts(low[0][:, :-1], low[1][:, :-1], good[:, :-1], bad[:, :-1])
        yield ">", Counts(_above(high[0]), _above(high[1]), _above(good), _above(bad))

    def none(self, total: Tensor) -> Iterator[tuple[str, Counts]]:
        """Yield for each operator what is left if no object may lie on that side."""
        everything = Counts.of(total, self._weights)
        ones = np.ones(self._lowest.shape)
        expanded = np.broadcast_to(total, self._lowest.shape)
        for op, extreme in (("<=", self._lowest), (">", self._highest)):
            side = [
                part[:, :-1] if op == "<=" else _above(part)
                for counts in ((total > 0) * ones, expanded)
                for part in self._cumulative(extreme, counts)
            ]
            wholes = (everything.positives, everything.negatives, everything.good, everything.bad)
            yield op, Counts(*(whole - part for whole, part in zip(wholes, side, strict=True)))

    def _cumulative(self, index: NDArray[np.int16], counts: NDArray[Any]) -> tuple[Float, Float]:
        """Return, for positives and negatives, the weight in the bins up to each: shape (F, B)."""
        split = len(self._weights.first)
        offset = np.arange(len(index)).reshape(-1, 1) * (self._count + 1)
        first, second = (
            self._histogram((index[:, part] + offset).ravel(), (counts[:, part] * weights).ravel())
            for part, weights in (
                (slice(split), self._weights.first),
                (slice(split, None), self._weights.second),
            )
        )
        return self._weights.ordered(first, second)

    def _expanded(self, marginal: Tensor, defined: tuple[Defined, Defined]) -> tuple[Float, Float]:
        """Do the same for bindings instead of tuples."""
        split = len(self._weights.first)
        first = (marginal[:, :split] * self._weights.first).ravel()[defined[0].cell]
        second = (marginal[:, split:] * self._weights.second).ravel()[defined[1].cell]
        return self._weights.ordered(
            self._histogram(defined[0].place, first), self._histogram(defined[1].place, second)
        )

    def _histogram(self, place: NDArray[Any], weights: Float) -> Float:
        found = np.bincount(place, weights, self._rows * (self._count + 1))
        return np.cumsum(found.reshape(self._rows, -1)[:, :-1], axis=1)


def best_cuts(bins: Bins, score: Score, counts: Counts) -> tuple[Int, Int]:
    """Choose each function's best threshold; among equally good ones zero, or else that in the widest gap.

    Parameters
    ----------
    bins
        Where thresholds may be.
    score
        What is best.
    counts
        Shape (F, B - 1): what is left for each of them.

    Returns
    -------
    Functions that have a threshold at all, and the bin behind which it lies.
    """
    merits = bins.merits
    if not merits.size:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    scores = np.where(np.isnan(merits), -np.inf, score(counts))
    best = scores.max(axis=1, keepdims=True)
    cut = np.argmax(np.where((scores >= best) & (scores > -np.inf), merits, -np.inf), axis=1)
    rows = np.flatnonzero(best[:, 0] > -np.inf)
    return rows, cut[rows]


def _above(cumulative: Float) -> Float:
    return cumulative[:, -1:] - cumulative[:, :-1]
