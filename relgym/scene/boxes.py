"""Relations between world-axis-aligned bounding boxes, as the original system defines them."""

from __future__ import annotations

from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.scene.axes import Axes
from relgym.scene.geometry.vectors import FloatArray, norm

__all__ = ["ALIGN_MARGIN", "MIN_OVERLAP", "SIZE_RATIO", "BoxRelations", "axis_relations"]

_Pairs: TypeAlias = NDArray[np.bool_]

ALIGN_MARGIN = 0.05
"""Share of the smaller extent by which one box may reach into another and still count as beyond it."""

MIN_OVERLAP = 0.1
"""Share of the upper body that must lie over the lower one on every horizontal axis, for `on-top`."""

SIZE_RATIO = 1.1
"""How much longer the diagonal of the larger bounding box must be, for `smaller-than`."""


@cache
def axis_relations(axes: Axes) -> dict[str, tuple[str, int]]:
    """Relations along each axis: (kind, axis) by name."""
    kinds = ("less-than", "greater-than", "aligned")
    return {f"{name}-{kind}": (kind, k) for k, name in enumerate(axes.names) for kind in kinds}


class BoxRelations:
    """Relations of all ordered pairs of bodies, each worked out when it is asked for.

    On each axis exactly one of ``less(a, b)``, ``greater(a, b)`` and ``aligned(a, b)`` holds. Results have the shape
    ``(K, K, n)``; the diagonal means nothing.

    Parameters
    ----------
    axes
        The schema's axes.
    position
        Shape ``(d, K, n)``.
    low, high
        Bounding boxes relative to the positions, shape ``(d, K, n)``.
    """

    def __init__(self, axes: Axes, position: FloatArray, low: FloatArray, high: FloatArray) -> None:
        self._axes = axes
        self.position, self._low, self._high = position, low, high
        self._less: dict[int, _Pairs] = {}

    def along(self, kind: str, axis: int) -> _Pairs:
        """``less-than``, ``greater-than`` or ``aligned`` along an axis."""
        less = self.less(axis)
        greater = less.swapaxes(0, 1)
        if kind == "aligned":
            return ~(less | greater)
        return less if kind == "less-than" else greater

    def less(self, axis: int) -> _Pairs:
        """Whether the first body is beyond the second on the low side, up to `ALIGN_MARGIN`."""
        if axis not in self._less:
            low, high = self._low[axis], self._high[axis]
            extent = high - low
            margin = ALIGN_MARGIN * np.minimum(extent[:, None], extent[None])
            self._less[axis] = (low[None] - high[:, None]) - self._offset(axis) >= -margin
        return self._less[axis]

    def prepare(self) -> None:
        """Work out all axes at once: cheaper where all of them will be asked for."""
        low, high, position = self._low, self._high, self.position
        extent = high - low
        margin = ALIGN_MARGIN * np.minimum(extent[:, :, None], extent[:, None])
        less = (low[:, None] - high[:, :, None]) - (position[:, :, None] - position[:, None]) >= -margin
        self._less = dict(enumerate(less))

    def smaller(self) -> _Pairs:
        """Whether the second body's diagonal is more than `SIZE_RATIO` times as long."""
        size = norm(self._high - self._low)
        found: _Pairs = SIZE_RATIO * size[:, None] < size[None]
        return found

    def on_top(self, touching: _Pairs) -> _Pairs:
        """Whether the first body lies on the second one; `touching` says which bodies touch, ``(K, K, n)``."""
        found: _Pairs = self.less(self._axes.up).swapaxes(0, 1) & touching
        for h in self._axes.horizontal:
            low, high, offset = self._low[h], self._high[h], self._offset(h)
            top = np.minimum(high[:, None] + offset, high[None])
            bottom = np.maximum(low[:, None] + offset, low[None])
            found = found & (top - bottom >= MIN_OVERLAP * (high - low)[:, None])
        return found

    def _offset(self, axis: int) -> FloatArray:
        # Differences of positions first: far from the origin no precision is lost.
        offset: FloatArray = self.position[axis][:, None] - self.position[axis][None]
        return offset
