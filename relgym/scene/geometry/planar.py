"""Discs and convex polygons in the plane: signed distances and normals of many pairs in many scenes at once.

All functions work on arrays of components first, pairs next and scenes last, and treat each pair of each
scene on its own. `offset` is always the first body's position minus the second's, and the normal points
from the second to the first. Every polygon is taken relative to its own position: a scene far from the
origin loses no precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.scene.axes import Axes
from relgym.scene.geometry.vectors import FloatArray, dot, norm, pick, rotate
from relgym.scene.shapes import Shape, outline

__all__ = ["Planar", "Polygons", "gaps", "polygons"]


@dataclass(frozen=True, slots=True)
class Polygons:
    """Placed polygons as rows of edges, each repeating its last edge up to the largest number of edges.

    Repeated edges change no minimum and no maximum, so padding needs no mask.

    Parameters
    ----------
    starts
        Corner that each edge starts from, relative to the polygon's position, shape ``(2, V, B, n)``.
    normals
        Outward unit normals, shape ``(2, V, B, n)``; counter-clockwise, the edge runs along (-n_y, n_x).
    lengths
        Shape ``(V, B, n)``.
    """

    starts: FloatArray
    normals: FloatArray
    lengths: FloatArray

    def take(self, bodies: NDArray[np.intp]) -> Polygons:
        """Polygons of the bodies with these numbers."""
        return Polygons(
            self.starts.take(bodies, axis=2),
            self.normals.take(bodies, axis=2),
            self.lengths.take(bodies, axis=1),
        )

    def pick(self, bodies: NDArray[np.intp], scenes: NDArray[np.intp]) -> Polygons:
        """One polygon of one scene for each of m pairs, as pairs of one scene each: shapes ``(2, V, 1, m)``."""
        parts = (self.starts, self.normals, self.lengths)
        return Polygons(*(a[..., bodies, scenes][..., None, :] for a in parts))

    def rows(self, chosen: NDArray[np.bool_]) -> Polygons:
        """Polygons of the chosen (pair, scene) rows, as one pair: shapes ``(2, V, 1, rows)``."""
        parts = (self.starts, self.normals, self.lengths)
        return Polygons(*(a[..., chosen][..., None, :] for a in parts))

    @property
    def offsets(self) -> FloatArray:
        """Distance of each edge's line from the polygon's position, shape ``(V, B, n)``."""
        return dot(self.normals, self.starts)


def polygons(corners: FloatArray, edges: FloatArray, extent: FloatArray, angle: FloatArray) -> Polygons:
    """Polygons of some size, turned, relative to their positions.

    Parameters
    ----------
    corners, edges
        Canonical corners and the vectors to the next ones, shape ``(2, V, ...)``.
    extent, angle
        Full extents along the two axes, shape ``(2, ...)``, and angles in radians, shape ``(...)``.
    """
    extent = extent[:, None]
    cos, sin = np.cos(angle), np.sin(angle)
    edges = edges * extent
    lengths = norm(edges)
    across = np.stack([edges[1], -edges[0]]) / lengths
    turned = rotate(((cos, -sin), (sin, cos)), np.concatenate([corners * extent, across], axis=1))
    count = corners.shape[1]
    return Polygons(turned[:, :count], turned[:, count:], lengths)


class Planar:
    """Geometry of a planar schema's polygons.

    Parameters
    ----------
    axes
        The schema's axes.
    shapes
        The shapes that have corners.
    """

    def __init__(self, axes: Axes, shapes: Sequence[Shape]) -> None:
        outlines = [outline(shape, axes.used[:2]) for shape in shapes]  # type: ignore[arg-type]
        most = max((len(o) for o in outlines), default=1)
        corners = np.zeros((2, most, len(shapes), 1))
        edges = np.zeros_like(corners)
        for b, o in enumerate(outlines):
            padded = np.minimum(np.arange(most), len(o) - 1)
            corners[:, :, b, 0] = o[padded].T
            edges[:, :, b, 0] = (np.roll(o, -1, axis=0) - o)[padded].T
        self._corners, self._edges = corners, edges
        self._angle, self._turn, self._used = 3 + axes.depth, axes.turn, list(axes.used)

    def place(self, pose: FloatArray) -> Polygons:
        """Scale and rotate the polygons; `pose` has the nine components first, shape ``(9, B, n)``."""
        angle = np.ascontiguousarray(pose[self._angle]) * self._turn
        return polygons(self._corners, self._edges, pose[6:][self._used], angle)

    def upright(self, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what `bounds` says of polygons that aren't turned, without placing them."""
        extent = pose[6:][self._used]
        return self._corners.min(axis=1) * extent, self._corners.max(axis=1) * extent

    @staticmethod
    def corners(solids: Polygons) -> FloatArray:
        """Corners relative to the positions, shape ``(2, V, B, n)``."""
        return solids.starts

    @staticmethod
    def bounds(solids: Polygons) -> tuple[FloatArray, FloatArray]:
        """Bounding boxes relative to the positions: lows and highs, each of shape ``(2, B, n)``."""
        return solids.starts.min(axis=1), solids.starts.max(axis=1)

    @staticmethod
    def sphere_solid(
        offset: FloatArray, radius: FloatArray, solid: Polygons
    ) -> tuple[FloatArray, FloatArray]:
        """Signed distance and normal from discs to polygons; exact, inside and outside.

        The edge whose line is farthest below the centre either holds the nearest point or ends in it,
        because the direction to a nearest corner lies between the normals of the two edges that meet there.
        """
        reach = offset[:, None] - solid.starts
        above = dot(solid.normals, reach)
        reach, normal, height, length = pick(above.argmax(axis=0), reach, solid.normals, above, solid.lengths)
        along = normal[0] * reach[1] - normal[1] * reach[0]
        foot = np.minimum(np.maximum(along, 0.0), length)
        # Within an edge's strip the height is the distance; no square root rounds it near 0.
        corner = (foot != along) & (height > 0.0)
        spoke = np.stack([reach[0] + foot * normal[1], reach[1] - foot * normal[0]])
        far = norm(spoke)
        distance = np.where(corner, far, height) - radius
        return distance, np.where(corner, spoke / np.where(corner, far, 1.0), normal)

    @staticmethod
    def solid_solid(offset: FloatArray, a: Polygons, b: Polygons) -> tuple[FloatArray, FloatArray]:
        """Signed distance and normal of polygons: separating axes if they overlap, else nearest corners."""
        both = np.concatenate([gaps(offset, a, b), gaps(-offset, b, a)])
        normals = np.concatenate([b.normals, -a.normals], axis=1)
        depth, normal = pick(both.argmax(axis=0), both, normals)
        apart = depth > 0.0
        if not apart.any():
            return depth, normal
        if apart.all():
            return _between(offset, a, b)
        near, towards = _between(offset[:, apart][:, None], a.rows(apart), b.rows(apart))
        depth[apart], normal[:, apart] = near[0], towards[:, 0]
        return depth, normal


