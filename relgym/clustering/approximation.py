"""The law of last resort: one function for nearly everything, as good as the library allows.

Where no function is exact, because the true law isn't among the features offered, the best sparse function may still
be very good. It is taken if it leaves little of what changes, and its residuals then count as the target's noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.numeric.stepwise import LinearFit, eliminate_backward, forward_stepwise

__all__ = ["LEFT", "LEFT_LINEAR", "Approximation", "approximate"]

LEFT, LEFT_LINEAR = 0.1, 0.01
"""Largest share of the change's standard deviation that an approximation may leave: with features that were asked
for, and without any, where a coarse linear function would pass for a law."""

NEARLY_ALL = 0.9
"""Least share of the examples that it must be good for."""

ROUNDS = 3
"""Fits, each to what the one before was good for."""


@dataclass(frozen=True, slots=True)
class Approximation:
    """A function, the rows it is good for, and the standard deviation of its residuals there."""

    fit: LinearFit
    inliers: NDArray[np.bool_]
    sigma: float


def approximate(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    present: NDArray[np.float64],
    *,
    floor: float,
    terms: int,
    stds: float,
    left: float,
) -> Approximation | None:
    """The best sparse function of nearly all rows, if it leaves little of the change; else None.

    Parameters
    ----------
    x
        Rows ``(n, d)``.
    y, present
        Responses and what their changes count from, shape ``(n,)``.
    floor
        Rounding noise, in units of y.
    terms
        Largest number of weights.
    stds
        A row counts as explained up to so many standard deviations.
    left
        Largest share of the change's standard deviation that may be left.

    Notes
    -----
    Cost O(n d terms), three times over.
    """
    kept = np.ones(len(y), dtype=bool)
    change = y - present
    for _ in range(ROUNDS):
        fit = forward_stepwise(x[kept], y[kept], sigma=floor, max_terms=terms, eliminate=False)
        error = np.abs(y - fit.predict(x))
        spread = 1.4826 * float(np.median(error))  # of a normal distribution, whatever the outliers
        kept = error <= stds * max(spread, floor)
    if kept.mean() < NEARLY_ALL:
        return None
    sigma = max(float(np.sqrt(np.square(error[kept]).mean())), floor)
    if sigma > left * float(change[kept].std()):
        return None
    return Approximation(eliminate_backward(x[kept], y[kept], fit, sigma=sigma), kept, sigma)
