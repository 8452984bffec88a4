"""Random sampling and consensus, many samples at a time (§3.2.2).

Each draw fits a sparse function to a handful of rows by forward selection; a draw whose rows are reproduced
with degrees of freedom to spare is *verified* and its inliers among all rows are counted. All draws are made
as one batch of array operations.

Deviation from the thesis
-------------------------
The thesis fits every sample and counts; with N=2000 draws of 6 rows it never finds a mode that makes up a
fifth of the noise. Exact data verify themselves, so small samples (terms + 3 rows) and many draws find what
large samples can't, and a draw that doesn't reproduce its own rows costs no counting.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum, auto
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import (
    ALIKE,
    CACHED,
    CALL,
    ENOUGH,
    EXTRAPOLATED,
    LITTLE,
    ROUNDED,
    ROUNDS,
    SAMPLES_ALIKE,
    SAMPLES_TRIED,
    STDS,
    WIDE,
)
from relgym.numeric.stepwise import (
    LinearFit,
    choosing_cells,
    eliminate_backward,
    equal_gains,
    fitting_cells,
    least_squares,
    varying_columns,
)
from relgym.scheduling.work import Steps, resumable

__all__ = ["Consensus", "choose_columns", "consensus", "draw_samples", "extrapolated", "refine"]


class _Style(IntEnum):
    """Where a sample's rows come from but for the first: anywhere, its stratum, or the rows nearest to it in time."""

    ANYWHERE = auto()
    STRATUM = auto()
    TIME = auto()


@dataclass(frozen=True, slots=True)
class Consensus:
    """A function and the rows it explains: boolean array of shape ``(n,)``."""

    fit: LinearFit
    inliers: NDArray[np.bool_]

    @property
    def size(self) -> int:
        """Number of inliers."""
        return int(self.inliers.sum())


@resumable
def draw_samples(
    n: int,
    size: int,
    draws: int,
    *,
    rng: np.random.Generator,
    strata: NDArray[np.integer] | None = None,
    apart: NDArray[np.integer] | None = None,
    anchors: NDArray[np.intp] | None = None,
) -> Steps[NDArray[np.intp]]:
    """Row numbers of `draws` samples of `size` distinct rows, shape ``(draws, size)``; of few rows every sample once.

    The first row of each sample comes from `anchors` (default: any row). A third of the samples takes the
    others from anywhere, a third from the first row's stratum, a third from the rows nearest to it in time:
    contiguous examples and examples in the same relational state tend to share a mode (§3.2.3). Where a state has too
    few rows for a sample, those of the most similar states follow, if `apart` says how far states are apart, shape
    ``(n, n)``: among many objects hardly two rows are in the same one.
    """
    every = _every_sample(n, size, draws, anchors)
    if every is not None:
        return every
    first = rng.choice(anchors if anchors is not None else np.arange(n), size=draws)
    style = np.resize(list(_Style), draws)
    found = np.empty((draws, min(size, n)), dtype=np.intp)
    for part in _pieces(draws, CACHED, n):
        base, how = first[part], style[part]
        keys = rng.random((len(base), n))
        if strata is not None:
            alike = np.flatnonzero(how == _Style.STRATUM)
            own = base[alike]
            other = strata[None, :] != strata[own][:, None]
            further = 2.0 * other
            if apart is not None:
                few = n - other.sum(axis=1) < size
                further[few] = np.where(other[few], 1.0 + apart[own[few]], 0.0)
            keys[alike] += further
        near = np.flatnonzero(how == _Style.TIME)
        keys[near] += np.abs(np.arange(n)[None, :] - base[near][:, None]) // (2 * size)
        keys[np.arange(len(base)), base] = -1.0
        found[part] = np.argpartition(keys, min(size, n) - 1, axis=1)[:, :size]
        yield 2 * len(base) * n
    yield CALL
    return found


def _every_sample(n: int, size: int, draws: int, anchors: NDArray[np.intp] | None) -> NDArray[np.intp] | None:
    """Each sample of distinct rows, behind each anchor, once; None if there are more than `draws`, or none."""
    starts = [()] if anchors is None else [(int(row),) for row in anchors]
    rest = size - len(starts[0])
    if not 0 < len(starts) * comb(n - len(starts[0]), rest) <= draws:
        return None
    others = ([row for row in range(n) if row not in start] for start in starts)
    samples = [
        (*start, *more)
        for start, left in zip(starts, others, strict=True)
        for more in combinations(left, rest)
    ]
    return np.array(samples, dtype=np.intp)


def extrapolated(y: NDArray[np.float64], sigma: float, *, misfit: bool) -> float:
    """Standard deviations within which all rows may lie of a function through a few of them, at first.

    Not so many, where there is noise, that they tell nothing: no more than a little of the responses' spread.
    """
    return EXTRAPOLATED if misfit else min(EXTRAPOLATED, max(STDS, LITTLE * float(np.ptp(y)) / sigma))


