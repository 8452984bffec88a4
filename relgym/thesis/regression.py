"""Forward-stepwise regression with Mallows's Cp (§3.2.1, Algorithm 1), for one data set and for many small ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Line", "fit", "fit_samples"]

Floats = NDArray[np.float64]

_CONSTANT = 1e-15
"""Range, relative to the largest value, up to which a column is constant; smaller values are 0 (the program's)."""

_DEPENDENT = 1e-10
"""Share of a column's length that must be left when the chosen columns are taken out of it."""


@dataclass(frozen=True, slots=True)
class Line:
    """A linear function of some columns: ``intercept + weights . x[columns]``."""

    columns: tuple[int, ...]
    weights: tuple[float, ...]
    intercept: float

    def values(self, x: Floats) -> Floats:
        """The function of every row of `x`, shape ``(n, d)``."""
        total = np.full(len(x), self.intercept)
        for column, weight in zip(self.columns, self.weights, strict=True):
            total += weight * x[:, column]
        return total


def fit(x: Floats, y: Floats, variance: float) -> Line:
    """Fit a line to examples by Algorithm 1.

    Parameters
    ----------
    x, y
        Rows and responses, shapes ``(n, d)`` and ``(n,)``.
    variance
        Of the noise, which scales Cp.

    Notes
    -----
    Cost: O(n d) per chosen column.
    """
    columns, weights, intercept = fit_samples(x[None], y[None], variance)
    chosen = [(int(c), float(w)) for c, w in zip(columns[0], weights[0], strict=True) if c >= 0 and w != 0.0]
    chosen.sort()
    return Line(tuple(c for c, _ in chosen), tuple(w for _, w in chosen), float(intercept[0]))


def fit_samples(
    x: Floats, y: Floats, variance: float, *, centred: bool = False
) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Algorithm 1 on many samples at once.

    Parameters
    ----------
    x, y
        Shapes ``(b, n, d)`` and ``(b, n)``.
    variance
        Of the noise.
    centred
        Whether the centre is taken out already, by weights that the rows carry; there are no intercepts then.

    Returns
    -------
    Chosen columns, shape ``(b, k)``, -1 where fewer were chosen; their weights, likewise, 0 there; intercepts, shape
    ``(b,)``.
    """
    b, n, d = x.shape
    mean_x, mean_y = (np.zeros((b, d)), np.zeros(b)) if centred else (x.mean(axis=1), y.mean(axis=1))
    left = x - mean_x[:, None]
    size = np.abs(x).max(axis=1)
    left[np.abs(left) <= _CONSTANT * np.maximum(size, 1.0)[:, None]] = 0.0
    rest = y - mean_y[:, None]
    length = np.einsum("bnd,bnd->bd", left, left)
    floor = _DEPENDENT**2 * length
    free = length > 0.0
    best = np.full(b, np.inf)
    going = np.ones(b, dtype=np.bool_)
    columns: list[NDArray[np.intp]] = []
    projections: list[Floats] = []
    heights: list[Floats] = []
    every = np.arange(b)
    for taken in range(1, min(n, d) + 1):
        now = np.einsum("bnd,bnd->bd", left, left)
        usable = free & (now > floor)
        if not (usable.any(axis=1) & going).any():
            break
        along = np.einsum("bnd,bn->bd", left, rest)
        gain = np.where(usable, along**2 / np.where(usable, now, 1.0), -1.0)
        pick = gain.argmax(axis=1)
        axis = left[every, :, pick]
        norm = np.einsum("bn,bn->b", axis, axis)
        norm[norm == 0.0] = 1.0
        height = np.einsum("bn,bn->b", axis, rest) / norm
        trial = rest - height[:, None] * axis
        # Of the residuals themselves: what is left of a difference of their squares is rounding, far above S.
        after = np.einsum("bn,bn->b", trial, trial)
        cp = after / variance - n + 2.0 * taken
        going &= usable[every, pick] & (cp < best)
        if not going.any():
            break
        axis = np.where(going[:, None], axis, 0.0)
        height = np.where(going, height, 0.0)
        project = np.einsum("bn,bnd->bd", axis, left) / norm[:, None]
        columns.append(np.where(going, pick, -1))
        projections.append(project)
        heights.append(height)
        rest = np.where(going[:, None], trial, rest)
        best = np.where(going, cp, best)
        left = left - axis[:, :, None] * project[:, None]
        free[every[going], pick[going]] = False
    if not columns:
        return np.full((b, 0), -1, dtype=np.intp), np.zeros((b, 0)), mean_y
    chosen = np.stack(columns, axis=1)
    weights = np.zeros(chosen.shape)
    for k in reversed(range(len(columns))):  # undo the orthogonalisation
        total = heights[k].copy()
        for later in range(k + 1, len(columns)):
            at = np.maximum(chosen[:, later], 0)
            total -= projections[k][every, at] * weights[:, later]
        weights[:, k] = np.where(chosen[:, k] >= 0, total, 0.0)
    used = np.where(chosen >= 0, mean_x[every[:, None], np.maximum(chosen, 0)], 0.0)
    intercept = mean_y - (weights * used).sum(axis=1)
    intercept[np.abs(intercept) < 0.01 * variance**0.5] = 0.0
    return chosen, weights, intercept
