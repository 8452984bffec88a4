"""Noise that depends on a number: one threshold, and how far examples scatter on either side of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import SlotSignature
from relgym.config.constants import ENOUGH, EVIDENCE

__all__ = ["Split", "find_split", "place_of"]


@dataclass(frozen=True, slots=True)
class Split:
    """Standard deviations of residuals where a number is small, and where it is large.

    Attributes
    ----------
    name
        The number, as functions call it: ``x``, or ``action.a``.
    threshold
        Up to which it is small.
    below, above
        The spreads, in units of the target.
    """

    name: str
    threshold: float
    below: float
    above: float

    def of(self, number: float) -> float:
        """The spread that goes with a value of the number."""
        return self.below if number <= self.threshold else self.above

    def __str__(self) -> str:
        return f"± {self.below:.2g} where {self.name} <= {self.threshold:.3g}, ± {self.above:.2g} else"

    def to_json(self) -> list[Any]:
        """Plain data that `from_json` reads back."""
        return [self.name, self.threshold, self.below, self.above]

    @classmethod
    def from_json(cls, data: Sequence[Any]) -> Split:
        """Read what `to_json` wrote."""
        return cls(str(data[0]), *map(float, data[1:]))


def place_of(name: str, signature: SlotSignature) -> int | None:
    """Where a number stands in a row; None if it doesn't."""
    return next((k for k in range(signature.core) if signature.named(k) == name), None)


def find_split(
    error: NDArray[np.float64], x: NDArray[np.float64], names: Sequence[str], floor: float
) -> Split | None:
    """The threshold that makes residuals likeliest, if they scatter so differently on either side that it is no chance.

    Parameters
    ----------
    error
        Absolute residuals, shape ``(n,)``.
    x, names
        What may tell them apart, shape ``(n, d)``, and what it is called.
    floor
        Rounding noise: smaller residuals are none.

    Notes
    -----
    Cost O(d n log n). One side's spread must be more than twice the other's, and `ENOUGH` examples tell one. Zero is
    taken for a threshold where it is as good as the best but for the bits that it takes to state another one.
    """
    n, d = x.shape
    if n < 2 * ENOUGH or not d:
        return None
    order = np.argsort(x, axis=0, kind="stable")
    values, squares = np.take_along_axis(x, order, axis=0), np.cumsum(np.square(error)[order], axis=0)
    count = np.arange(1, n)[:, None]
    below = np.maximum(np.sqrt(squares[:-1] / count), floor)
    above = np.maximum(np.sqrt(np.maximum(squares[-1] - squares[:-1], 0.0) / (n - count)), floor)
    whole = max(float(np.sqrt(squares[-1, 0] / n)), floor)
    gain = n * np.log2(whole) - count * np.log2(below) - (n - count) * np.log2(above)
    apart = np.maximum(below, above) > 2.0 * np.minimum(below, above)
    gain[(values[1:] <= values[:-1]) | (count < ENOUGH) | (n - count < ENOUGH) | ~apart] = -np.inf
    at, column = map(int, np.unravel_index(int(gain.argmax()), gain.shape))
    cost = float(np.log2(n * d))
    if gain[at, column] < cost + EVIDENCE:
        return None
    threshold = float(0.5 * (values[at, column] + values[at + 1, column]))
    zero = int(np.searchsorted(values[:, column], 0.0, side="right")) - 1
    if 0 <= zero < n - 1 and gain[zero, column] >= gain[at, column] - np.log2(n):
        at, threshold = zero, 0.0
    return Split(names[column], threshold, float(below[at, column]), float(above[at, column]))
