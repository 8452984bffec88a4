"""Extending a mode by a term that its first examples could not show.

A ball that slides to a ramp's foot has no vertical velocity when it hits the ramp: nineteen such hits say nothing of
how the bounce depends on it. The mode that they found is right where it was found, and too special. Later a hit with a
vertical velocity comes, and no mode explains it; the next such hit confirms the weight that the first one asks for.
Too few to found a mode of their own that could be unified with the first (§3.2.5), they still identify its missing
term, if the data are exact: that two examples ask for the same weight to many digits is no coincidence.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import EXACT, SEARCH, verifying_bits
from relgym.clustering.merging import Known
from relgym.clustering.mode import Mode
from relgym.clustering.unification import reordered
from relgym.numeric.stepwise import LinearFit, eliminate_backward, least_squares

__all__ = ["extended"]

CONSTANT: Final = 1e-9
"""A column that varies by less, relative to what it does in the unexplained examples, is constant."""

NEWEST: Final = 32
"""At most so many new examples are tried."""

APART: Final = 1e-3
"""Examples whose values differ by less, relative to what they differ from the constant, verify nothing."""


def extended(known: Known, signature: int, pool: NDArray[np.intp], *, fresh: int) -> LinearFit | None:
    """A known mode's function with one more term, which explains a new example and another unexplained one.

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

    Returns
    -------
    The function, on the signature's columns; of several, that of the mode with most examples.

    Notes
    -----
    Only for modes of the target's own properties, and where each example verifies a function by `EXACT` bits.
    Cost O(fresh * modes * columns * (examples of the mode + pool)), both at most `SEARCH`, fresh at most `NEWEST`.
    """
    if len(pool) < 2 or verifying_bits(known.y, known.scale) < EXACT:
        return None
    pool = pool[-SEARCH:]
    for i in sorted(known.clusters, key=lambda k: (-known.clusters[k].fitted, k)):
        mode = known.clusters[i].mode
        if not any(role.terms for role in mode.open_roles):
            members = known.members(i)
            members = members[known.table.signature_ids[known.rows[members]] == signature]
            found = _extended(known, signature, mode, members[-SEARCH:], pool, min(fresh, NEWEST))
            if found is not None:
                return found
    return None


def _extended(
    known: Known, signature: int, mode: Mode, members: NDArray[np.intp], pool: NDArray[np.intp], fresh: int
) -> LinearFit | None:
    slots, tolerance = known.table.signatures[signature], known.scale.tolerance
    weights = {slots.column(0, name): weight for name, weight in mode.roles[0].terms}
    order, stages = slots.preference(known.target)
    if len(members) < len(weights) + 2 or not stages:
        return None
    both = np.concatenate([members, pool])
    table, y = known.table.x[known.rows[both]], known.y[both]
    left = y - mode.intercept - sum(weight * slots.values(table, c) for c, weight in weights.items())
    x = slots.matrix(table, order[: stages[0]])
    had = [at for at in range(x.shape[1]) if int(order[at]) in weights]
    for at in range(x.shape[1]):
        if at in had:
            continue
        tried = (_agreeing(x[:, at], left, len(members), len(both) - 1 - k, tolerance) for k in range(fresh))
        agree = next((rows for rows in tried if rows is not None), None)
        if agree is None:
            continue
        rows = np.concatenate([np.arange(len(members)), agree])
        fit = least_squares(x[rows], y[rows], tuple(sorted([*had, at])))
        fit = eliminate_backward(x[rows], y[rows], fit, sigma=known.scale.sigma)
        if at in fit.columns and np.abs(y[rows] - fit.predict(x[rows])).max() <= tolerance:
            return reordered(fit, order)
    return None


def _agreeing(
    column: NDArray[np.float64], left: NDArray[np.float64], members: int, lead: int, tolerance: float
) -> NDArray[np.intp] | None:
    """Rows that one weight of a column explains, `lead` among them; none unless another one verifies it.

    Parameters
    ----------
    column, left
        Values of the column, and what the mode leaves, in its `members` examples and then in the unexplained ones.
    """
    usual = float(np.median(column[:members]))
    off = column - usual
    start = float(off[lead])
    if lead < members or start == 0.0 or np.abs(off[:members]).max() > CONSTANT * abs(start):
        return None
    weight = float(left[lead]) / start
    fits = np.abs(left - weight * off) <= tolerance
    fits[:members] = False
    fits &= np.abs(off) > APART * abs(start)
    verify = fits & (np.abs(off - start) > APART * abs(start))
    return np.flatnonzero(fits) if verify.any() else None
