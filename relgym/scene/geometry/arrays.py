"""Distances and normals of all pairs of bodies, batched over scenes with the same objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ShapeError
from relgym.scene.axes import WORLD, Axes
from relgym.scene.geometry.planar import Planar
from relgym.scene.geometry.solid import Solid
from relgym.scene.geometry.vectors import FloatArray, norm
from relgym.scene.shapes import Shape, Sphere

__all__ = ["ArrayGeometry", "Bodies", "Geometry", "Measured", "check_extents", "pairs_of"]

_Indices: TypeAlias = NDArray[np.intp]

_ROUND = 1e-9
"""Relative difference of extents above which a sphere is no sphere."""

_MAX_PLANS = 256
"""Subsets of pairs whose index arrays are kept."""


@dataclass(frozen=True, slots=True)
class Bodies:
    """The bodies of a layout: names (for error messages) and canonical shapes."""

    names: tuple[str, ...]
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, slots=True)
class Measured:
    """What a geometry says about n scenes of K bodies and their P = K (K - 1) / 2 pairs, in `pairs_of` order.

    Parameters
    ----------
    distance
        Signed distance of each pair, negative by the penetration depth, shape ``(P, n)``.
    normal
        Unit vector from the second body to the first: the way out, shape ``(d, P, n)``.
    low, high
        World-axis-aligned bounding boxes relative to the positions, shape ``(d, K, n)``.
    """

    distance: FloatArray
    normal: FloatArray
    low: FloatArray
    high: FloatArray


class Geometry(Protocol):
    """What measures the bodies of one layout."""

    def measure(self, pose: FloatArray) -> Measured:
        """Measure n scenes; `pose` has the components of `POSE` first, shape ``(9, K, n)``.

        Raises
        ------
        ShapeError
            An extent isn't positive, or a sphere isn't round.
        """
        ...


def pairs_of(count: int) -> tuple[_Indices, _Indices]:
    """First and second body of every pair, first < second."""
    first, second = np.triu_indices(count, 1)
    return first.astype(np.intp), second.astype(np.intp)


def check_extents(bodies: Bodies, axes: Axes, pose: FloatArray, spheres: _Indices) -> None:
    """Raise `ShapeError` naming the body whose extents can't be used."""
    extent = pose[6:].take(axes.used, axis=0)
    if not extent.min(initial=np.inf) > 0.0:
        axis, body, scene = (int(i[0]) for i in np.nonzero(~(extent > 0.0)))
        raise ShapeError(
            f"object {bodies.names[body]!r}: extent s{WORLD[axes.used[axis]]} must be positive, "
            f"got {extent[axis, body, scene]}"
        )
    if len(spheres):
        sizes = extent.take(spheres, axis=1)
        spread = np.abs(sizes - sizes[0]).max(axis=0) > _ROUND * sizes[0]
        if spread.any():
            body, scene = (int(i[0]) for i in np.nonzero(spread))
            raise ShapeError(
                f"object {bodies.names[spheres[body]]!r} is a sphere, but its extents are "
                f"{sizes[:, body, scene].tolist()}; make them equal or use another shape"
            )


@dataclass(frozen=True, slots=True)
class _Work:
    """Pairs of one kind: their numbers, their bodies in the order the kernel takes them, and the normals' sign."""

    pairs: _Indices
    a: _Indices
    b: _Indices
    sign: FloatArray


@dataclass(frozen=True, slots=True)
class _Memo:
    pose: FloatArray
    solids: Any
    measured: Measured


