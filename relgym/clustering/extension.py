"""Extending a mode by a term that its first examples could not show.

A ball that slides to a ramp's foot has no vertical velocity when it hits the ramp: nineteen such hits say nothing of
how the bounce depends on it. The mode that they found is right where it was found, and too special. Later a hit with a
vertical velocity comes, and no mode explains it; the next such hit confirms the weight that the first one asks for.
Too few to found a mode of their own that could be unified with the first (§3.2.5), they still identify its missing
term, if the data are exact: that two examples ask for the same weight to many digits is no coincidence.

So it is with a *flag*, which is 0 or 1: thousands of steps that end nothing say nothing of what an end is paid for, and
the first few ends do. Since a flag has no third value, its examples need not differ in it; and a weight that it has in
one mode is confirmed by a single example of another. Of a target that is a flag itself, unexplained examples are those
of its other value, and half as many as found a mode are enough.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import counts, least_examples, simplest, verifying_bits
from relgym.clustering.merging import Known
from relgym.clustering.unification import reordered
from relgym.config.constants import ENOUGH, EVIDENCE, EXACT, LITTLE, MOST_ROWS, ROUNDED, SEARCHED_ROWS
from relgym.numeric.ransac import Consensus
from relgym.numeric.stepwise import LinearFit, eliminate_backward, least_squares

__all__ = ["extendable", "extended", "is_flag"]


def extendable(known: Known) -> bool:
    """Whether anything may be extended, whatever is new: an example tells enough, and there is a mode, or a flag."""
    told = verifying_bits(known.y, known.scale) >= 2.0 * EVIDENCE
    return told and (bool(known.clusters) or is_flag(known.y))


def extended(
    known: Known, signature: int, pool: NDArray[np.intp], *, fresh: int, flags: bool = False
) -> LinearFit | None:
    """A known mode's function with one more term, which explains a new example and other unexplained ones.

    Parameters
    ----------
    known
        Unchanged.
    signature
        Of the examples.
    pool
        Numbers of unexplained examples of this signature, oldest first.
    fresh
        How many of the last ones are new; others were tried with one another before.
    flags
        Whether only flags are tried.

    Returns
    -------
    The function, on the signature's columns; of several, that of the mode with most examples.

    Notes
    -----
    Where each example verifies a function by `EXACT` bits; where by twice `EVIDENCE`, only by flags: few examples are
    flagged, so that few pairs could agree by chance. Never by flags where the target counts something. Flags may extend
    all modes whose roles have but one object to play them, other columns only those of the target's own properties.
    Cost O(fresh * modes * columns * (examples of the mode + pool)), both at most `SEARCHED_ROWS`, fresh at most
    `ENOUGH`.
    """
    if not len(pool) or not extendable(known):
        return None
    bits = verifying_bits(known.y, known.scale)
    if is_flag(known.y):
        value = float(known.y[pool[-1]])
        half = least_examples(known.y, known.scale, known.config) / 2
        alike = known.y[pool] == value
        if alike.sum() >= max(2, half):
            constant, slots = LinearFit((), (), value, 0.0), known.table.signatures[signature]
            if not slots.has(0, known.target.property):
                return constant
            order = np.array([slots.column(0, known.target.property)])
            x, told = known.table.x[known.rows[pool][:, None], order], Consensus(constant, alike)
            return reordered(simplest(x, known.y[pool], told, 0, known.scale).fit, order)
    if not known.clusters:
        return None
    pool, exact = pool[-SEARCHED_ROWS:], bits >= EXACT and not flags
    counting = counts(known.y, known.scale, MOST_ROWS)
    if counting and not exact:  # where whole numbers agree, they often do so by chance
        return None
    for i in sorted(known.clusters, key=lambda k: (-known.clusters[k].fitted, k)):
        members = known.members(i)
        members = members[known.table.signature_ids[known.rows[members]] == signature]
        found = _extended(
            known,
            signature,
            i,
            members[-SEARCHED_ROWS:],
            pool,
            min(fresh, ENOUGH),
            exact=exact,
            flagged=not counting,
        )
        if found is not None:
            return found
    return None


def _extended(
    known: Known,
    signature: int,
    mode: int,
    members: NDArray[np.intp],
    pool: NDArray[np.intp],
    fresh: int,
    *,
    exact: bool,
    flagged: bool,
) -> LinearFit | None:
    cluster, slots, tolerance = known.clusters[mode], known.table.signatures[signature], known.scale.tolerance
    binding = cluster.binding(known.table, signature)
    order, stages = slots.preference(known.target)
    if binding is None or binding.open or not stages:
        return None
    weights = dict(binding.fixed)
    had = [at for at in range(stages[0]) if int(order[at]) in weights]
    if len(members) < len(weights) + 2 or len(had) < len(weights):
        return None
    both = np.concatenate([members, pool])
    table, y = known.table.x[known.rows[both]], known.y[both]
    left = y - cluster.mode.intercept - sum(weight * slots.values(table, c) for c, weight in weights.items())
    x = slots.matrix(table, order[: stages[0]])
    flags = _flags(x) & flagged
    own = exact and not any(role.terms for role in cluster.mode.open_roles)
    leads = range(len(both) - 1, max(len(both) - 1 - fresh, len(members) - 1), -1)
    if not leads:
        return None
    for at in np.flatnonzero(_constant(x[: len(members)], x[leads.stop + 1 :])).tolist():
        if at in had or not (flags[at] or own):
            continue
        told = _told(known, signature, int(order[at])) if flags[at] else None
        off = x[:, at] - float(np.median(x[: len(members), at]))
        tried = (_agreeing(off, left, len(members), k, tolerance, told) for k in leads)
        agree = next((rows for rows in tried if rows is not None), None)
        if agree is None:
            continue
        rows = np.concatenate([np.arange(len(members)), agree])
        fit = least_squares(x[rows], y[rows], tuple(sorted([*had, at])))
        fit = eliminate_backward(x[rows], y[rows], fit, sigma=known.scale.sigma)
        if at in fit.columns and np.abs(y[rows] - fit.predict(x[rows])).max() <= tolerance:
            return reordered(fit, order)
    return None


def is_flag(y: NDArray[np.float64]) -> bool:
    """Whether a target never was anything but 0 and 1."""
    return bool(y[-1] in (0.0, 1.0)) and bool(_flags(y))


def _flags(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which columns hold nothing but 0 and 1."""
    found: NDArray[np.bool_] = ((values == 0.0) | (values == 1.0)).all(axis=0)
    return found


