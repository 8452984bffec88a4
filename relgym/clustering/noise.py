"""How noisy a target is: a first estimate from the data and their precision.

It is estimated after 64, 256, 1,024, ... examples where most are unexplained, among those with the types of objects
that most of these have, and raised or lowered: windows of the first 64 are four.
"""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import Scale, verifying_bits
from relgym.config.constants import (
    ENOUGH,
    MAJORITY,
    NEARLY_ALL,
    NUMBER_BITS,
    RECENT,
    ROUGH,
    ROUNDED,
    ROUNDINGS,
    SEARCHED_ROWS,
    TOLD,
    VERIFYING,
)
from relgym.numeric.ransac import consensus
from relgym.numeric.stepwise import forward_stepwise, least_squares

__all__ = ["coded_by_a_law", "estimate_noise", "refuted", "rounding_noise"]


def rounding_noise(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    observed: NDArray[np.float64] | None = None,
    *,
    changes: NDArray[np.float64] | None = None,
) -> float:
    """Standard deviation that mere rounding leaves, in units of y.

    Responses that float32 represents exactly are taken to have been rounded to it, as observations are. What counts
    then is their own size: a law's terms are rarely much larger than its value, and where they cancel, the estimate
    from the data says so later. In double precision columns count, too, since the room is there: a term that varies as
    much as y changes carries as many roundings more as its column lies further from 0 than it varies. So the noise
    doesn't depend on the units of columns, nor on what never varies; columns that vary by rounding explain nothing.

    Parameters
    ----------
    x
        The target object's own columns and those of bodiless objects, shape ``(n, d)``.
    y
        Responses, shape ``(m,)``.
    observed
        Those of the columns that are observed, not done, in recent rows, shape ``(k, c)``. Where one that varies was
        rounded to single precision, so were the responses, even if something was worked out from them since (an angle
        from its sine and cosine).
    changes
        By how much the responses differ from the property's values before; default: the responses. What keeps most of
        its value, as a large sum does, owes only these to other columns.
    """
    largest = float(np.abs(y).max(initial=0.0))
    single = 2.0 * float(np.finfo(np.float32).eps)  # of the value before and of the one after
    if bool(_single(y).all()) and bool(np.any(y != np.round(y))):
        return single * max(largest, float(np.finfo(np.float32).tiny))
    if observed is not None and _rounded(observed):
        return single * max(largest, min(float(np.abs(observed).max()), 1.0))
    size = np.abs(x).max(axis=0, initial=0.0)
    varies = np.ptp(x, axis=0) if len(x) else np.zeros_like(size)
    used = varies > ROUNDED * size
    varied = min(float(np.ptp(each)) for each in (y, y if changes is None else changes)) if len(y) else 1.0
    terms = size[used] / varies[used] * varied
    scale = max(float(terms.max(initial=0.0)), largest, ROUNDED)
    return ROUNDINGS * float(np.finfo(np.float64).eps) * scale


def _rounded(rows: NDArray[np.float64]) -> bool:
    """Whether float32 represents all values of some column exactly, and there are enough of them to tell."""
    exact = rows[:, _single(rows).all(axis=0)]
    fractions = exact != np.round(exact)
    # Counted before they are told apart: of wide spaces most columns have none.
    enough = np.flatnonzero(fractions.sum(axis=0) >= ENOUGH)
    return any(len(np.unique(exact[fractions[:, k], k])) >= ENOUGH for k in enough)