@resumable
def consensus(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    sigma: float,
    tolerance: float,
    terms: int,
    size: int,
    draws: int,
    rng: np.random.Generator,
    strata: NDArray[np.integer] | None = None,
    apart: NDArray[np.integer] | None = None,
    anchors: NDArray[np.intp] | None = None,
    limit: int = SAMPLES_TRIED,
    misfit: bool = False,
) -> Steps[Consensus | None]:
    """The function with the largest consensus among random samples; None if no sample verified itself.

    Parameters
    ----------
    x, y
        Rows of shape ``(n, d)`` and responses of shape ``(n,)``; columns in order of preference.
    sigma, tolerance
        Noise on y and largest residual of an inlier, in units of y.
    terms
        Largest number of weights in a sample's function.
    size
        Rows in a sample; at least ``terms + 2``, so that one degree of freedom verifies the fit.
    draws
        Number of samples.
    strata, apart, anchors
        See `draw_samples`.
    limit
        Most samples that are tried on all rows.
    misfit
        Whether sigma is what an approximation leaves rather than noise.

    Notes
    -----
    Cost O(draws * size * d * terms) plus O(n) for every verified sample.
    """
    n = len(y)
    if n < size:
        return None
    loose = extrapolated(y, sigma, misfit=misfit)
    columns = varying_columns(x)
    samples = yield from draw_samples.steps(
        n, size, draws, rng=rng, strata=strata, apart=apart, anchors=anchors
    )
    chosen = yield from _forward_batch(x[:, columns], y, samples, terms=terms, sigma=sigma, loose=loose)
    best: Consensus | None = None
    tried: set[tuple[tuple[int, ...], bytes]] = set()  # what is refined depends on columns and inliers alone
    told: dict[tuple[int, ...], list[NDArray[np.bool_]]] = {}  # inliers of functions, by columns
    for sample, picked in _distinct(samples, chosen, limit):
        names = tuple(int(columns[c]) for c in picked)
        known = told.setdefault(names, [])
        if any(inliers[sample].all() for inliers in known):
            continue  # it would tell the same function again
        fit = least_squares(x[sample], y[sample], names)
        found = Consensus(fit, np.abs(y - fit.predict(x)) <= loose * tolerance)
        known.append(found.inliers)
        key = (fit.columns, found.inliers.tobytes())
        if best is None or (found.size, -found.fit.terms) > (best.size, -best.fit.terms):
            if key not in tried:
                tried.add(key)
                best = yield from refine.steps(x, y, found, sigma=sigma, tolerance=tolerance)
        yield CALL + n * len(picked)
    return best


@resumable
def refine(
    x: NDArray[np.float64], y: NDArray[np.float64], found: Consensus, *, sigma: float, tolerance: float
) -> Steps[Consensus]:
    """Refit on the inliers, drop needless terms and count again until nothing changes; at most `ROUNDS` rounds."""
    for round_ in range(ROUNDS):
        if found.size <= len(found.fit.columns) + 1:
            return Consensus(found.fit, np.zeros(len(y), dtype=bool))
        fit = least_squares(x[found.inliers], y[found.inliers], found.fit.columns)
        yield fitting_cells(found.size, fit.terms)
        fit = yield from eliminate_backward.steps(x[found.inliers], y[found.inliers], fit, sigma=sigma)
        inliers = np.abs(y - fit.predict(x)) <= tolerance
        same = bool((inliers == found.inliers).all())
        found = Consensus(fit, inliers)
        if same and round_:
            break
    return found


def _forward_batch(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    samples: NDArray[np.intp],
    *,
    terms: int,
    sigma: float,
    loose: float,
) -> Steps[NDArray[np.intp]]:
    """Columns chosen for each sample, ``(draws, terms)``: -1 where none, -2 in front if not verified."""
    draws, size = samples.shape
    enough = size * (loose * sigma) ** 2
    choose = _choose_among_many if x.shape[1] > WIDE else choose_columns
    every = np.empty((draws, max(terms, 1)), dtype=np.intp)
    for part in _pieces(draws, CACHED, size * x.shape[1]):
        a, b = x[samples[part].T], y[samples[part]]
        a -= a.mean(axis=0)
        chosen, left = choose(a, b - b.mean(axis=1, keepdims=True), terms, sigma, enough)
        chosen[left > enough, 0] = -2
        every[part] = chosen
        yield choosing_cells(a.size, terms)
    return every


