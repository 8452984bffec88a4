"""Sparse linear regression: forward-stepwise selection by Mallows's Cp, backward elimination (Algorithm 1).

Deviation from the thesis
-------------------------
Algorithm 1 as printed never removes a chosen regressor from the candidates, divides by ``S**2`` although its
``S`` is already a mean square, and keeps an old ``C_best`` between rounds. Here the noise variance is *given*
(as in the original program, which is why exact data make no 0/0), columns are orthogonalised as they are
chosen instead of sweeping a cross-product matrix (whose condition is squared), and a backward pass drops what
later columns made superfluous. All sums are NumPy reductions, never BLAS, so that results don't depend on
thread counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ALIKE, CALL, LEFT_OPEN, ROUGH, ROUNDED, WIDE
from relgym.scheduling.work import Steps, resumable

__all__ = [
    "LinearFit",
    "choosing_cells",
    "eliminate_backward",
    "equal_gains",
    "fitting_cells",
    "forward_order",
    "forward_stepwise",
    "least_squares",
    "varying_columns",
    "with_unit",
]

_Size = TypeVar("_Size", float, NDArray[np.float64])


@dataclass(frozen=True, slots=True)
class LinearFit:
    """A sparse linear function ``intercept + sum(weights * x[columns])`` and how well it fits.

    Attributes
    ----------
    columns
        Indices of the columns with a non-zero weight, ascending.
    weights
        Their weights, in units of y per unit of the column.
    intercept
        Constant term; exactly 0.0 when the data need none.
    rss
        Residual sum of squares on the data it was fitted to.
    """

    columns: tuple[int, ...]
    weights: tuple[float, ...]
    intercept: float
    rss: float

    @property
    def terms(self) -> int:
        """Number of free parameters."""
        return len(self.columns) + (self.intercept != 0.0)

    def predict(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values on rows of `x`, shape ``(n, d)`` → ``(n,)``; summed in column order, hence repeatable."""
        value = np.full(len(x), self.intercept)
        for column, weight in zip(self.columns, self.weights, strict=True):
            value += weight * x[:, column]
        return value


def with_unit(fit: LinearFit, column: int | None = None) -> LinearFit:
    """A function of all columns but one, with a weight of 1 for that one; None: the same function."""
    if column is None:
        return fit
    columns = (column, *(c + (c >= column) for c in fit.columns))
    pairs = sorted(zip(columns, (1.0, *fit.weights), strict=True))
    return LinearFit(tuple(c for c, _ in pairs), tuple(w for _, w in pairs), fit.intercept, fit.rss)


def varying_columns(x: NDArray[np.float64]) -> NDArray[np.intp]:
    """Indices of the columns of `x` that aren't constant (relative to their size)."""
    spread = x.max(axis=0) - x.min(axis=0)
    return np.flatnonzero(spread > ROUNDED * np.abs(x).max(axis=0, initial=0.0))


def least_squares(
    x: NDArray[np.float64], y: NDArray[np.float64], columns: tuple[int, ...], *, intercept: bool = True
) -> LinearFit:
    """Least squares on given columns, by twice-orthogonalised Gram-Schmidt with one step of refinement.

    Parameters
    ----------
    x, y
        Rows of shape ``(n, d)`` and responses of shape ``(n,)``.
    columns
        Columns to use. Those collinear with earlier ones get no weight (§3.2.1: constants of the data
        identify nothing) and don't appear in the result.
    intercept
        Whether to fit a constant term.

    Notes
    -----
    Cost O(n p^2) for p columns.
    """
    a = x[:, list(columns)]
    centre = a.mean(axis=0) if intercept else np.zeros(len(columns))
    a = a - centre
    shift = float(y.mean()) if intercept else 0.0
    factors, rest = _factors(a), y - shift
    weights = factors.solve(rest)
    weights += factors.solve(rest - _combine(a, weights))
    constant = shift - float(np.add.reduce(centre * weights)) if intercept else 0.0
    kept = [k for k in sorted(range(len(columns)), key=columns.__getitem__) if weights[k] != 0.0]
    fit = LinearFit(tuple(columns[k] for k in kept), tuple(float(weights[k]) for k in kept), constant, 0.0)
    return LinearFit(fit.columns, fit.weights, constant, float(np.add.reduce(np.square(y - fit.predict(x)))))


