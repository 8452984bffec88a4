"""The law of last resort: one function for nearly everything, as good as the library allows.

Where no function is exact, because the true law isn't among the features offered, the best sparse function may still
be very good. It is taken if it leaves little of what changes, and its residuals then count as the target's noise. Where
what it leaves is noise, because rows that lie close together have residuals that are not alike, it may be more: an
engine that fires as it likes can't be predicted any better.

A few rows that follow no law at all, a lander's touches, carry most of the squares, and squares are what selects
terms. So a term that serves few rows must be their law, or it goes and they count no longer. And a second search sees
changes no larger than most to begin with. Among many features a series stands in for what a line would do: linear
columns are searched alone, too. What was found first gives way to a shorter function that is as good.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import likeness
from relgym.config import ClusteringConfig
from relgym.config.constants import (
    ALTERNATIVES,
    CALL,
    MAJORITY,
    NEARLY_ALL,
    RECENT,
    ROUNDS,
    SEARCHED_ROWS,
    SELDOM,
    SMALL,
    STDS,
    TYPICAL,
)
from relgym.numeric.stepwise import LinearFit, eliminate_backward, forward_stepwise
from relgym.scheduling.work import Steps, resumable

__all__ = [
    "LEFT",
    "Approximation",
    "approximate",
    "as_good",
    "normal_reach",
    "reach",
    "terms_of",
]

LEFT: Final = SMALL
"""Largest share of the change's standard deviation that an approximation may leave: with features that were asked
for, and without any, where a coarse linear function would pass for a law."""


@dataclass(frozen=True, slots=True)
class Approximation:
    """A function, the rows it is good for, the standard deviation of its residuals there, and its `reach`."""

    fit: LinearFit
    inliers: NDArray[np.bool_]
    sigma: float
    reach: float


def terms_of(columns: int, config: ClusteringConfig) -> int:
    """Largest number of weights of an approximation among so many columns.

    As many as a mode may have; twice as many where columns outnumber the `RECENT` examples that the first approximation
    has at least, and three times where they outnumber those of the next one, too.
    """
    return config.max_terms * (1 + sum(columns > rows for rows in (RECENT, SELDOM * RECENT)))


def normal_reach() -> float:
    """So many standard deviations hold `NEARLY_ALL` of a normal distribution."""
    return NormalDist().inv_cdf(0.5 + 0.5 * NEARLY_ALL)


def reach(errors: NDArray[np.float64], floor: float = 0.0) -> float:
    """The error, in units of y, that nearly all rows stay below; errors as small as rounding are all alike."""
    return max(float(np.quantile(errors, NEARLY_ALL)), normal_reach() * floor)


def as_good(one: float, other: float) -> bool:
    """Whether the first of two errors is no larger than the other one, but for a small part."""
    return one <= (1.0 + SMALL) * other


@resumable
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
    lines: bool = True,
) -> Steps[Approximation | None]:
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
        Whether up to `MAJORITY` of it may be left if that is noise, and then the number of leading columns that are no
        features: they say how close rows lie. Noise need not be normal: it may come with some actions only.
    lines
        Whether columns that are no features are searched alone, too.

    Notes
    -----
    Cost O(n d terms), some six times over, and as often again where terms go.
    """
    change = y - present
    tamed = present + np.clip(change, *np.quantile(change, [0.5 - 0.5 * NEARLY_ALL, 0.5 + 0.5 * NEARLY_ALL]))
    widths = (x.shape[1], noisy) if lines and 0 < noisy < x.shape[1] else (x.shape[1],)
    best: Approximation | None = None
    for width in widths:
        search = _Search(x[:, :width], y, change, floor, terms, stds, left, noisy)
        first = yield from search.run(y)
        for found in (*first, *(yield from search.run(tamed))):
            if best is None or _shorter(found, best):
                best = found
    return best


def _shorter(one: Approximation, other: Approximation) -> bool:
    """Whether a function is shorter than another one, and as good."""
    return one.fit.terms < other.fit.terms and as_good(one.reach, other.reach)


