"""Finding a new mode among the noise (§3.2.2), and evaluating whether data identify a function.

*Tangents are no laws.* A function with nearly as many near misses as examples, or whose residuals are alike between
neighbours, is refused (`relgym.clustering.discovery.is_law`). So a curve stays unexplained instead of falling apart
into false laws. It may be a law that lacks a term: of ``x' = x + 0.2 vx + 0.06 vx_change`` a few rows don't show the
last one, which is within what the extrapolation of any few rows is allowed. So regression on its near misses, nearer
and nearer ones, looks for more terms, and what comes out is tested as any function is.

*Similar states.* A third of RANSAC's samples is drawn from one relational state (§3.2.3). Among many objects hardly
two rows are in the same one; then rows of the most similar states follow, by the number of facts in which they
differ. With a bystander beside three pushed boxes all laws of the truck are found in 250 steps, which took some seeds
a thousand.

*Counts.* Targets of a few whole multiples of one step (pixels, cells) are searched for functions of the present value
alone first, constants among them; others need 40 examples, since a few small numbers add up to another by chance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.exchange import readings
from relgym.config import ClusteringConfig
from relgym.config.constants import (
    ACTING,
    ALIKE,
    CALL,
    EXACT,
    EXTRAPOLATED,
    FEW_VALUES,
    FEWEST,
    FOUNDING,
    MAJORITY,
    MOST_ROWS,
    ROUGH,
    ROUNDED,
    SAMPLES_ALIKE,
    SAMPLES_TRIED,
    SCENE_ROWS,
    SEARCHED_ROWS,
    SELDOM,
    TOLD,
    VERIFYING,
    WIDE,
)
from relgym.numeric.ransac import Consensus, consensus, extrapolated, refine
from relgym.numeric.stepwise import (
    LinearFit,
    eliminate_backward,
    fitting_cells,
    forward_stepwise,
    least_squares,
    varying_columns,
    with_unit,
)
from relgym.scheduling.work import Steps, resumable

__all__ = [
    "Scale",
    "find_mode",
    "identified",
    "law_cells",
    "least_examples",
    "plans",
    "searched",
    "simplest",
    "verifying_bits",
]


@dataclass(frozen=True, slots=True)
class Scale:
    """Noise of a target and the tolerances that follow from it, in units of the target.

    Attributes
    ----------
    sigma
        Standard deviation.
    inlier_stds, tail_stds
        Tolerances, in standard deviations.
    misfit
        Whether it is what an approximation leaves rather than noise: then neighbours err alike, and that many rows say
        a little each proves nothing.
    """

    sigma: float
    inlier_stds: float
    tail_stds: float
    misfit: bool = False

    @property
    def tolerance(self) -> float:
        """Largest residual of an example that a function explains."""
        return self.inlier_stds * self.sigma

    @property
    def near(self) -> float:
        """Residual up to which an example is a near miss: what the extrapolation of any few rows is allowed."""
        return EXTRAPOLATED * self.sigma

    @property
    def surprising(self) -> float:
        """Residual up to which one mode explains an example as well as another: two standard deviations."""
        return 2.0 * self.sigma

    @property
    def tail(self) -> float:
        """Residual up to which an unexplained example may be a known mode's tail."""
        return self.tail_stds * self.sigma


def least_examples(
    y: NDArray[np.float64], scale: Scale, config: ClusteringConfig, *, choices: int = 1
) -> int:
    """T: examples that found a mode, from the number of bits by which each verifies the function.

    Where each may be read in so many ways, that takes as many bits as it takes to name one.
    """
    if config.min_examples != "auto":
        return int(config.min_examples)
    bits = verifying_bits(y, scale) - math.log2(choices)
    share, (exact, noisy) = min(max(2.0 - 2.0 * bits / EXACT, 0.0), 1.0), FOUNDING
    return round(exact + (noisy - exact) * share)


def verifying_bits(y: NDArray[np.float64], scale: Scale) -> float:
    """Bits of evidence that an example which fits a function gives for it: those that tell its value from all seen."""
    spread = float(np.ptp(y)) if len(y) else 0.0
    return math.log2(max(spread / scale.tolerance, 2.0))