def _constant(members: NDArray[np.float64], new: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which columns may be constant among a mode's members and not in some new row: others needn't be looked at."""
    low, high = members.min(axis=0), members.max(axis=0)
    # No new row lies further from their median.
    reach = np.maximum(new.max(axis=0) - low, high - new.min(axis=0))
    found: NDArray[np.bool_] = (reach > 0.0) & (high - low <= 2.0 * ROUNDED * reach)
    return found


def _told(known: Known, signature: int, column: int) -> list[float]:
    """Weights that a column has in known modes."""
    bindings = [cluster.binding(known.table, signature) for cluster in known.clusters.values()]
    return [weight for b in bindings if b is not None for c, weight in b.fixed if c == column]


def _agreeing(
    off: NDArray[np.float64],
    left: NDArray[np.float64],
    members: int,
    lead: int,
    tolerance: float,
    told: list[float] | None,
) -> NDArray[np.intp] | None:
    """Rows that one weight of a column explains, `lead` among them; none unless it is verified.

    Parameters
    ----------
    off, left
        How far a column is from what is usual in the mode's `members` examples, and what the mode leaves: in those, and
        then in the unexplained ones.
    told
        Of a flag: weights that it has in other modes. None of any other column.
    """
    start = float(off[lead])
    if start == 0.0 or np.abs(off[:members]).max() > ROUNDED * abs(start):
        return None
    weight = float(left[lead]) / start
    fits = np.abs(left - weight * off) <= tolerance
    fits[:members] = False
    fits &= np.abs(off) > LITTLE * abs(start)  # what differs little from the constant verifies nothing
    verify = fits & (np.arange(len(fits)) != lead)
    if told is None:
        verify &= np.abs(off - start) > LITTLE * abs(start)  # nor does what hardly differs from what leads
    confirmed = any(abs(float(left[lead]) - w * start) <= tolerance for w in told or ())
    return np.flatnonzero(fits) if confirmed or verify.any() else None