@dataclass(frozen=True, slots=True)
class _Search:
    """What searches among the same columns share; attributes as the parameters of `approximate`."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    change: NDArray[np.float64]
    floor: float
    terms: int
    stds: float
    left: float
    noisy: int

    def run(self, first: NDArray[np.float64]) -> Steps[list[Approximation]]:
        """What is found from these responses to begin with, and what is left of it without terms that are no laws."""
        every = counted = np.ones(len(self.y), dtype=np.bool_)
        fit = yield from self._fit(first, every)
        for _ in range(ROUNDS - 1):
            fit = yield from self._fit(self.y, self._explained(fit))
        whole = fit
        for _ in range(ALTERNATIVES):
            lawless = counted & self._lawless(fit, self._explained(fit))
            if not lawless.any() or (counted & ~lawless).mean() < NEARLY_ALL:
                break
            counted = counted & ~lawless
            for _ in range(ROUNDS - 1):
                fit = yield from self._fit(self.y, self._explained(fit) & counted)
        fits = [(whole, every)] if fit is whole else [(whole, every), (fit, counted)]
        found = []
        for each in fits:
            if (one := (yield from self._approximation(*each))) is not None:
                found.append(one)
        return found

    def _approximation(self, fit: LinearFit, counted: NDArray[np.bool_]) -> Steps[Approximation | None]:
        """A function as an approximation, of which some rows count; None if it leaves too much, or too many."""
        explained = self._explained(fit)
        yield CALL
        if explained.mean() < NEARLY_ALL:
            return None
        kept = explained & counted
        sigma = self._sigma(fit, kept)
        share = sigma / max(float(self.change[kept].std()), self.floor)
        if share > self.left and not (self.noisy and share <= MAJORITY and self._is_noise(fit, kept)):
            return None
        shorter = yield from eliminate_backward.steps(self.x[kept], self.y[kept], fit, sigma=sigma)
        return Approximation(shorter, explained, sigma, reach(self._errors(shorter), self.floor))

    def _fit(self, y: NDArray[np.float64], rows: NDArray[np.bool_]) -> Steps[LinearFit]:
        return forward_stepwise.steps(
            self.x[rows], y[rows], sigma=self.floor, max_terms=self.terms, eliminate=False
        )

    def _errors(self, fit: LinearFit) -> NDArray[np.float64]:
        found: NDArray[np.float64] = np.abs(self.y - fit.predict(self.x))
        return found

    def _sigma(self, fit: LinearFit, rows: NDArray[np.bool_]) -> float:
        return max(float(np.sqrt(np.square(self._errors(fit)[rows]).mean())), self.floor)

    def _explained(self, fit: LinearFit) -> NDArray[np.bool_]:
        """Rows that a function is good for, shape ``(n,)``."""
        errors = self._errors(fit)
        spread = float(np.median(errors)) / TYPICAL  # of a normal distribution, whatever the outliers
        explained: NDArray[np.bool_] = errors <= self.stds * max(spread, self.floor)
        if self.noisy and explained.mean() < NEARLY_ALL:
            explained = errors <= self.stds * reach(errors) / normal_reach()
        return explained

    def _lawless(self, fit: LinearFit, explained: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Rows served by terms that serve few rows and are not their law, shape ``(n,)``.

        Few are fewer than may be left unexplained, and a term is their law if most of them are explained. What it
        contributes less than noise to isn't served.
        """
        least = self._sigma(fit, explained)
        found = np.zeros(len(self.y), dtype=np.bool_)
        for column, weight in zip(fit.columns, fit.weights, strict=True):
            values = self.x[:, column]
            served = np.abs(weight * (values - np.median(values))) > least
            if 0.0 < served.mean() < 1.0 - NEARLY_ALL and explained[served].mean() < MAJORITY:
                found |= served
        return found

    def _is_noise(self, fit: LinearFit, kept: NDArray[np.bool_]) -> bool:
        """Whether residuals are not alike between neighbours, and take as many values as noise does."""
        rest = (self.y - fit.predict(self.x))[kept]
        if len(np.unique(self.y[kept])) < MAJORITY * len(rest):
            return False  # a choice among few values is no noise
        # A correlation by chance, of as many pairs of neighbours as are looked at.
        return likeness(self.x[kept][:, : self.noisy], rest) <= STDS / math.sqrt(SEARCHED_ROWS)