def choose_columns(
    a: NDArray[np.float64], residual: NDArray[np.float64], terms: int, sigma: float, enough: float
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Columns for each sample, ``(draws, terms)``, and what they leave; what is chosen is swept out of all others.

    `a` has the shape ``(size, draws, d)``, for sums over a sample's rows are of long vectors then; `residual` has
    ``(draws, size)``.
    """
    _, draws, d = a.shape
    sizes = pivots = np.add.reduce(np.square(a), axis=0)
    chosen = np.full((draws, max(terms, 1)), -1, dtype=np.intp)
    across: NDArray[np.float64] | None = None  # what was chosen last, and isn't swept out of the others yet
    for t in range(min(terms, d)):
        left = np.add.reduce(np.square(residual), axis=1)
        open_ = left > enough
        if not open_.any():
            break
        if across is not None:
            a -= across * np.add.reduce(across * a, axis=0)
            pivots = np.add.reduce(np.square(a), axis=0)
        usable = (pivots > ROUNDED**2 * sizes) & (sizes > 0.0)
        along = np.add.reduce(a * residual.T[:, :, None], axis=0)
        gains = np.square(along) / np.where(usable, pivots, np.inf)
        best, found = _best_columns(gains, usable, left, len(a) * sigma**2)
        take = open_ & found
        chosen[take, t] = best[take]
        q = np.where(take[:, None], a[:, np.arange(draws), best].T, 0.0)
        length = np.sqrt(np.add.reduce(np.square(q), axis=1))
        q /= np.where(length > 0.0, length, 1.0)[:, None]
        residual = residual - np.add.reduce(q * residual, axis=1)[:, None] * q
        across = np.ascontiguousarray(q.T)[:, :, None]
    return chosen, np.add.reduce(np.square(residual), axis=1)


def _choose_among_many(
    a: NDArray[np.float64], residual: NDArray[np.float64], terms: int, sigma: float, enough: float
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """The same at a fraction of the cost, a little less exact: see `relgym.numeric.stepwise`."""
    a = np.ascontiguousarray(a.swapaxes(0, 1))
    draws, size, _ = a.shape
    sizes = np.einsum("dij,dij->dj", a, a)
    pivots, basis = sizes.copy(), list[NDArray[np.float64]]()
    chosen = np.full((draws, max(terms, 1)), -1, dtype=np.intp)
    for t in range(terms):
        left = np.square(residual).sum(axis=1)
        open_ = left > enough
        if not open_.any():
            break
        usable = (pivots > ALIKE**2 * sizes) & (sizes > 0.0)
        gains = np.square(np.einsum("di,dij->dj", residual, a)) / np.where(usable, pivots, np.inf)
        best, found = _best_columns(gains, usable, left, size * sigma**2)
        take = open_ & found
        chosen[take, t] = best[take]
        q = np.where(take[:, None], a[np.arange(draws), :, best], 0.0)
        for other in (*basis, *basis):
            q -= (other * q).sum(axis=1)[:, None] * other
        length = np.sqrt(np.square(q).sum(axis=1))
        basis.append(q / np.where(length > 0.0, length, 1.0)[:, None])
        residual = residual - (basis[-1] * residual).sum(axis=1)[:, None] * basis[-1]
        pivots -= np.square(np.einsum("di,dij->dj", basis[-1], a))
        pivots[take, best[take]] = 0.0
    return chosen, np.square(residual).sum(axis=1)


def _best_columns(
    gains: NDArray[np.float64], usable: NDArray[np.bool_], left: NDArray[np.float64], floor: float
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """The earliest of each sample's best columns, and whether there is any."""
    best = gains.max(axis=1)
    slack = equal_gains(np.full(len(left), floor), left)
    return np.argmax(usable & (gains >= (best - slack)[:, None]), axis=1), best > 0.0


def _pieces(count: int, room: int, cells: int) -> Iterator[slice]:
    """Slices of so many samples, each of as many as there is room for with so many cells, but of `ENOUGH` at least."""
    step = max(ENOUGH, room // max(1, cells))
    return (slice(begin, begin + step) for begin in range(0, count, step))


def _distinct(
    samples: NDArray[np.intp], chosen: NDArray[np.intp], limit: int
) -> list[tuple[NDArray[np.intp], list[int]]]:
    """Verified samples with their columns: fewest terms first, at most `limit`, few per set of columns."""
    kept: list[tuple[NDArray[np.intp], list[int]]] = []
    seen: dict[tuple[int, ...], int] = {}
    verified = np.flatnonzero(chosen[:, 0] != -2)
    order = verified[np.argsort((chosen[verified] >= 0).sum(axis=1), kind="stable")]
    for i, columns in zip(order.tolist(), chosen[order].tolist(), strict=True):
        picked = sorted(c for c in columns if c >= 0)
        key = tuple(picked)
        seen[key] = seen.get(key, 0) + 1
        if seen[key] <= SAMPLES_ALIKE:
            kept.append((samples[i], picked))
        if len(kept) >= limit:
            break
    return kept