def fitting_cells(rows: int, terms: int) -> int:
    """What `least_squares` of so many rows and terms costs, in cells: each term is taken out of all others, twice."""
    return (1 + terms) * (CALL // 2 + rows * terms)


def choosing_cells(cells: int, terms: int = 1) -> int:
    """What it costs to choose so many columns among so many numbers, in cells.

    Each takes two passes over these to be found and two to be swept out of the others.
    """
    return CALL + (2 + 2) * cells * max(terms, 1)


def _combine(a: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    total: NDArray[np.float64] = np.add.reduce(a * weights, axis=1)
    return total


@dataclass(frozen=True, slots=True)
class _Factors:
    """Orthonormal directions, shape ``(p, n)``, zero for columns collinear with earlier ones, and the triangle back."""

    q: NDArray[np.float64]
    r: NDArray[np.float64]

    @property
    def independent(self) -> bool:
        """Whether no column is collinear with earlier ones."""
        return bool(self.r.diagonal().all())

    def solve(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weights of the least-squares solution; exactly zero for columns collinear with earlier ones."""
        r, parts = self.r.tolist(), np.add.reduce(self.q * y, axis=1).tolist()
        weights = [0.0] * len(parts)
        for k in reversed(range(len(parts))):
            row = r[k]
            if row[k]:
                rest = sum(row[j] * weights[j] for j in range(k + 1, len(parts)) if weights[j])
                weights[k] = (parts[k] - rest) / row[k]
        return np.array(weights)

    def shares(self) -> NDArray[np.float64]:
        """Square of what of each column all others don't reproduce, shape ``(p,)``; no column may be collinear."""
        inverse = np.zeros_like(self.r)
        for k in reversed(range(len(self.q))):
            inverse[k] = -(self.r[k, k + 1 :, None] * inverse[k + 1 :]).sum(axis=0)
            inverse[k, k] += 1.0
            inverse[k] /= self.r[k, k]
        found: NDArray[np.float64] = 1.0 / np.square(inverse).sum(axis=1)
        return found


def _factors(a: NDArray[np.float64]) -> _Factors:
    """Gram-Schmidt, column by column against all before it at once, twice.

    Twice is enough for orthogonality to rounding, with the directions taken one by one or all at once [1]_.

    References
    ----------
    .. [1] L. Giraud, J. Langou, M. Rozloznik, J. van den Eshof, "Rounding error analysis of the classical
       Gram-Schmidt orthogonalization process", Numerische Mathematik 101 (2005).
    """
    columns = np.array(a.T, order="C")  # a copy, worked on in place
    p, n = columns.shape
    q, r = np.zeros((p, n)), np.zeros((p, p))
    for k in range(p):
        column = columns[k]
        size = _length(column)
        if k:
            for _ in range(2):
                parts = np.add.reduce(q[:k] * column, axis=1)
                r[:k, k] += parts
                column -= np.add.reduce(q[:k] * parts[:, None], axis=0)
        left = _length(column)
        if left > ROUNDED * size:
            np.divide(column, left, out=q[k])
            r[k, k] = left
    return _Factors(q, r)


def _length(column: NDArray[np.float64]) -> float:
    return math.sqrt(float(np.add.reduce(column * column)))


@resumable
def forward_stepwise(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    sigma: float,
    max_terms: int | None = None,
    eliminate: bool = True,
) -> Steps[LinearFit]:
    """Forward-stepwise regression with Mallows's Cp (Algorithm 1), then backward elimination.

    Each round adds the column that lowers ``Cp = RSS / sigma^2 - n + 2 (p + 1)`` most; columns that do
    equally well within the noise are decided by their order, the earliest first. It stops when Cp no longer
    falls.

    Parameters
    ----------
    x, y
        Rows of shape ``(n, d)`` and responses of shape ``(n,)``. Constant columns get no weight.
    sigma
        Standard deviation of the noise on y, in units of y; must be positive (rounding counts as noise).
    max_terms
        Largest number of columns; default n - 2, and never more.
    eliminate
        Whether to run the backward pass.

    Notes
    -----
    Cost O(n d p) for p chosen columns.
    """
    order = yield from forward_order.steps(x, y, sigma=sigma, max_terms=max_terms)
    fit = least_squares(x, y, order)
    yield fitting_cells(len(y), fit.terms)
    if eliminate:
        fit = yield from eliminate_backward.steps(x, y, fit, sigma=sigma)
    return fit


@resumable
def forward_order(
    x: NDArray[np.float64], y: NDArray[np.float64], *, sigma: float, max_terms: int | None = None
) -> Steps[tuple[int, ...]]:
    """Columns in the order in which `forward_stepwise` adds them; the first k are what it finds with k at most.

    Parameters and cost as of `forward_stepwise`.
    """
    n = len(y)
    limit = max(0, n - 2 if max_terms is None else min(max_terms, n - 2))
    candidates = varying_columns(x) if n else np.empty(0, dtype=np.intp)
    a = x[:, candidates] - x[:, candidates].mean(axis=0) if len(candidates) else np.empty((n, 0))
    choose = _choose_among_many if len(candidates) > WIDE else _choose
    yield CALL + x.size
    chosen = (yield from choose(a, y - y.mean(), sigma, limit)) if n else []
    return tuple(int(candidates[c]) for c in chosen)


def _choose(
    a: NDArray[np.float64], residual: NDArray[np.float64], sigma: float, limit: int
) -> Steps[list[int]]:
    """Centred columns in the order in which they lower Cp most; what is chosen is swept out of all others."""
    sizes, chosen = np.square(a).sum(axis=0), list[int]()
    while len(chosen) < limit:
        pivots = np.square(a).sum(axis=0)
        usable = pivots > ROUNDED**2 * sizes
        gains = np.zeros(len(sizes))
        gains[usable] = np.square((a[:, usable] * residual[:, None]).sum(axis=0)) / pivots[usable]
        best = _first_of_the_best(gains, len(residual), sigma)
        if best is None:
            break
        chosen.append(best)
        q = a[:, best] / np.sqrt(np.square(a[:, best]).sum())
        residual = residual - (q * residual).sum() * q
        a -= q[:, None] * (q[:, None] * a).sum(axis=0)
        a[:, best] = 0.0
        yield choosing_cells(a.size)
    return chosen


def _choose_among_many(
    a: NDArray[np.float64], residual: NDArray[np.float64], sigma: float, limit: int
) -> Steps[list[int]]:
    """The same at a fraction of the cost: only what is left of the columns' squares is kept up to date.

    That is less exact for columns that are nearly collinear with the chosen ones, hence `ALIKE`.
    """
    sizes = np.einsum("ij,ij->j", a, a)
    pivots, basis, chosen = sizes.copy(), list[NDArray[np.float64]](), list[int]()
    while len(chosen) < limit:
        usable = pivots > ALIKE**2 * sizes
        gains = np.zeros(len(sizes))
        gains[usable] = np.square(np.einsum("i,ij->j", residual, a)[usable]) / pivots[usable]
        best = _first_of_the_best(gains, len(residual), sigma)
        if best is None:
            break
        chosen.append(best)
        q = a[:, best].copy()
        for other in (*basis, *basis):  # twice is enough for orthogonality to rounding
            q -= (other * q).sum() * other
        basis.append(q / np.sqrt(np.square(q).sum()))
        residual = residual - (basis[-1] * residual).sum() * basis[-1]
        pivots -= np.square(np.einsum("i,ij->j", basis[-1], a))
        pivots[best] = 0.0
        yield CALL + a.size // 2  # two passes, and nothing else of this size
    return chosen


def equal_gains(noise: _Size, whole: _Size) -> _Size:
    """Gains that differ by no more are equal: `ROUGH` times what noise leaves in the rows, or rounding of the whole."""
    found: _Size = np.maximum(ROUGH * noise, ROUNDED * whole)
    return found


def _first_of_the_best(gains: NDArray[np.float64], rows: int, sigma: float) -> int | None:
    """The candidate that lowers Cp most, the earliest among equals; None if none lowers it."""
    best = float(gains.max(initial=0.0))
    if best / sigma**2 <= 2.0:  # Cp would not fall
        return None
    least = best - equal_gains(rows * sigma**2, best)
    return int(np.argmax(gains >= max(least, 2.0 * sigma**2)))


@resumable
def eliminate_backward(
    x: NDArray[np.float64], y: NDArray[np.float64], fit: LinearFit, *, sigma: float
) -> Steps[LinearFit]:
    """Drop terms, the constant included, as long as that raises Cp by less than it saves.

    And by no more than as many examples would as a law may leave open.

    Later columns are tried first, so that of two interchangeable ones the earlier stays.
    """
    while fit.terms:
        allowed = 2.0 * sigma**2 * (1.0 + LEFT_OPEN * len(y))
        smaller = [_without(x, y, fit, k) for k in _needless(x, fit, ROUGH * allowed + fit.rss)]
        if fit.intercept != 0.0:
            smaller.append(least_squares(x, y, fit.columns, intercept=False))
        yield (1 + len(smaller)) * fitting_cells(len(y), fit.terms)
        smaller = [s for s in smaller if s.rss <= fit.rss + allowed and s.terms < fit.terms]
        if not smaller:
            return fit
        fit = min(smaller, key=lambda s: (s.terms, s.columns, s.rss))
    return fit


def _needless(x: NDArray[np.float64], fit: LinearFit, allowed: float) -> list[int]:
    """Terms without which the residuals' squares may grow by no more than so much; the others needn't be tried."""
    a = x[:, list(fit.columns)]
    factors = _factors(a - a.mean(axis=0) if fit.intercept != 0.0 else a)
    if not factors.independent:
        return list(range(len(fit.columns)))
    growth = np.square(np.array(fit.weights)) * factors.shares()
    return [int(k) for k in np.flatnonzero(growth <= allowed)]


def _without(x: NDArray[np.float64], y: NDArray[np.float64], fit: LinearFit, k: int) -> LinearFit:
    columns = fit.columns[:k] + fit.columns[k + 1 :]
    return least_squares(x, y, columns, intercept=fit.intercept != 0.0)
