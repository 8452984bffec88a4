"""Random sample consensus: a line that many of some examples fit, the others notwithstanding (§3.2.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.thesis.regression import Line, fit, fit_samples
from relgym.thesis.settings import ThesisSettings

__all__ = ["Consensus", "Union", "search", "varied"]

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

_AT_ONCE = 125
"""Samples that are fitted together."""

_ALARM = 0.05
"""Chance to miss a line of as many inliers as the best known one has, where draws adapt to it."""

_MANY = 500
"""Rows of which so few are drawn that none is looked for twice."""

_VERIFYING = 2
"""How many more values than weights a line's seldom changing columns must have taken together."""

_LEFT_OUT = 0.3
"""Share of the inliers that `_holds` leaves out at a time."""


@dataclass(frozen=True, slots=True)
class Consensus:
    """The best line of a search.

    Attributes
    ----------
    line
        None if no sample gave one.
    inliers
        Which rows fit it, shape ``(n,)``.
    """

    line: Line | None
    inliers: NDArray[np.bool_]

    @property
    def size(self) -> int:
        """How many rows fit."""
        return int(self.inliers.sum())


@dataclass(frozen=True, slots=True)
class Union:
    """What a search for a function of two modes' examples must find (§3.2.5).

    Attributes
    ----------
    old
        How many rows are the first mode's; they come first.
    counted
        Rows that count, shape ``(n,)``.
    ratio
        Least share of those of each mode that fits.
    """

    old: int
    counted: NDArray[np.bool_]
    ratio: float

    def enough(self, fits: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Whether a line does for both; `fits` has shape ``(n, lines)``."""
        shown: NDArray[np.bool_] = np.ones(fits.shape[1], dtype=np.bool_)
        for part in (slice(None, self.old), slice(self.old, None)):
            counted = self.counted[part]
            shown &= fits[part][counted].sum(axis=0) >= math.ceil(self.ratio * int(counted.sum()))
        return shown


def search(
    x: Floats,
    y: Floats,
    settings: ThesisSettings,
    rng: np.random.Generator,
    union: Union | None = None,
) -> Consensus:
    """Draw samples until the line through one fits enough rows, or N were drawn.

    Parameters
    ----------
    x, y
        Rows and responses, shapes ``(n, d)`` and ``(n,)``.
    settings
        T, N, σ and how samples are drawn.
    union
        For unification: a sample takes half of its rows from either mode. Default: T of all rows must fit.

    Notes
    -----
    Cost: N fits of six rows, and N·n products for each regressor.
    """
    n = len(x)
    none = Consensus(None, np.zeros(n, dtype=np.bool_))
    width = settings.sample
    if n < width:
        return none
    varying = np.flatnonzero(np.ptp(x, axis=0) > 1e-15 * np.maximum(np.abs(x).max(axis=0), 1.0))
    if not len(varying):
        varying = np.array([0])
    shown = x[:, varying]
    tolerance = settings.inlier_stds * settings.noise_variance**0.5
    best, draws, done = none, settings.draws, 0
    verified = _Verifier(x)
    while done < draws:
        count = min(_AT_ONCE, draws - done)
        done += count
        samples = _samples(shown, count, union.old if union else 0, settings, rng)
        columns, weights, intercepts = fit_samples(shown[samples], y[samples], settings.noise_variance)
        fits = _inliers(shown, y, columns, weights, intercepts, tolerance)
        sizes = fits.sum(axis=0)
        for k in _promising(sizes, fits, union, best.size, settings):
            line = _line(varying, columns[k], weights[k], float(intercepts[k]))
            found = Consensus(line, fits[:, k])
            if found.size <= best.size:
                continue
            if not verified(found):
                continue
            if union is None and settings.cross_check and not _holds(x, y, found, settings):
                continue
            best = found
            if union is not None or best.size >= settings.min_examples:
                return best
        if settings.adaptive_draws and union is None:
            draws = min(settings.draws, _draws(best.size, n, width))
    return best


def _promising(
    sizes: NDArray[np.int64],
    fits: NDArray[np.bool_],
    union: Union | None,
    best: int,
    settings: ThesisSettings,
) -> list[int]:
    """Samples, in their order, whose line may be better than the best one."""
    if union is not None:
        return [int(k) for k in np.flatnonzero(union.enough(fits))]
    found = []
    for k in np.flatnonzero(sizes > max(best, 2)).tolist():
        if sizes[k] > best or sizes[k] >= settings.min_examples:
            found.append(int(k))
    return found


def _draws(size: int, n: int, width: int) -> int:
    share = (size / n) ** width
    if share >= 1.0:
        return 1
    return 1 + math.ceil(math.log(_ALARM) / math.log1p(-share)) if share > 0.0 else 10**9


def _line(varying: Rows, columns: Rows, weights: Floats, intercept: float) -> Line:
    chosen = sorted(
        (int(varying[c]), float(w)) for c, w in zip(columns, weights, strict=True) if c >= 0 and w != 0.0
    )
    return Line(tuple(c for c, _ in chosen), tuple(w for _, w in chosen), intercept)


def _inliers(
    x: Floats, y: Floats, columns: Rows, weights: Floats, intercepts: Floats, tolerance: float
) -> NDArray[np.bool_]:
    """Which rows fit which lines, shape ``(n, lines)``."""
    dense = np.zeros((x.shape[1], len(intercepts)))
    every = np.arange(len(intercepts))
    for k in range(columns.shape[1]):
        used = columns[:, k] >= 0
        dense[columns[used, k], every[used]] = weights[used, k]
    found: NDArray[np.bool_] = np.abs(x @ dense + intercepts - y[:, None]) <= tolerance
    return found


def _samples(x: Floats, count: int, old: int, settings: ThesisSettings, rng: np.random.Generator) -> Rows:
    """Numbers of the rows in each sample, shape ``(count, width)``."""
    n, width = len(x), settings.sample
    if old:
        half = min(width // 2, n - old)
        first = _drawn(old, min(width - half, old), count, rng)
        return np.concatenate([first, old + _drawn(n - old, half, count, rng)], axis=1)
    if not settings.spread_samples:
        return _drawn(n, width, count, rng)
    return _spread(x, width, count, rng)


def _drawn(n: int, width: int, count: int, rng: np.random.Generator) -> Rows:
    """`count` times `width` of `n` numbers; of very many, one comes twice at times."""
    if n > _MANY:
        return rng.integers(0, n, (count, width))
    return rng.random((count, n)).argsort(axis=1)[:, :width]


def _spread(x: Floats, width: int, count: int, rng: np.random.Generator) -> Rows:
    """The program's samples: column by column a row whose value differs from that of the row before."""
    n, d = x.shape
    every = np.arange(count)
    columns = rng.random((count, d)).argsort(axis=1)
    chosen = np.empty((count, width), dtype=np.intp)
    chosen[:, 0] = rng.integers(0, n, count)
    free = np.ones((count, n), dtype=np.bool_)
    free[every, chosen[:, 0]] = False
    for k in range(1, width):
        keys = np.where(free, rng.random((count, n)), 0.0)
        if k <= d:
            values = x[:, columns[:, k - 1]].T
            keys += free & (values != values[every, chosen[:, k - 1]][:, None])  # 1 more where they differ
        chosen[:, k] = keys.argmax(axis=1)
        free[every, chosen[:, k]] = False
    return chosen


def varied(rows: Floats) -> bool:
    """Whether columns that seldom change took more values together than their weights alone could fit.

    Parameters
    ----------
    rows
        Examples that lie on a line, the line's columns alone, shape ``(n, columns)``.
    """
    values = [len(np.unique(column)) for column in rows.T]
    seldom = [k for k, count in enumerate(values) if count < len(rows) / 2]
    # Together, and each by itself: beside a speed of many values a size of two tells one scene from another.
    if not seldom:
        return True
    if min(values[k] for k in seldom) < 2 + _VERIFYING:
        return False
    return len(np.unique(rows[:, seldom], axis=0)) >= len(seldom) + 1 + _VERIFYING


class _Verifier:
    """`varied` of lines' inliers.

    Of few scenes many samples say the same, and counting values takes longer than the fit: answers are remembered.
    """

    def __init__(self, x: Floats) -> None:
        self._x = x
        self._known: dict[tuple[tuple[int, ...], bytes], bool] = {}

    def __call__(self, found: Consensus) -> bool:
        assert found.line is not None, "only lines are tested"
        key = found.line.columns, found.inliers.tobytes()
        if key not in self._known:
            self._known[key] = varied(self._x[found.inliers][:, list(found.line.columns)])
        return self._known[key]


def _holds(x: Floats, y: Floats, found: Consensus, settings: ThesisSettings) -> bool:
    """The program's test for spurious regressors: no part of the inliers may need more of them than the sample did."""
    assert found.line is not None, "only lines are tested"
    inliers = np.flatnonzero(found.inliers)
    step = max(2, math.ceil(_LEFT_OUT * len(inliers)))
    for start in range(0, len(inliers), step):
        kept = np.delete(inliers, np.s_[start : start + step])
        if len(kept) < 2:
            continue
        if len(fit(x[kept], y[kept], settings.noise_variance).columns) > len(found.line.columns):
            return False
    return True