def counts(y: NDArray[np.float64], scale: Scale, most: int = FEW_VALUES) -> bool:
    """Whether a target's latest values are at most so many whole multiples of one step: one that fits says little."""
    values = np.unique(y[-MOST_ROWS:])
    if not 2 < len(values) <= most:
        return False
    steps = np.diff(values)
    if not steps.min() > TOLD * scale.tolerance:
        return False
    ratio = steps / steps.min()
    return bool(np.abs(ratio - np.round(ratio)).max() < ALIKE)


@resumable
def find_mode(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    strata: NDArray[np.integer],
    *,
    stages: tuple[int, ...],
    fresh: int,
    scale: Scale,
    config: ClusteringConfig,
    rng: np.random.Generator,
    needed: int | None = None,
    counting: bool = False,
    rows: NDArray[np.intp] | None = None,
    apart: NDArray[np.integer] | None = None,
    orders: NDArray[np.intp] | None = None,
    present: int | None = None,
) -> Steps[Consensus | None]:
    """Search rows of one slot signature for a function that enough of them obey.

    Parameters
    ----------
    x, y, strata
        Rows ``(n, d)`` with columns in order of preference, responses and relational states, oldest first.
    stages
        Numbers of leading columns that are tried together, ascending: a law of the object's own state needs
        smaller samples and is the simpler law.
    fresh
        Number of rows at the end that no earlier search has seen: each sample holds one of them.
    needed
        Examples that found a mode; default: `least_examples` of these responses.
    counting
        Whether the target counts something (`counts`).
    rows
        Those that are searched; default: `searched`.
    apart
        In how many facts the relational states of these rows differ, shape ``(rows, rows)``, for states with few rows.
    orders
        Orders in which objects may stand (`relgym.clustering.exchange`); where there are any, functions in which these
        have a say are looked for in all of them, too. What such a one explains, it explains in the order that suits.
    present
        The column of the property's present value: that nothing changes is found where it takes fewer bits.
    """
    needed = least_examples(y, scale, config) if needed is None else needed
    rows = searched(len(y), fresh, rng) if rows is None else rows
    # Of what counts, functions of the present value alone are tried first, and others need as many examples as through
    # noise: that a few small numbers add up to another one says little.
    simple = [(1, 1, FEWEST)] if counting else []
    completed = 0  # columns among which terms that were missing have been looked for
    for number, (columns, terms, size) in enumerate([*simple, *plans(stages, config)]):
        if simple and number:
            needed = max(needed, max(FOUNDING))
        if len(rows) < max(needed, size):
            continue
        found = yield from consensus.steps(
            x[rows][:, :columns],
            y[rows],
            sigma=scale.sigma,
            tolerance=scale.tolerance,
            terms=terms,
            size=size,
            draws=max(
                SAMPLES_TRIED,
                config.draws // SELDOM ** (0 if columns == stages[0] else 1 + (columns > WIDE)),
            ),
            rng=rng,
            strata=strata[rows],
            apart=apart,
            anchors=np.flatnonzero(rows >= len(y) - fresh),
            limit=SAMPLES_TRIED if columns <= WIDE else SAMPLES_ALIKE,
            misfit=scale.misfit,
        )
        if found is not None and found.size >= FEWEST:
            found = yield from identified.steps(x, y, found.fit, scale=scale, support=config.support)
            if found is not None and found.size >= needed:
                lacking = number >= len(simple) and columns > completed
                completed = columns if lacking else completed
                part = rows if lacking else None
                told = yield from _law_of(x, y, found, part, columns, stages[0], needed, scale, config)
                if told is not None:
                    return told if present is None else simplest(x, y, told, present, scale)
        if orders is not None and stages[0] < columns <= WIDE:
            fresher = int((rows >= len(y) - fresh).sum())
            found = yield from _in_any_order(
                x[rows][:, :columns],
                y[rows],
                orders[:, :columns],
                own=stages[0],
                fresh=fresher,
                terms=terms,
                needed=needed,
                scale=scale,
                config=config,
                rng=rng,
            )
            if found is not None:
                inliers = np.zeros(len(y), dtype=np.bool_)
                inliers[rows] = found.inliers
                return Consensus(found.fit, inliers)
    return None