def _single(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which values float32 represents exactly."""
    with np.errstate(over="ignore"):  # larger ones than it holds become infinite, and so aren't equal
        found: NDArray[np.bool_] = values.astype(np.float32).astype(np.float64) == values
    return found


def estimate_noise(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    strata: NDArray[np.integer],
    *,
    floor: float,
    own: int = ENOUGH,
) -> float | None:
    """Noise of y about a locally linear function: lower quartile over windows of like examples.

    Consecutive examples in the same relational state mostly share a mode; the spread that a linear function leaves
    in such a window is noise. Windows that straddle a change of mode leave more, hence the lower quartile; it is
    corrected for what a quartile of so many spreads of so few examples falls short by.

    Where the target's own columns leave no more than other objects' could explain away by chance, `ROUGH` times as much
    at most, they make the function. Choosing among many columns finds some that fit the noise, and underrates it.

    Parameters
    ----------
    x
        Columns offered to the local function, in order of preference, shape ``(n, d)``.
    y, strata
        Responses and relational states, shape ``(n,)``.
    floor
        Rounding noise; the estimate is never smaller, and equals it unless it is clearly larger.
    own
        How many of the leading columns are the target's own and bodiless objects'.

    Returns
    -------
    The noise; none where there are too few examples of each relational state to tell.
    """
    windows = _windows(strata)
    if not windows:
        return None
    terms = ENOUGH // (1 + VERIFYING)
    simple = _quartile(
        [_spread(x[part], y[part], tuple(range(min(own, x.shape[1], terms)))) for part in windows]
    )
    sparse = _quartile([_least_spread(x[part], y[part], floor, terms) for part in windows])
    estimate = simple if simple <= ROUGH * sparse else sparse
    return estimate if estimate > ROUGH * floor else floor


def _windows(strata: NDArray[np.integer]) -> list[NDArray[np.intp]]:
    """Runs of `ENOUGH` examples of one stratum, others in between left out; `SEARCHED_ROWS` examples in all at most."""
    found = []
    for stratum in np.unique(strata):
        members = np.flatnonzero(strata == stratum)
        ends = range(ENOUGH, len(members) + 1, ENOUGH)
        found += [members[end - ENOUGH : end] for end in ends]
    found.sort(key=lambda window: int(window[0]))
    return found[:: len(found) // (SEARCHED_ROWS // ENOUGH) + 1]


def _spread(x: NDArray[np.float64], y: NDArray[np.float64], columns: tuple[int, ...]) -> tuple[float, int]:
    """Standard deviation about a linear function of given columns, and its degrees of freedom."""
    fit = least_squares(x, y, columns)
    freedom = len(y) - len(fit.columns) - 1
    return float(np.sqrt(fit.rss / freedom)), freedom


def _least_spread(
    x: NDArray[np.float64], y: NDArray[np.float64], floor: float, terms: int
) -> tuple[float, int]:
    """The same about the best sparse function of any columns."""
    fit = forward_stepwise(x, y, sigma=floor, max_terms=terms, eliminate=False)
    freedom = len(y) - len(fit.columns) - 1
    return float(np.sqrt(fit.rss / freedom)), freedom


def _quartile(spreads: list[tuple[float, int]]) -> float:
    """Standard deviation whose estimates from as many windows would have this lower quartile."""
    values, freedom = [s for s, _ in spreads], float(np.mean([f for _, f in spreads]))
    quarter = 0.5 * MAJORITY  # the median of the smaller half
    share = (quarter * (len(values) - 1) + 0.5) / len(values)
    # Of a chi-square twice the root is nearly normal about sqrt(2 freedom - 1), with a deviation of 1 (Fisher 1922).
    root = math.sqrt(2.0 * freedom - 1.0) + NormalDist().inv_cdf(share)
    return float(np.quantile(values, quarter)) * math.sqrt(2.0 * freedom) / root


def coded_by_a_law(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    scale: Scale,
    estimate: float,
    *,
    draws: int,
    rng: np.random.Generator,
) -> bool:
    """Whether it takes fewer bits that some examples obey a function than that all obey one with more noise.

    Where examples of several functions come by turns, as a gear, a choice or a switch has it, every window holds some
    of each, and what a function leaves there is no noise. Told are, of each example that the function doesn't explain,
    its value among all that were seen; and the function's numbers, and which columns they are of.

    Parameters
    ----------
    x, y
        Examples that no mode explains, with columns in order of preference: shapes ``(n, d)`` and ``(n,)``.
    scale
        The noise as assumed, and its tolerances.
    estimate
        The noise as estimated, in units of y.
    draws, rng
        How many samples are drawn, and what draws them.
    """
    terms = 2
    found = consensus(
        x,
        y,
        sigma=scale.sigma,
        tolerance=scale.tolerance,
        terms=terms,
        size=terms + 1 + VERIFYING,
        draws=draws,
        rng=rng,
    )
    if found is None:
        return False
    numbers = found.fit.terms * NUMBER_BITS + math.log2(math.comb(x.shape[1], len(found.fit.columns)))
    bits = (len(y) - found.size) * verifying_bits(y, scale) + numbers
    return bits < len(y) * math.log2(max(estimate / scale.sigma, 1.0))


def refuted(sigma: float, estimate: float, *, explained: float, y: NDArray[np.float64]) -> bool:
    """Whether an estimate of the noise refutes the one that was assumed.

    Where a good part of the examples is explained, only a noise of the same order does: the others just obey
    no law that is known yet. As long as there are few examples, a noise as large as the signal says nothing.

    Parameters
    ----------
    sigma, estimate
        The noise as assumed and as estimated, in units of y.
    explained
        Share of the examples that modes explain under the assumption.
    y
        All responses, shape ``(n,)``.
    """
    if explained > 1.0 - NEARLY_ALL and estimate > TOLD * sigma:
        return False
    if len(y) < RECENT and estimate > 0.5 * float(y.std()):
        return False
    return estimate > 2.0 * sigma
