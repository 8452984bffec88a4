"""The law of last resort: one function for nearly everything, as good as the library allows.

Where no function is exact, because the true law isn't among the features offered, the best sparse function may still
be very good. It is taken if it leaves little of what changes, and its residuals then count as the target's noise. Where
what it leaves is noise, because rows that lie close together have residuals that are not alike, it may be more: an
engine that fires as it likes can't be foretold any better.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import likeness
from relgym.config import ClusteringConfig
from relgym.numeric.stepwise import LinearFit, eliminate_backward, forward_stepwise

__all__ = ["LEFT", "LEFT_LINEAR", "NEARLY_ALL", "NORMAL", "Approximation", "approximate", "terms_of"]

LEFT, LEFT_LINEAR = 0.1, 0.01
"""Largest share of the change's standard deviation that an approximation may leave: with features that were asked
for, and without any, where a coarse linear function would pass for a law."""

NOISY, ALIKE = 0.5, 0.2
"""Largest share that may be left if it is noise: if residuals of neighbours are correlated by no more than this."""

NEARLY_ALL = 0.9
"""Least share of the examples that it must be good for."""

NORMAL = 1.6449
"""So many standard deviations hold that share of a normal distribution."""

MANY_FEATURES = (200, 800)
"""Among so many columns an approximation may have twice, or three times, as many terms as a mode."""

ROUNDS = 3
"""Fits, each to what the one before was good for."""


@dataclass(frozen=True, slots=True)
class Approximation:
    """A function, the rows it is good for, and the standard deviation of its residuals there."""

    fit: LinearFit
    inliers: NDArray[np.bool_]
    sigma: float


def terms_of(columns: int, config: ClusteringConfig) -> int:
    """Largest number of weights of an approximation among so many columns."""
    return config.max_terms * (1 + sum(columns > many for many in MANY_FEATURES))


def approximate(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    present: NDArray[np.float64],
    *,
    floor: float,
    terms: int,
    stds: float,
    left: float,
    noisy: int = 0,
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
    noisy
        Whether up to `NOISY` of it may be left if that is noise, and then the number of leading columns that say how
        close rows lie. Noise need not be normal: it may come with some actions only.

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
        if noisy and kept.mean() < NEARLY_ALL:
            kept = error <= stds * float(np.quantile(error, NEARLY_ALL)) / NORMAL
    if kept.mean() < NEARLY_ALL:
        return None
    sigma = max(float(np.sqrt(np.square(error[kept]).mean())), floor)
    share = sigma / max(float(change[kept].std()), floor)
    if share > left and not (noisy and share <= NOISY and _is_noise(x, y, fit, kept, noisy)):
        return None
    return Approximation(eliminate_backward(x[kept], y[kept], fit, sigma=sigma), kept, sigma)


def _is_noise(
    x: NDArray[np.float64], y: NDArray[np.float64], fit: LinearFit, kept: NDArray[np.bool_], own: int
) -> bool:
    """Whether a function's residuals are not alike between neighbours, and take as many values as noise does."""
    left = (y - fit.predict(x))[kept]
    if len(np.unique(y[kept])) < 0.5 * len(left):
        return False  # a choice among few values is no noise
    return likeness(x[kept][:, :own], left) <= ALIKE