def simplest(
    x: NDArray[np.float64], y: NDArray[np.float64], found: Consensus, present: int, scale: Scale
) -> Consensus:
    """A function, or that nothing changes if that takes fewer bits: it has no number that must be told.

    Told of a function are its numbers, the values of the rows that it doesn't explain while the other one does, and
    what both leave of the others; each number and each value in so many bits as it takes to tell values apart. So of a
    flag that was set once, when another one was set, it isn't said that it is the other one.

    Parameters
    ----------
    x, y, found
        All rows, and the function with those it explains.
    present
        The column of the property's present value.
    scale
        Noise and tolerances.
    """
    found = _counting_from(x, y, found, present, scale)
    stays = np.abs(y - x[:, present]) <= scale.tolerance
    both, bits = stays & found.inliers, verifying_bits(y, scale)
    left = np.square(y[both] - found.fit.predict(x[both])) - np.square(y[both] - x[both, present])
    noise = float(left.sum()) / (2.0 * math.log(2.0) * scale.sigma**2)
    numbers = len(found.fit.weights) + (found.fit.intercept != 0.0)
    saved = bits * (numbers + int(stays.sum()) - found.size) + noise
    if saved > 0.0 or (saved == 0.0 and numbers):
        return Consensus(LinearFit((present,), (1.0,), 0.0, 0.0), stays)
    return found


def _counting_from(
    x: NDArray[np.float64], y: NDArray[np.float64], found: Consensus, present: int, scale: Scale
) -> Consensus:
    """A function whose weight of the present value is 1 but for rounding, with a weight of 1 if it explains as much.

    What the weight is off by stands for something that isn't said: of a clock that is far from 0, what a step takes.
    """
    weights = dict(zip(found.fit.columns, found.fit.weights, strict=True))
    if not 0.0 < abs(weights.pop(present, 1.0) - 1.0) <= ROUNDED:
        return found
    rows = found.inliers
    others = tuple(c - (c > present) for c in weights)
    left, rest = np.delete(x[rows], present, axis=1), y[rows] - x[rows, present]
    fit = eliminate_backward(left, rest, least_squares(left, rest, others), sigma=scale.sigma)
    if fit.terms > found.fit.terms:
        return found
    fit = with_unit(fit, present)
    explained = np.abs(y - fit.predict(x)) <= scale.tolerance
    return Consensus(fit, explained) if explained.sum() >= found.size else found


def _law_of(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    found: Consensus,
    rows: NDArray[np.intp] | None,
    columns: int,
    own: int,
    needed: int,
    scale: Scale,
    config: ClusteringConfig,
) -> Steps[Consensus | None]:
    """A function that is a law of enough rows, or becomes one with terms that it lacks, sought in `rows`."""
    yield law_cells(found, own)
    if is_law(x, y, found, own, scale):
        return found
    if rows is None:
        return None
    fit = yield from _complete(x[rows][:, :columns], y[rows], found.fit, scale=scale, terms=config.max_terms)
    more = yield from identified.steps(x, y, fit, scale=scale, support=config.support)
    return more if more is not None and more.size >= needed and is_law(x, y, more, own, scale) else None


def _in_any_order(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    orders: NDArray[np.intp],
    *,
    own: int,
    fresh: int,
    terms: int,
    needed: int,
    scale: Scale,
    config: ClusteringConfig,
    rng: np.random.Generator,
) -> Steps[Consensus | None]:
    """A function that enough rows obey, each in the order of its objects that suits (`relgym.clustering.exchange`)."""
    loose = extrapolated(y, scale.sigma, misfit=scale.misfit)
    for reading in readings(x, orders):
        least = max(needed, least_examples(y, scale, config, choices=len(reading.orders)))
        fits = yield from reading.candidates(
            y,
            sigma=scale.sigma,
            loose=loose,
            terms=terms,
            draws=config.draws // SELDOM,
            fresh=fresh,
            rng=rng,
        )
        for fit in fits:
            read = reading.best(fit, y, scale.sigma)
            near = np.abs(y - fit.predict(read)) <= loose * scale.tolerance
            yield CALL + 2 * reading.x.size * len(reading.orders)
            if near.sum() < least:
                continue
            fit = least_squares(read[near], y[near], fit.columns, intercept=False)
            read = reading.best(fit, y, scale.sigma)  # what is fitted to more rows may suit in another order
            found = yield from identified.steps(read, y, fit, scale=scale, support=config.support)
            if found is not None and found.size >= least and is_law(read, y, found, own, scale):
                return Consensus(reading.written_out(found.fit), found.inliers)
    return None


