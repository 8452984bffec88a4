"""Where a numeric literal may put its threshold.

A cut between two values of the same class is never best (Fayyad and Irani 1992), so neighbouring values of
one class form one *bin*. Counting then takes a histogram instead of a sort for every candidate clause.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ALL_DIGITS, FEW_VALUES, LITTLE, ROUNDED
from relgym.logic.facts import Float, Int

__all__ = ["Bins", "bin_values", "merit", "rounding", "signs_differ", "simplest_between"]


@dataclass(frozen=True, eq=False)
class Bins:
    """Histogram bins of F functions.

    Parameters
    ----------
    index
        Shape (F, K, …, K, n): each value's bin; `count` where the value is undefined.
    count
        Number of bins B, that of the function that has most.
    low, high
        Shape (F, B): least and greatest value in each bin; NaN for bins that a function doesn't have.
    """

    index: NDArray[np.int16]
    count: int
    low: Float
    high: Float

    @cached_property
    def merits(self) -> Float:
        """Shape (F, B - 1): `merit` of the gap from one bin to the next, NaN behind a function's last bin."""
        return merit(self.high[:, :-1], self.low[:, 1:])


def bin_values(values: Float, split: int) -> Bins:
    """Group each function's values so that every useful threshold lies between two groups.

    Parameters
    ----------
    values
        Shape (F, K, …, K, n); NaN where undefined.
    split
        The first `split` of the n tuples are positive.

    Notes
    -----
    Cost: one sort per function.
    """
    positive = np.broadcast_to(np.arange(values.shape[-1]) < split, values.shape[1:]).ravel()
    parts = [_bin_one(row.ravel(), positive) for row in values]
    count = max(max((len(low) for _, low, _ in parts), default=0), 1)
    low, high = np.full((len(parts), count), np.nan), np.full((len(parts), count), np.nan)
    index = np.empty((len(parts), positive.size), dtype=np.int16)
    for row, (bins, lows, highs) in enumerate(parts):
        low[row, : len(lows)], high[row, : len(highs)] = lows, highs
        index[row] = np.where(bins < 0, count, bins)
    return Bins(index.reshape(values.shape), count, low, high)


def _bin_one(values: Float, positive: NDArray[np.bool_]) -> tuple[Int, Float, Float]:
    """Return each value's bin (-1 where undefined), and the bins' least and greatest values."""
    bins = np.full(len(values), -1, dtype=np.int64)
    defined = np.flatnonzero(np.isfinite(values))
    if not defined.size:
        return bins, np.empty(0), np.empty(0)
    distinct, place = np.unique(values[defined], return_inverse=True)
    groups = np.concatenate([[0], np.cumsum(np.diff(distinct) > rounding(distinct))])
    ends = np.flatnonzero(np.diff(groups, append=groups[-1] + 1))  # no threshold between a number and itself
    starts_at, place = np.concatenate([[0], ends[:-1] + 1]), groups[place]
    lowest, highest, count = distinct[starts_at], distinct[ends], len(ends)
    good = np.bincount(place, positive[defined], count) > 0
    bad = np.bincount(place, ~positive[defined], count) > 0
    same = (good[1:] == good[:-1]) & (bad[1:] == bad[:-1])
    starts = (
        np.flatnonzero(~same | (good & bad)[1:]) + 1
    )  # a value that both classes have is a bin of its own
    if len(starts) >= FEW_VALUES:  # where classes alternate so often, cuts are taken at every m-th boundary
        starts = starts[np.linspace(0, len(starts) - 1, FEW_VALUES - 1).round().astype(np.int64)]
    bins[defined] = np.searchsorted(starts, place, side="right")
    first = np.concatenate([[0], starts])
    last = np.concatenate([starts, [count]]) - 1
    return bins, lowest[first], highest[last]


def rounding(values: Float) -> float:
    """Return the difference up to which two of some finite values are the same number, computed in two ways.

    Relative to the greatest of them. Of numbers that are all next to nothing, all are the same: how far things that
    touch are apart is what positions are rounded by.
    """
    greatest = float(np.abs(values).max(initial=0.0))
    return ROUNDED * greatest if greatest > ROUNDED else ROUNDED


def signs_differ(low: Float | float, high: Float | float) -> NDArray[np.bool_] | bool:
    """Whether zero lies well inside each gap: there, the sign alone tells the two sides apart.

    Ends that are zero but for rounding are no sides: whether such a number is positive is chance.
    """
    margin = LITTLE * (high - low)
    return (low < -margin) & (high > margin)


def merit(low: Float, high: Float) -> Float:
    """How good each gap is for a threshold: its width, but infinite where the sign alone decides.

    Zero is the one threshold that isn't fitted to the data: "moves left", "this mode predicts more than that one".
    """
    return np.where(signs_differ(low, high), np.inf, high - low)


def simplest_between(low: float, high: float) -> float:
    """Return zero if it lies well inside a gap, else the number with the fewest digits that does.

    Of several with as few the one next to the middle. Where a world's own threshold is such a number, as people choose
    them, it is this one: that it lies in a narrow gap is no chance. Where it isn't, it may lie anywhere in the gap: a
    number at the gap's end then divides twice as badly as the middle does.

    >>> simplest_between(-0.0231, 0.0107)
    0.0
    >>> simplest_between(0.0107, 0.0231)
    0.02
    >>> simplest_between(-1.001, -0.9615)
    -1.0
    """
    if signs_differ(low, high):
        return 0.0
    middle, margin = low + (high - low) / 2, LITTLE * (high - low)
    for digits in range(1, ALL_DIGITS + 1):
        number = float(f"{middle:.{digits}g}")
        if low + margin <= number <= high - margin and low <= number < high:
            return number
    return middle if middle < high else low
