"""Distances by the Flexible Collision Library, scene by scene: the only module that imports `fcl`.

fcl is quick and general, but not exact everywhere (measured with python-fcl 0.7.0.11): between polyhedra
apart, and between a point and a polyhedron, its GJK leaves one answer in a hundred wrong by up to 1e-6,
normals by up to 1e-2; overlaps come without a depth; and its signed distance aborts the process when two
boxes barely touch. So every answer must prove itself. The nearest points that fcl returns give an upper
bound of the distance, the gap between the two bodies along the line through them a lower one. Where the two
bounds meet within `_PROOF`, fcl's answer stands. Where they don't, or where fcl reports contact or less
than `_NEAR`, the pair goes to the exact array geometry. Hence distances agree with `ArrayGeometry` to
1e-10, and so do all relations for which the distance is no closer than that to the touching threshold.

A sphere is asked for as a *point* (a sphere of radius 1e-12, whose answers are exact up to GJK), and its
radius subtracted afterwards; that is valid while the centre is outside the polyhedron, and with the centre
inside, the array geometry answers. Planar shapes are prisms of half-height 50 in the plane through their
middle.
"""

from __future__ import annotations

from typing import Any

import fcl as library
import numpy as np
from numpy.typing import NDArray

from relgym.errors import ShapeError
from relgym.scene.axes import Axes
from relgym.scene.geometry.arrays import ArrayGeometry, Bodies, Measured, pairs_of
from relgym.scene.geometry.mesh import Mesh, mesh, prism
from relgym.scene.geometry.vectors import FloatArray, dot, norm, rotation
from relgym.scene.shapes import Box, Compound, Shape, Sphere, outline

__all__ = ["FclGeometry"]

fcl: Any = library  # a compiled module that declares no types

_PROOF = 5e-11
"""Largest difference between the two bounds with which an answer stands, in units of length."""

_NEAR = 1e-3
"""Distance below which fcl isn't relied on: normals from nearest points lose digits there."""

_POINT = 1e-12
"""Radius of the sphere that stands for a point."""

_HALF_HEIGHT = 50.0
"""Half the height of the prisms that stand for planar shapes."""