def _complete(
    x: NDArray[np.float64], y: NDArray[np.float64], fit: LinearFit, *, scale: Scale, terms: int
) -> Steps[LinearFit]:
    """A function with the small terms that another one lacks, from rows that it misses by less and less.

    A few rows don't show a term that is small beside their function's: what they leave of it is within what the
    extrapolation of any function of so few rows is allowed. It makes near misses of the others.
    """
    reach = scale.near
    while True:
        near = np.abs(y - fit.predict(x)) <= reach
        if near.sum() <= terms + 1:
            return fit
        fit = yield from forward_stepwise.steps(x[near], y[near], sigma=scale.sigma, max_terms=terms)
        if reach <= scale.tolerance:
            return fit
        reach = max(reach / 2.0, scale.tolerance)


def is_law(x: NDArray[np.float64], y: NDArray[np.float64], found: Consensus, own: int, scale: Scale) -> bool:
    """Whether a function is a law of some rows rather than the tangent of a curve.

    Two things give a tangent away. Where it stops to fit within the tolerance, errors grow little by little, so that
    it has nearly as many near misses as examples; laws of different kinds of behaviour leave a gap. And what it leaves
    of its examples is no noise: rows that lie close together have like residuals.

    Parameters
    ----------
    x, y, found
        All rows, and the function with those it explains.
    own
        Number of leading columns that say how close rows lie: those of the target and of bodiless objects.
    scale
        Noise and tolerances.
    """
    error = np.abs(y - found.fit.predict(x))
    near = (error > scale.tail) & (error <= scale.near)
    if int(near.sum()) > MAJORITY * found.size:
        return False
    rows = np.flatnonzero(found.inliers)
    left = y[rows] - found.fit.predict(x[rows])
    if float(np.sqrt(np.square(left).mean())) * ROUGH <= scale.sigma:
        return True
    return likeness(x[rows][:, :own], left) <= MAJORITY


def likeness(x: NDArray[np.float64], left: NDArray[np.float64]) -> float:
    """Correlation of residuals between rows that lie next to each other: 0 for noise, 1 for a smooth rest.

    Parameters
    ----------
    x, left
        Rows ``(n, d)`` and residuals ``(n,)``; at most `SEARCHED_ROWS` of them, evenly spread, are looked at.
    """
    if len(left) < 2:
        return 0.0
    pick = np.unique(np.linspace(0, len(left) - 1, SEARCHED_ROWS).astype(np.intp))
    columns = varying_columns(x[pick])
    if not len(columns):
        return 0.0
    scaled = x[pick][:, columns]
    scaled = scaled / scaled.std(axis=0)
    distance = np.diag(np.full(len(pick), np.inf))
    for column in scaled.T:  # one by one: all at once are as many such matrices
        distance += np.square(column[:, None] - column)
    rest = left[pick] - left[pick].mean()
    variance = float(np.square(rest).mean())
    return float((rest * rest[distance.argmin(axis=1)]).mean()) / variance if variance > 0.0 else 0.0


def plans(stages: tuple[int, ...], config: ClusteringConfig) -> list[tuple[int, int, int]]:
    """(columns, terms, sample size) of the searches, cheapest first."""
    found = []
    most, half = config.max_terms, config.max_terms // 2
    for width in stages[:1] if config.own_only else stages:
        if width > WIDE:
            # Among so many columns a small sample finds some that fit it by chance; no constant does.
            found += [(width, 0, FEWEST)] if width == stages[0] else []
            found += [(width, terms, FEWEST * (terms + VERIFYING)) for terms in (half, most)]
            continue
        if width + 1 + VERIFYING < min(FOUNDING):  # few enough to fit them all and drop what is needless
            found.append((width, min(width, most), min(width, most) + 1 + VERIFYING))
        else:
            found.append((width, min(2, most), 2 + 1 + VERIFYING))  # two weights and a constant
            found += [(width, terms, terms * (1 + VERIFYING)) for terms in (half, most) if terms > 2]
    return found