class ArrayGeometry:
    """Exact geometry of one layout in arrays.

    A scene's result doesn't depend on its batch, down to the last bit, nor on the objects' order (distances to the
    last bit, normals unless several are equally short ways out). For single scenes, pairs whose two bodies stand as
    in the scene before are not measured again; that too leaves the bits alone.

    Parameters
    ----------
    axes
        The schema's axes.
    bodies
        The layout's bodies.
    """

    def __init__(self, axes: Axes, bodies: Bodies) -> None:
        self._axes, self._bodies = axes, bodies
        round_ = np.array([isinstance(shape, Sphere) for shape in bodies.shapes], dtype=bool)
        self._spheres: _Indices = np.flatnonzero(round_)
        self._polyhedra: _Indices = np.flatnonzero(~round_)
        self._slot: _Indices = np.cumsum(~round_) - 1
        cornered = [shape for shape in bodies.shapes if not isinstance(shape, Sphere)]
        self._kernel: Planar | Solid = (Planar if axes.planar else Solid)(axes, cornered)
        self._used = np.array(axes.used)
        self._first, self._second = pairs_of(len(bodies.shapes))
        self._kind = round_[self._first].astype(int) + round_[self._second]
        self._plans: dict[bytes, tuple[_Work, _Work, _Work]] = {}
        self._memo: _Memo | None = None

    def measure(self, pose: FloatArray) -> Measured:
        """Measure n scenes (`Geometry.measure`). Cost: about 1 us a scene for a ball among six boxes."""
        single = pose.shape[2] == 1
        if single and self._memo is not None:
            return self._again(pose, self._memo)
        check_extents(self._bodies, self._axes, pose, self._spheres)
        solids = self._place(pose)
        pairs, size = len(self._first), pose.shape[2]
        distance, normal = np.empty((pairs, size)), np.empty((len(self._used), pairs, size))
        self._fill(pose, solids, np.ones(pairs, dtype=bool), distance, normal)
        measured = Measured(distance, normal, *self._bounds(pose, solids))
        if single:
            self._memo = _Memo(pose, solids, measured)
        return measured

    def _again(self, pose: FloatArray, memo: _Memo) -> Measured:
        """Measure one scene, given the one before."""
        moved = (pose != memo.pose).any(axis=0)[:, 0]
        if not moved.any():
            return memo.measured
        check_extents(self._bodies, self._axes, pose, self._spheres)
        solids = self._place(pose) if moved.take(self._polyhedra).any() else memo.solids
        distance, normal = memo.measured.distance.copy(), memo.measured.normal.copy()
        stale = moved.take(self._first) | moved.take(self._second)
        self._fill(pose, solids, stale, distance, normal)
        measured = Measured(distance, normal, *self._bounds(pose, solids))
        self._memo = _Memo(pose, solids, measured)
        return measured

    def _place(self, pose: FloatArray) -> Any:
        return self._kernel.place(pose.take(self._polyhedra, axis=1))

    def _fill(
        self,
        pose: FloatArray,
        solids: Any,
        stale: NDArray[np.bool_],
        distance: FloatArray,
        normal: FloatArray,
    ) -> None:
        position, radius = pose.take(self._used, axis=0), 0.5 * pose[6 + self._used[0]]
        loose, mixed, flat = self._plan(stale)
        for work in (w for w in (loose, mixed, flat) if len(w.pairs)):
            offset = position.take(work.a, axis=1) - position.take(work.b, axis=1)
            if work is loose:
                found = _sphere_sphere(offset, radius.take(work.a, axis=0) + radius.take(work.b, axis=0))
            elif work is mixed:
                solid = solids.take(self._slot.take(work.b))
                found = self._kernel.sphere_solid(offset, radius.take(work.a, axis=0), solid)
            else:
                a, b = (solids.take(self._slot.take(side)) for side in (work.a, work.b))
                found = self._kernel.solid_solid(offset, a, b)
            distance[work.pairs], normal[:, work.pairs] = found[0], found[1] * work.sign

    def _plan(self, stale: NDArray[np.bool_]) -> tuple[_Work, _Work, _Work]:
        key = stale.tobytes()
        if (plan := self._plans.get(key)) is None:
            if len(self._plans) >= _MAX_PLANS:
                self._plans.clear()
            flat, mixed, loose = (
                self._work(np.flatnonzero(stale & (self._kind == kind))) for kind in range(3)
            )
            plan = self._plans[key] = (loose, mixed, flat)
        return plan

    def _work(self, pairs: _Indices) -> _Work:
        a, b = self._first[pairs], self._second[pairs]
        # Kernels take the sphere of a mixed pair first.
        swap = np.isin(b, self._spheres) & ~np.isin(a, self._spheres)
        sign = np.where(swap, -1.0, 1.0)[:, None]
        return _Work(pairs, np.where(swap, b, a), np.where(swap, a, b), sign)

    def _bounds(self, pose: FloatArray, solids: Any) -> tuple[FloatArray, FloatArray]:
        shape = (len(self._used), *pose.shape[1:])
        low, high = np.empty(shape), np.empty(shape)
        if len(self._spheres):
            radius = 0.5 * pose[6 + self._used[0]].take(self._spheres, axis=0)
            low[:, self._spheres], high[:, self._spheres] = -radius, radius
        if len(self._polyhedra):
            low[:, self._polyhedra], high[:, self._polyhedra] = self._kernel.bounds(solids)
        return low, high


def _sphere_sphere(offset: FloatArray, reach: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Signed distance and normal of spheres; the last axis (up, in the plane) where centres coincide."""
    length = norm(offset)
    apart = length > 0.0
    normal = offset / np.where(apart, length, 1.0)
    normal[-1] = np.where(apart, normal[-1], 1.0)
    return length - reach, normal
