"""Spheres and convex polyhedra in space: signed distances and normals of many pairs in many scenes at once.

The conventions are those of `relgym.scene.geometry.planar`. Distances between polyhedra apart are found by
trying all corner-face and edge-edge pairs: simple, exact, and cheap for the few corners that boxes and
wedges have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from relgym.scene.axes import Axes
from relgym.scene.geometry.mesh import mesh
from relgym.scene.geometry.segments import nearest_edges
from relgym.scene.geometry.vectors import FloatArray, cross, dot, norm, pick, rotate, rotation
from relgym.scene.shapes import Shape

__all__ = ["Polyhedra", "Solid"]

_SAME = 1.0 - 1e-12
"""Cosine above which two face normals belong to one face (a padded copy)."""

_PARALLEL = 1e-24
"""Squared sine below which two edge directions span no plane."""


@dataclass(frozen=True, slots=True)
class Polyhedra:
    """Placed polyhedra, relative to their positions; rows are repeated up to the largest number of each kind.

    Parameters
    ----------
    corners
        Shape ``(3, V, B, n)``.
    normals, offsets
        Outward unit normals of the faces, shape ``(3, F, B, n)``, and their distances, ``(F, B, n)``.
    starts, edges
        Where edges start and the vectors they run along, shape ``(3, E, B, n)`` each.
    directions
        Unit vectors along the edges, one of each set of parallels, shape ``(3, U, B, n)``.
    """

    corners: FloatArray
    normals: FloatArray
    offsets: FloatArray
    starts: FloatArray
    edges: FloatArray
    directions: FloatArray

    def take(self, bodies: NDArray[np.intp]) -> Polyhedra:
        """Polyhedra of the bodies with these numbers."""
        return Polyhedra(*(getattr(self, f.name).take(bodies, axis=-2) for f in fields(self)))

    def pick(self, bodies: NDArray[np.intp], scenes: NDArray[np.intp]) -> Polyhedra:
        """One polyhedron of one scene for each of m pairs, as pairs of one scene each: shapes ``(3, V, 1, m)``."""
        return Polyhedra(*(getattr(self, f.name)[..., bodies, scenes][..., None, :] for f in fields(self)))

    def rows(self, chosen: NDArray[np.bool_]) -> Polyhedra:
        """Polyhedra of the chosen (pair, scene) rows, as one scene each: shapes ``(3, m, 1, rows)``."""
        return Polyhedra(*(getattr(self, f.name)[..., chosen][..., None, :] for f in fields(self)))


class Solid:
    """Geometry of a spatial schema's polyhedra; parameters as for `Planar`."""

    def __init__(self, axes: Axes, shapes: Sequence[Shape]) -> None:
        meshes = [mesh(shape, axes.canonical) for shape in shapes]
        self._corners = _padded([m.corners for m in meshes])
        self._normals = _padded([m.normals for m in meshes])
        self._anchors = _padded([m.corners[m.anchors] for m in meshes])
        self._starts = _padded([m.corners[m.edges[:, 0]] for m in meshes])
        vectors = [m.corners[m.edges[:, 1]] - m.corners[m.edges[:, 0]] for m in meshes]
        self._edges = _padded(vectors)
        self._directions = _padded([v[m.directions] for v, m in zip(vectors, meshes, strict=True)])

    def place(self, pose: FloatArray) -> Polyhedra:
        """Scale and rotate the polyhedra; `pose` has the nine components first, shape ``(9, B, n)``."""
        extent = pose[6:][:, None]
        # Normals of a scaled solid scale by the cofactors: inversely to the extents.
        cofactor = np.stack([extent[1] * extent[2], extent[0] * extent[2], extent[0] * extent[1]])
        normals = self._normals * cofactor
        normals = normals / norm(normals)
        offsets = dot(normals, self._anchors * extent)
        directions = self._directions * extent
        parts = [
            self._corners * extent,
            normals,
            self._starts * extent,
            self._edges * extent,
            directions / norm(directions),
        ]
        turned = rotate(rotation(np.ascontiguousarray(pose[3:6])), np.concatenate(parts, axis=1))
        cuts = np.cumsum([part.shape[1] for part in parts])[:-1]
        corners, normals, starts, edges, directions = np.split(turned, cuts, axis=1)
        return Polyhedra(corners, normals, offsets, starts, edges, directions)

    def upright(self, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what `bounds` says of polyhedra that aren't turned, without placing them."""
        return self._corners.min(axis=1) * pose[6:], self._corners.max(axis=1) * pose[6:]

    @staticmethod
    def corners(solids: Polyhedra) -> FloatArray:
        """Corners relative to the positions, shape ``(3, V, B, n)``."""
        return solids.corners

    @staticmethod
    def bounds(solids: Polyhedra) -> tuple[FloatArray, FloatArray]:
        """Bounding boxes relative to the positions: lows and highs, each of shape ``(3, B, n)``."""
        return solids.corners.min(axis=1), solids.corners.max(axis=1)

    @staticmethod
    def sphere_solid(
        offset: FloatArray, radius: FloatArray, solid: Polyhedra
    ) -> tuple[FloatArray, FloatArray]:
        """Signed distance and normal from spheres to polyhedra; exact, inside and outside."""
        height, normal, over = _over_face(offset[:, None], solid)
        height, normal, over = height[0], normal[:, 0], over[0]
        reach = offset[:, None] - solid.starts
        share = dot(reach, solid.edges) / dot(solid.edges, solid.edges)
        spoke = reach - np.minimum(np.maximum(share, 0.0), 1.0) * solid.edges
        lengths = norm(spoke)
        spoke, far = pick(lengths.argmin(axis=0), spoke, lengths)
        beside = (height > 0.0) & ~over
        distance = np.where(beside, far, height) - radius
        return distance, np.where(beside, spoke / np.where(beside, far, 1.0), normal)

    @staticmethod
    def solid_solid(offset: FloatArray, a: Polyhedra, b: Polyhedra) -> tuple[FloatArray, FloatArray]:
        """Signed distance and normal of polyhedra: separating axes if they overlap, else nearest features."""
        distance, normal = _separation(offset, a, b)
        apart = distance > 0.0
        if apart.any():
            near, towards = _nearest(offset[..., apart][..., None, :], a.rows(apart), b.rows(apart))
            distance[apart], normal[:, apart] = near[0], towards[:, 0]
        return distance, normal


def _separation(offset: FloatArray, a: Polyhedra, b: Polyhedra) -> tuple[FloatArray, FloatArray]:
    """Return the largest gap along all face normals and crosses of edges, and its direction, b to a."""
    axes = cross(a.directions[:, :, None], b.directions[:, None])
    axes = axes.reshape(3, -1, *axes.shape[3:])
    sine = dot(axes, axes)
    axes = axes / np.sqrt(np.where(sine > _PARALLEL, sine, 1.0))
    forward, backward = _gaps(axes, offset, a, b), _gaps(axes, -offset, b, a)
    skew = np.where(sine > _PARALLEL, np.maximum(forward, backward), -np.inf)
    faces_b = (_lowest(b.normals, a) - b.offsets) + dot(b.normals, offset[:, None])
    faces_a = (_lowest(a.normals, b) - a.offsets) - dot(a.normals, offset[:, None])
    gaps = np.concatenate([faces_b, faces_a, skew])
    normals = np.concatenate([b.normals, -a.normals, np.where(forward >= backward, axes, -axes)], axis=1)
    depth, normal = pick(gaps.argmax(axis=0), gaps, normals)
    return depth, normal


def _gaps(axes: FloatArray, offset: FloatArray, a: Polyhedra, b: Polyhedra) -> FloatArray:
    highest = dot(axes[:, None], b.corners[:, :, None]).max(axis=0)
    gaps: FloatArray = (_lowest(axes, a) - highest) + dot(axes, offset[:, None])
    return gaps


def _lowest(axes: FloatArray, solid: Polyhedra) -> FloatArray:
    """Smallest component of a solid's corners along axes ``(3, m, P, n)``, shape ``(m, P, n)``."""
    lowest: FloatArray = dot(axes[:, None], solid.corners[:, :, None]).min(axis=0)
    return lowest


def _nearest(offset: FloatArray, a: Polyhedra, b: Polyhedra) -> tuple[FloatArray, FloatArray]:
    """Distance and normal between the nearest features of polyhedra apart."""
    down, normal_b, over_b = _over_face(offset[:, None] + a.corners, b)
    up, normal_a, over_a = _over_face(b.corners - offset[:, None], a)
    skew, normal_e = nearest_edges(offset, a.starts, a.edges, b.starts, b.edges)
    # No corner lies inside the other solid, but rounding may make the height of a touching one negative.
    every = np.concatenate([np.where(over_b, down, np.inf), np.where(over_a, up, np.inf), skew])
    normals = np.concatenate([normal_b, -normal_a, normal_e], axis=1)
    distance, normal = pick(every.argmin(axis=0), every, normals)
    return distance, normal


def _over_face(points: FloatArray, solid: Polyhedra) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return points' height over the farthest face below, its normal, and whether the foot lies on it.

    Points have the shape ``(3, m, P, n)``.

    A foot that is below every other face's plane lies on the face, which then is the polyhedron's nearest
    part.
    """
    heights = dot(solid.normals[:, :, None], points[:, None]) - solid.offsets[:, None]
    shape = heights.shape[1:]
    normals = np.broadcast_to(solid.normals[:, :, None], (3, *heights.shape))
    height, normal = pick(heights.argmax(axis=0), heights, normals)
    cosines = dot(solid.normals[:, :, None], normal[:, None])
    below = (heights - height * cosines <= 0.0) | (cosines > _SAME)
    return height, normal, np.asarray(below.all(axis=0)).reshape(shape)


def _padded(parts: Sequence[NDArray[np.float64]]) -> FloatArray:
    """Stack ``(m, 3)`` arrays as ``(3, most, B, 1)``, repeating each one's last row."""
    most = max((len(part) for part in parts), default=1)
    out = np.ones((3, most, len(parts), 1))
    for b, part in enumerate(parts):
        out[:, :, b, 0] = part[np.minimum(np.arange(most), len(part) - 1)].T
    return out