def searched(n: int, fresh: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """The rows that are searched of so many: the newest and a random choice of older ones, ascending."""
    if n <= SEARCHED_ROWS:
        return np.arange(n)
    # Fresh ones may outnumber the rows: some of them have become a mode's tail in the meantime. And of very many, as
    # where nothing is ever found, the newest are enough.
    newest = np.arange(max(n - min(max(fresh, SEARCHED_ROWS // 2), SEARCHED_ROWS), 0), n)
    older = (
        rng.choice(newest[0], size=min(int(newest[0]), SEARCHED_ROWS // 2), replace=False)
        if newest[0]
        else newest[:0]
    )
    return np.concatenate([np.sort(older), newest])


def law_cells(found: Consensus, own: int) -> int:
    """What `is_law` costs, in cells."""
    return CALL + 2 * own * min(found.size, SEARCHED_ROWS) ** 2


@resumable
def identified(
    x: NDArray[np.float64], y: NDArray[np.float64], fit: LinearFit, *, scale: Scale, support: int
) -> Steps[Consensus | None]:
    """The part of a function that its inliers really determine, with those inliers; None if nothing is left.

    Two things are refused. A weight that fewer than `support` examples determine (a leverage point fixes it
    at nonsense). Weights on columns that take few distinct values, when there are too few of those to tell a
    law from a look-up of per-scene constants: k such columns need 2 k + 2 distinct combinations; of a combination that
    most rows have, the function without these columns is left. And a function of as many numbers as there are values
    to be told is a table of constants, of which the commonest is left.
    """
    for _ in range(len(fit.columns) + 2):
        found = yield from refine.steps(
            x,
            y,
            Consensus(fit, np.abs(y - fit.predict(x)) <= scale.tolerance),
            sigma=scale.sigma,
            tolerance=scale.tolerance,
        )
        rows = np.flatnonzero(found.inliers)
        if len(rows) < FEWEST:
            return None
        weak, kept = yield from _unsupported(x[rows], found.fit, scale, support)
        if weak is None:
            part = rows[_commonest(x[rows], found.fit)]
            if len(part):
                fit = least_squares(x[part], y[part], ())
                continue
            few = _unverified(x[rows], y[rows], found.fit, scale.tolerance)
            if not few:
                return None if _tabulated(x[rows], y[rows], found.fit, scale.tolerance) else found
            part = rows[_mostly(x[rows][:, few])]
            if len(part) <= MAJORITY * len(y):
                return None
            others = tuple(c for c in found.fit.columns if c not in few)
            fit = least_squares(x[part], y[part], others)
            continue
        columns = tuple(c for c in found.fit.columns if c != weak)
        fit = least_squares(x[rows[kept]], y[rows[kept]], columns)
    return None


def _persists(fit: LinearFit) -> bool:
    """Whether it says that something keeps its value, which takes no number."""
    return fit.terms == 1 and bool(fit.weights) and abs(fit.weights[0] - 1.0) < ROUNDED


def _commonest(x: NDArray[np.float64], fit: LinearFit) -> NDArray[np.intp]:
    """Of a table of constants the rows of its commonest case; of other functions none."""
    if not fit.weights or _persists(fit):
        return np.empty(0, dtype=np.intp)
    cases, which, counts = np.unique(x[:, list(fit.columns)], axis=0, return_inverse=True, return_counts=True)
    table = len(cases) <= len(fit.weights) + (fit.intercept != 0.0)
    return np.flatnonzero(which.reshape(-1) == counts.argmax()) if table else np.empty(0, dtype=np.intp)


def _unsupported(
    x: NDArray[np.float64], fit: LinearFit, scale: Scale, support: int
) -> Steps[tuple[int | None, NDArray[np.bool_]]]:
    """A column that fewer than `support` rows determine, and the rows without those; (None, all) if none."""
    everything = np.ones(len(x), dtype=bool)
    for column, weight in zip(fit.columns, fit.weights, strict=True):
        kept = everything.copy()
        for _ in range(support - 1):
            left = _own_part(x[kept], fit, column)
            if len(left) <= len(fit.columns) + 2:
                break
            # Not the largest residual: a row far out in the other columns too draws the regression to itself.
            stake = np.abs(left) / np.maximum(1.0 - _leverage(x[kept], fit, column), ROUNDED)
            kept[np.flatnonzero(kept)[np.argmax(stake)]] = False
        remaining = np.square(weight * _own_part(x[kept], fit, column))
        yield 2 * support * fitting_cells(len(x), len(fit.columns))
        much = (ACTING * scale.tolerance) ** 2
        # Through noise, many rows that say little each determine a weight as well as a few that say much.
        together = remaining.sum() > support * much and remaining.mean() * ROUGH > scale.tolerance**2
        if remaining.max(initial=0.0) <= much and (scale.misfit or not together):
            return column, kept
    return None, everything


def _own_part(x: NDArray[np.float64], fit: LinearFit, column: int) -> NDArray[np.float64]:
    """What of a column the function's other terms don't reproduce."""
    others = tuple(c for c in fit.columns if c != column)
    rest = least_squares(x, x[:, column], others, intercept=fit.intercept != 0.0)
    part: NDArray[np.float64] = x[:, column] - rest.predict(x)
    return part


def _leverage(x: NDArray[np.float64], fit: LinearFit, column: int) -> NDArray[np.float64]:
    """Share of itself that each row decides in a regression on the function's other terms, in [0, 1]."""
    design = x[:, [c for c in fit.columns if c != column]]
    if fit.intercept != 0.0:
        design = np.concatenate([np.ones((len(x), 1)), design], axis=1)
    shares = np.zeros(len(x))
    spanned: list[NDArray[np.float64]] = []
    for own in design.T:
        rest = own
        for other in spanned:  # not LAPACK, whose results may depend on its threads
            rest = rest - np.add.reduce(other * rest) * other
        size = math.sqrt(float(np.add.reduce(rest * rest)))
        if size > ROUNDED * math.sqrt(float(np.add.reduce(own * own))):
            spanned.append(rest / size)
            shares += np.square(spanned[-1])
    return shares


def _lively(column: NDArray[np.float64]) -> bool:
    """Whether a column changes often, as an agent's choice among a few actions does, and is no constant of a scene."""
    return bool((np.diff(column) != 0.0).mean() * SCENE_ROWS >= 1.0)


def verifying_combinations(weights: int, combinations: int, columns: int, told: float) -> int:
    """Combinations of values that must verify weights on them, beside those that fix these.

    By chance one agrees with probability 1 / `told`, what tells responses apart. The columns, and the combinations that
    fix their weights, are chosen in at most ``C(columns, weights) * combinations**weights`` ways. So many must agree
    that less than one of these is expected to get there by chance: one where data are exact, more through noise.
    """
    ways = math.log2(math.comb(columns, weights)) + weights * math.log2(combinations)
    return max(1, math.ceil(ways / math.log2(max(told, 2.0))))


def _mostly(x: NDArray[np.float64]) -> NDArray[np.intp]:
    """Rows of the commonest combination of values."""
    _, which, counts = np.unique(x, axis=0, return_inverse=True, return_counts=True)
    return np.flatnonzero(which.reshape(-1) == counts.argmax())


def _few_valued(x: NDArray[np.float64], fit: LinearFit) -> tuple[list[int], list[int]]:
    """Columns of a function that take few values: those that change often, and those that don't."""
    few = [c for c in fit.columns if len(np.unique(x[:, c])) <= len(x) // SCENE_ROWS]
    lively = [c for c in few if _lively(x[:, c])]
    return lively, [c for c in few if c not in lively]


def _unverified(
    x: NDArray[np.float64], y: NDArray[np.float64], fit: LinearFit, tolerance: float
) -> list[int]:
    """Columns that take too few combinations of values to support their weights; none where all are supported."""
    if _persists(fit):
        return []
    lively, slow = _few_valued(x, fit)
    if len(lively) > 1 and len(np.unique(x[:, lively], axis=0)) < len(lively) + 2:
        return lively
    if not slow:
        return []
    combinations = len(np.unique(x[:, slow], axis=0))
    weight = dict(zip(fit.columns, fit.weights, strict=True))
    part = sum(weight[c] * x[:, c] for c in slow)
    # If every combination contributes another value, each verifies them that weights and a constant don't use up.
    verified = len(np.unique(np.round(part / (TOLD * tolerance))))
    spare = verifying_combinations(len(slow), combinations, x.shape[1], float(np.ptp(y)) / tolerance)
    return slow if combinations < 2 * len(slow) + 2 and verified < len(slow) + 1 + spare else []


def _tabulated(x: NDArray[np.float64], y: NDArray[np.float64], fit: LinearFit, tolerance: float) -> bool:
    """Whether a function of slowly changing columns alone has hardly more values than numbers."""
    if _persists(fit) or not fit.columns:
        return False
    _, slow = _few_valued(x, fit)
    if len(slow) < len(fit.columns) or np.ptp(y) <= tolerance:
        return False
    return len(np.unique(np.round(y / tolerance))) < 2 * fit.terms
