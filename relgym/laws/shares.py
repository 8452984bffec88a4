"""How two moving bodies share the impulse of their contact."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import DEGREES, FEWEST, LEFT_OPEN, ROUNDED, TOLD
from relgym.laws.records import Share
from relgym.scene.geometry.vectors import FloatArray, dot

__all__ = ["EXTENT", "find_share", "share_values"]

EXTENT = "extent"
"""Name of a body's size in shares."""


def share_values(share: Share, a: Mapping[str, FloatArray], b: Mapping[str, FloatArray]) -> FloatArray:
    """The first body's share, from the two bodies' properties; NaN where those say nothing."""
    if not share.property:
        some = next(iter(a.values()))
        return np.full(some.shape, share.constant)
    mine, theirs = np.ones(1), np.ones(1)
    for _ in range(share.power):
        mine, theirs = mine * a[share.property], theirs * b[share.property]
    both = mine + theirs
    return np.where(both == 0.0, np.nan, theirs / np.where(both == 0.0, 1.0, both))


def find_share(
    change_a: FloatArray,
    change: FloatArray,
    a: Mapping[str, FloatArray],
    b: Mapping[str, FloatArray],
    *,
    alike: bool,
    tolerance: float,
) -> Share | None:
    """The simplest share that explains every contact; None where there is none or too little to tell.

    Parameters
    ----------
    change_a, change
        Change of the first body's and of the relative velocity, shape ``(d, n)``.
    a, b
        Properties of the two bodies by name, shape ``(n,)`` each.
    alike
        Whether both are of one type: then no number but one half can be meant by position in the pair.
    tolerance
        Largest residual of an explained velocity.
    """
    size = dot(change, change)
    told = np.sqrt(size) > TOLD * tolerance
    if told.sum() < FEWEST:
        return None
    observed = dot(change_a, change)[told] / size[told]
    for share in _candidates(sorted(set(a) & set(b)), float(np.median(observed)), alike=alike):
        values = np.broadcast_to(share_values(share, a, b), size.shape)
        left = np.abs(change_a - values * change).max(axis=0)
        if _right(left, told, tolerance) and not _trivial(share, a, b, told):
            return share
    return None


def _right(left: NDArray[np.float64], told: NDArray[np.bool_], tolerance: float) -> bool:
    return bool((left[told] <= 2.0 * tolerance).mean() >= 1.0 - LEFT_OPEN)


def _trivial(
    share: Share, a: Mapping[str, FloatArray], b: Mapping[str, FloatArray], told: NDArray[np.bool_]
) -> bool:
    """Whether a property says nothing here, since its ratio never varied."""
    if not share.property:
        return False
    values = share_values(share, a, b)[told]
    return bool(np.ptp(values) <= ROUNDED * np.abs(values).max())


def _candidates(names: list[str], median: float, *, alike: bool) -> list[Share]:
    found = [Share(constant=0.5)]
    found += [Share(name, power) for power in DEGREES for name in names]
    if not alike:
        found.append(Share(constant=median))
    return found