class FclGeometry:
    """Geometry of one layout by fcl; the same interface as `ArrayGeometry`.

    Shapes are built once for each body and size, then only moved. A dynamic tree of bounding boxes (the
    broad phase) finds the polyhedra that may overlap; these are measured exactly, and the rest is asked for
    pair by pair. fcl's objects can't be pickled: they are left out of a pickle and built again.

    Parameters
    ----------
    axes
        The schema's axes.
    bodies
        The layout's bodies.
    """

    def __init__(self, axes: Axes, bodies: Bodies) -> None:
        self._axes, self._bodies = axes, bodies
        for name, shape in zip(bodies.names, bodies.shapes, strict=True):
            if isinstance(shape, Compound):
                raise ShapeError(
                    f"object {name!r} is a compound; use geometry='arrays', which measures each part"
                )
        self._exact = ArrayGeometry(axes, bodies)
        self._round = np.array([isinstance(shape, Sphere) for shape in bodies.shapes], dtype=bool)
        self._first, self._second = pairs_of(len(bodies.shapes))
        self._meshes = [None if isinstance(s, Sphere) else _mesh(s, axes) for s in bodies.shapes]
        # fcl's way to write faces: the number of corners, then their indices, face after face.
        self._faces = [
            None if m is None else np.concatenate([[len(ring), *ring] for ring in m.rings()])
            for m in self._meshes
        ]
        self._objects: list[Any] = [None] * len(bodies.shapes)
        self._extents: list[tuple[float, ...]] = [()] * len(bodies.shapes)

    def __getstate__(self) -> dict[str, Any]:
        count = len(self._objects)
        return {**self.__dict__, "_objects": [None] * count, "_extents": [()] * count}

    def measure(self, pose: FloatArray) -> Measured:
        """Measure n scenes (`Geometry.measure`). Cost: about 0.5 ms a scene of five bodies."""
        solids = self._exact.place(pose)
        low, high = self._exact.bounds(pose, solids)
        shape = (len(self._first), pose.shape[2])
        distance, normal = np.empty(shape), np.empty((len(self._axes.used), *shape))
        for scene in range(pose.shape[2]):
            column = slice(scene, scene + 1)
            self._measure(np.ascontiguousarray(pose[..., column]), distance[:, column], normal[..., column])
        return Measured(distance, normal, low, high)

    def _measure(self, pose: FloatArray, distance: FloatArray, normal: FloatArray) -> None:
        self._move(pose[..., 0])
        there = self._spokes()
        length = norm(there)
        towards = there / np.where(length > 0.0, length, 1.0)
        solids = self._exact.place(pose)
        gaps = self._gaps(pose, solids, towards)
        proven = (length >= _NEAR) & (length - gaps <= _PROOF)
        radius = np.where(self._round, 0.5 * pose[6 + self._axes.used[0], :, 0], 0.0)
        distance[:, 0] = length - (radius[self._first] + radius[self._second])
        normal[..., 0] = towards
        if not proven.all():
            self._exact.fill(pose, solids, ~proven, distance, normal)

    def _spokes(self) -> FloatArray:
        """Vectors between each pair's nearest points, second to first; 0 where they may overlap."""
        spokes = np.zeros((len(self._axes.used), len(self._first)))
        near = self._near()
        request = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=False)
        for p, (a, b) in enumerate(zip(self._first.tolist(), self._second.tolist(), strict=True)):
            if (a, b) in near and not (self._round[a] or self._round[b]):
                continue
            # A result that was used before keeps its smaller distance, so each pair has its own.
            result = fcl.DistanceResult()
            if fcl.distance(self._objects[a], self._objects[b], request, result) > 0.0:
                points = [
                    self._objects[k].getTranslation() if self._round[k] else point
                    for k, point in zip((a, b), result.nearest_points, strict=True)
                ]
                spokes[:, p] = (points[0] - points[1])[: len(spokes)]
        return spokes

    def _near(self) -> set[tuple[int, int]]:
        """Pairs whose bounding boxes meet (broad phase)."""
        manager = fcl.DynamicAABBTreeCollisionManager()
        manager.registerObjects(self._objects)
        manager.setup()
        # The callback gets new wrappers of the objects. Only their place tells which they are; where several
        # share one, all of them count: a pair too many costs time, nothing else.
        numbers: dict[bytes, list[int]] = {}
        for k, body in enumerate(self._objects):
            numbers.setdefault(body.getTranslation().tobytes(), []).append(k)
        found: set[tuple[int, int]] = set()

        def meet(first: Any, second: Any, _: Any) -> bool:
            for a in numbers[first.getTranslation().tobytes()]:
                for b in numbers[second.getTranslation().tobytes()]:
                    found.add((min(a, b), max(a, b)))
            return False

        manager.collide(None, meet)
        return found

    def _gaps(self, pose: FloatArray, solids: Any, towards: FloatArray) -> FloatArray:
        """Gap of each pair along given directions: a lower bound of the distance (spheres as points)."""
        lows = self._exact.supports(solids, towards, self._first)
        highs = -self._exact.supports(solids, -towards, self._second)
        position = pose.take(self._axes.used, axis=0)[..., 0]
        offset = position[:, self._first] - position[:, self._second]
        return (lows - highs) + dot(offset, towards)

    def _move(self, pose: NDArray[np.float64]) -> None:
        """Move the objects of a scene, shape ``(9, K)``; build those of a new size."""
        for k in range(len(self._objects)):
            extent = tuple(pose[6:, k].tolist())
            if self._extents[k] != extent:
                self._objects[k] = fcl.CollisionObject(self._build(k, pose[6:, k]), fcl.Transform())
                self._extents[k] = extent
            self._objects[k].setTransform(self._transform(pose[:, k]))

    def _build(self, body: int, extent: NDArray[np.float64]) -> Any:
        found = self._meshes[body]
        if found is None:
            return fcl.Sphere(_POINT)
        if self._axes.planar:
            extent = np.array([extent[self._axes.used[0]], extent[self._axes.used[1]], 2.0 * _HALF_HEIGHT])
        if isinstance(self._bodies.shapes[body], Box):
            return fcl.Box(*extent)
        corners = np.ascontiguousarray(found.corners * extent)
        return fcl.Convex(corners, len(found.normals), self._faces[body])

    def _transform(self, pose: NDArray[np.float64]) -> Any:
        axes = self._axes
        if not axes.planar:
            return fcl.Transform(np.array(rotation(pose[3:6])), pose[:3])
        turn = np.array([0.0, 0.0, pose[3 + axes.depth] * axes.turn])
        return fcl.Transform(np.array(rotation(turn)), np.array([*pose[list(axes.used)], 0.0]))


def _mesh(shape: Shape, axes: Axes) -> Mesh:
    return (
        prism(outline(shape, axes.canonical[:2]), (0, 1, 2)) if axes.planar else mesh(shape, axes.canonical)
    )