def gaps(offset: FloatArray, a: Polygons, b: Polygons) -> FloatArray:
    """Gap along each edge normal of b (separating axis theorem); negative where both overlap along it."""
    # (min - max) + shift, in this order, has the same bits when the two bodies are exchanged.
    support = dot(b.normals[:, None], a.starts[:, :, None]).min(axis=0)
    found: FloatArray = (support - b.offsets) + dot(b.normals, offset[:, None])
    return found


def _between(offset: FloatArray, a: Polygons, b: Polygons) -> tuple[FloatArray, FloatArray]:
    """Distance and normal of polygons apart."""
    to_b, normal_b = _nearest(offset, a, b)
    to_a, normal_a = _nearest(-offset, b, a)
    nearer = to_b <= to_a
    return np.where(nearer, to_b, to_a), np.where(nearer, normal_b, -normal_a)


def _nearest(offset: FloatArray, a: Polygons, b: Polygons) -> tuple[FloatArray, FloatArray]:
    """Distance and normal from the nearest of a's corners to b's edges, for polygons apart."""
    reach = offset[:, None, None] + (a.starts[:, :, None] - b.starts[:, None])
    normal, length = b.normals[:, None], b.lengths[None]
    height = dot(normal, reach)
    along = normal[0] * reach[1] - normal[1] * reach[0]
    foot = np.minimum(np.maximum(along, 0.0), length)
    within = (foot == along) & (height > 0.0)
    spoke = np.stack([reach[0] + foot * normal[1], reach[1] - foot * normal[0]])
    far = np.where(within, height, norm(spoke))
    every = (-1, *far.shape[2:])
    choice = far.reshape(every).argmin(axis=0)
    normals = np.broadcast_to(normal, spoke.shape)
    inside, spoke, normal, near = pick(
        choice, within.reshape(every), _flat(spoke), _flat(normals), far.reshape(every)
    )
    return near, np.where(inside, normal, spoke / np.where(near > 0.0, near, 1.0))


def _flat(a: NDArray[Any]) -> FloatArray:
    return a.reshape(2, -1, *a.shape[3:])
