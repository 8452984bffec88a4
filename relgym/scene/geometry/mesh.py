"""Canonical polyhedra as corners, faces and edges, along the world axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.scene.hull import facets
from relgym.scene.shapes import ConvexPolyhedron, Shape, outline

__all__ = ["Mesh", "mesh", "prism"]

_PARALLEL = 1e-9
"""Sine below which two edges count as parallel."""

_FLAT = 1e-9
"""Distance from a face's plane, in extents, up to which a corner belongs to the face."""


@dataclass(frozen=True, slots=True)
class Mesh:
    """A convex polyhedron.

    Parameters
    ----------
    corners
        Shape ``(V, 3)``.
    normals
        Outward face normals, shape ``(F, 3)``.
    anchors
        A corner on each face, shape ``(F,)``.
    edges
        Pairs of corners, shape ``(E, 2)``.
    directions
        One of each set of parallel edges, shape ``(U,)``. Scaling keeps parallels parallel.
    """

    corners: NDArray[np.float64]
    normals: NDArray[np.float64]
    anchors: NDArray[np.intp]
    edges: NDArray[np.intp]
    directions: NDArray[np.intp]

    def rings(self) -> list[NDArray[np.intp]]:
        """Corners of each face, counter-clockwise as seen from outside."""
        rings = []
        for normal, anchor in zip(self.normals, self.corners[self.anchors], strict=True):
            unit = normal / np.linalg.norm(normal)
            on = np.flatnonzero(np.abs((self.corners - anchor) @ unit) < _FLAT * np.ptp(self.corners))
            spokes = self.corners[on] - self.corners[on].mean(axis=0)
            across = np.cross(unit, spokes[0])
            rings.append(on[np.argsort(np.arctan2(spokes @ across, spokes @ spokes[0]))])
        return rings


def mesh(shape: Shape, canonical: tuple[int, int, int]) -> Mesh:
    """Build the mesh of a canonical shape (not a sphere); `canonical` are the first, up and depth axes."""
    if isinstance(shape, ConvexPolyhedron):
        corners = np.array(shape.vertices, dtype=np.float64)
        return _mesh(corners, *facets(shape.vertices))
    return prism(outline(shape), canonical)


def prism(polygon: NDArray[np.float64], canonical: tuple[int, int, int]) -> Mesh:
    """Build the prism over a counter-clockwise polygon in (first, up), from -1/2 to 1/2 along the depth."""
    count = len(polygon)
    near, far = np.arange(count), np.arange(count) + count
    corners = np.zeros((2 * count, 3))
    corners[:, list(canonical[:2])] = np.tile(polygon, (2, 1))
    corners[:, canonical[2]] = np.repeat([-0.5, 0.5], count)
    along = np.roll(polygon, -1, axis=0) - polygon
    normals = np.zeros((count + 2, 3))
    normals[:count, canonical[0]], normals[:count, canonical[1]] = along[:, 1], -along[:, 0]
    normals[count:, canonical[2]] = -1.0, 1.0
    anchors = np.append(near, [0, count])
    pairs = [(near, np.roll(near, -1)), (far, np.roll(far, -1)), (near, far)]
    edges = np.concatenate([np.stack(pair, axis=1) for pair in pairs])
    return _mesh(corners, normals, anchors, edges)


def _mesh(
    corners: NDArray[np.float64],
    normals: NDArray[np.float64],
    anchors: NDArray[np.intp],
    edges: NDArray[np.intp],
) -> Mesh:
    unit = corners[edges[:, 1]] - corners[edges[:, 0]]
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    directions: list[int] = []
    for i, direction in enumerate(unit):
        if all(np.linalg.norm(np.cross(direction, unit[j])) > _PARALLEL for j in directions):
            directions.append(i)
    return Mesh(corners, normals, anchors, edges, np.array(directions, dtype=np.intp))
