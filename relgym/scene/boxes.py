"""Relations between world-axis-aligned bounding boxes, as the original system defines them."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.scene.axes import Axes
from relgym.scene.geometry.vectors import FloatArray, norm

__all__ = ["ALIGN_MARGIN", "MIN_OVERLAP", "SIZE_RATIO", "box_relations"]

_Pairs: TypeAlias = NDArray[np.bool_]

ALIGN_MARGIN = 0.05
"""Share of the smaller extent by which one box may reach into another and still count as beyond it."""

MIN_OVERLAP = 0.1
"""Share of the upper body that must lie over the lower one on every horizontal axis, for `on-top`."""

SIZE_RATIO = 1.1
"""How much longer the diagonal of the larger bounding box must be, for `smaller-than`."""


def box_relations(
    axes: Axes, position: FloatArray, low: FloatArray, high: FloatArray, touching: _Pairs
) -> dict[str, _Pairs]:
    """Relations of all ordered pairs of bodies.

    On each axis exactly one of ``less(a, b)``, ``greater(a, b)`` and ``aligned(a, b)`` holds.

    Parameters
    ----------
    axes
        The schema's axes.
    position
        Shape ``(d, K, n)``.
    low, high
        Bounding boxes relative to the positions, shape ``(d, K, n)``.
    touching
        Which bodies touch, shape ``(K, K, n)``.

    Returns
    -------
    Shape ``(K, K, n)`` by name of the relation; the diagonal means nothing.
    """
    extent = high - low
    # Differences of positions first: far from the origin no precision is lost.
    offset = position[:, :, None] - position[:, None]
    margin = ALIGN_MARGIN * np.minimum(extent[:, :, None], extent[:, None])
    less = (low[:, None] - high[:, :, None]) - offset >= -margin
    greater = less.swapaxes(1, 2)
    aligned = ~(less | greater)
    size = norm(extent)
    found = {
        "on-top": greater[axes.up] & touching & _overlapping(axes, offset, low, high, extent),
        "smaller-than": SIZE_RATIO * size[:, None] < size[None],
    }
    for k, name in enumerate(axes.names):
        found[f"{name}-less-than"] = less[k]
        found[f"{name}-greater-than"] = greater[k]
        found[f"{name}-aligned"] = aligned[k]
    return found


def _overlapping(
    axes: Axes, offset: FloatArray, low: FloatArray, high: FloatArray, extent: FloatArray
) -> _Pairs:
    """Whether enough of the first body lies over the second on every horizontal axis."""
    enough: _Pairs = np.ones(offset.shape[1:], dtype=bool)
    for h in axes.horizontal:
        top = np.minimum(high[h][:, None] + offset[h], high[h][None])
        bottom = np.maximum(low[h][:, None] + offset[h], low[h][None])
        enough &= top - bottom >= MIN_OVERLAP * extent[h][:, None]
    return enough
