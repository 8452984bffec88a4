"""Distances and normals of all pairs of bodies, batched over scenes with the same objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ShapeError
from relgym.scene.axes import WORLD, Axes
from relgym.scene.geometry.planar import Planar
from relgym.scene.geometry.simple import aligned_boxes, spheres
from relgym.scene.geometry.solid import Solid
from relgym.scene.geometry.vectors import FloatArray, dot
from relgym.scene.shapes import Box, Compound, Prism, Shape, Sphere

__all__ = ["ArrayGeometry", "Bodies", "Geometry", "Measured", "Solids", "check_extents", "pairs_of"]

_Indices: TypeAlias = NDArray[np.intp]
_Found: TypeAlias = tuple[FloatArray, FloatArray]

_ROUND = 1e-9
"""Relative difference of extents above which a sphere is no sphere."""

_SOLIDS, _MIXED, _SPHERES, _BOXES, _COMPOUNDS = range(
    5
)  # of pairs: the first three are the number of spheres

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
    """Pairs of one kind: numbers, bodies in the order the kernel takes them, sign of the normals."""

    pairs: _Indices
    a: _Indices
    b: _Indices
    sign: FloatArray


class Solids:
    """The polyhedra of n scenes, placed when they are needed: closed forms do without."""

    def __init__(self, kernel: Planar | Solid, pose: FloatArray, turned: NDArray[np.bool_]) -> None:
        self._kernel, self._pose, self._turned = kernel, pose, turned
        self._placed: Any = None

    @property
    def placed(self) -> Any:
        """What the kernel made of them."""
        if self._placed is None:
            self._placed = self._kernel.place(self._pose)
        return self._placed

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lows and highs of their bounding boxes relative to the positions, shape ``(d, B, n)`` each."""
        if self._placed is None and not self._turned.any():
            return self._kernel.upright(self._pose)
        return self._kernel.bounds(self.placed)


@dataclass(frozen=True, slots=True)
class _Memo:
    pose: FloatArray
    solids: Solids
    measured: Measured


class ArrayGeometry:
    """Exact geometry of one layout in arrays.

    A scene's result doesn't depend on its batch, down to the last bit. Nor does it depend on the objects'
    order: distances in the plane to the last bit, in space to rounding, and normals unless several ways out
    are equally short. For single scenes, pairs whose two bodies stand as in the scene before are not measured
    again; that too leaves the bits alone.

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
        # Of a compound each part is placed on its own; what is cornered has one or more of them.
        parts = [_parts(shape) for shape in bodies.shapes]
        self._count: _Indices = np.array([len(own) for own in parts], dtype=np.intp)
        self._polyhedra: _Indices = np.repeat(np.arange(len(parts)), self._count)
        self._slot: _Indices = np.cumsum(self._count) - self._count
        self._starts: _Indices = self._slot[self._count > 0]
        cornered = [part for own in parts for part in own]
        if not axes.planar and (self._count > 1).any():
            name = bodies.names[int(self._count.argmax())]
            raise ShapeError(
                f"object {name!r} is a compound of polygons: use a planar schema, or one part per type"
            )
        self._kernel: Planar | Solid = (Planar if axes.planar else Solid)(axes, cornered)
        self._used = np.array(axes.used)
        self._turns = np.array([3 + axes.depth] if axes.planar else [3, 4, 5])
        self._first, self._second = pairs_of(len(bodies.shapes))
        boxes = np.array([isinstance(shape, Box) for shape in bodies.shapes], dtype=bool)
        self._kind = round_[self._first].astype(int) + round_[self._second]
        self._kind[boxes[self._first] & boxes[self._second]] = _BOXES
        self._kind[(self._count[self._first] > 1) | (self._count[self._second] > 1)] = _COMPOUNDS
        self._plans: dict[bytes, tuple[tuple[int, _Work], ...]] = {}
        self._memo: _Memo | None = None

    def measure(self, pose: FloatArray) -> Measured:
        """Measure n scenes (`Geometry.measure`). Cost: about 3 us a scene of seven planar bodies."""
        single = pose.shape[2] == 1
        if single and self._memo is not None:
            return self._again(pose, self._memo)
        solids = self.place(pose)
        pairs, size = len(self._first), pose.shape[2]
        distance, normal = np.empty((pairs, size)), np.empty((len(self._used), pairs, size))
        self.fill(pose, solids, np.ones(pairs, dtype=bool), distance, normal)
        measured = Measured(distance, normal, *self.bounds(pose, solids))
        if single:
            self._memo = _Memo(pose, solids, measured)
        return measured

    def _again(self, pose: FloatArray, memo: _Memo) -> Measured:
        """Measure one scene, given the one before."""
        moved = (pose != memo.pose).any(axis=0)[:, 0]
        if not moved.any():
            return memo.measured
        if moved.take(self._polyhedra).any():
            solids = self.place(pose)
        else:
            check_extents(self._bodies, self._axes, pose, self._spheres)
            solids = memo.solids
        distance, normal = memo.measured.distance.copy(), memo.measured.normal.copy()
        stale = moved.take(self._first) | moved.take(self._second)
        self.fill(pose, solids, stale, distance, normal)
        measured = Measured(distance, normal, *self.bounds(pose, solids))
        self._memo = _Memo(pose, solids, measured)
        return measured

    def place(self, pose: FloatArray) -> Solids:
        """Check the extents of n scenes and take up their polyhedra, for `fill` and `bounds`."""
        check_extents(self._bodies, self._axes, pose, self._spheres)
        cornered = pose.take(self._polyhedra, axis=1)
        return Solids(self._kernel, cornered, cornered.take(self._turns, axis=0) != 0.0)

    def fill(
        self,
        pose: FloatArray,
        solids: Solids,
        stale: NDArray[np.bool_],
        distance: FloatArray,
        normal: FloatArray,
    ) -> None:
        """Measure the pairs that `stale`, shape ``(P,)``, marks; write to ``(P, n)`` and ``(d, P, n)``."""
        position, radius = pose.take(self._used, axis=0), 0.5 * pose[6 + self._used[0]]
        for kind, work in self._plan(stale):
            offset = position.take(work.a, axis=1) - position.take(work.b, axis=1)
            if kind == _SPHERES:
                found = spheres(offset, radius.take(work.a, axis=0) + radius.take(work.b, axis=0))
            elif kind == _MIXED:
                solid = solids.placed.take(self._slot.take(work.b))
                found = self._kernel.sphere_solid(offset, radius.take(work.a, axis=0), solid)
            elif kind == _BOXES:
                found = self._boxes(pose, solids, work, offset)
            elif kind == _COMPOUNDS:
                found = self._compounds(solids, work, offset, radius)
            else:
                found = self._solids(solids, work, offset)
            distance[work.pairs], normal[:, work.pairs] = found[0], found[1] * work.sign

    def _boxes(self, pose: FloatArray, solids: Solids, work: _Work, offset: FloatArray) -> _Found:
        """Closed form for those scenes where neither box is rotated: exact, and much cheaper in space."""
        turned = pose.take(self._turns, axis=0).any(axis=0)
        half = 0.5 * pose[6:].take(self._used, axis=0)
        simple = aligned_boxes(offset, half.take(work.a, axis=1) + half.take(work.b, axis=1))
        skew = turned.take(work.a, axis=0) | turned.take(work.b, axis=0)
        if not skew.any():
            return simple
        distance, normal = self._solids(solids, work, offset)
        return np.where(skew, distance, simple[0]), np.where(skew, normal, simple[1])

    def _compounds(self, solids: Solids, work: _Work, offset: FloatArray, radius: FloatArray) -> _Found:
        """The nearest parts decide; where parts overlap, those that do so farthest."""
        distance = np.full(offset.shape[1:], np.inf)
        normal = np.zeros(offset.shape)
        for p in range(max(1, int(self._count[work.a].max()))):
            for q in range(int(self._count[work.b].max())):
                round_ = self._count[work.a] == 0
                for some, is_round in (
                    (round_ & (p == 0), True),
                    (~round_ & (p < self._count[work.a]), False),
                ):
                    rows = np.flatnonzero(some & (q < self._count[work.b]))
                    if not len(rows):
                        continue
                    b = solids.placed.take(self._slot[work.b[rows]] + q)
                    if is_round:
                        found = self._kernel.sphere_solid(
                            offset[:, rows], radius.take(work.a[rows], axis=0), b
                        )
                    else:
                        a = solids.placed.take(self._slot[work.a[rows]] + p)
                        found = self._kernel.solid_solid(offset[:, rows], a, b)
                    nearer = found[0] < distance[rows]
                    distance[rows] = np.where(nearer, found[0], distance[rows])
                    normal[:, rows] = np.where(nearer, found[1], normal[:, rows])
        return distance, normal

    def _solids(self, solids: Solids, work: _Work, offset: FloatArray) -> _Found:
        a, b = (solids.placed.take(self._slot.take(side)) for side in (work.a, work.b))
        return self._kernel.solid_solid(offset, a, b)

    def unsettled(self, pairs: NDArray[np.bool_]) -> _Indices:
        """Those of the pairs that `pairs` marks whose distance takes long to find: two polyhedra, not both boxes."""
        return np.flatnonzero(pairs & (self._kind == _SOLIDS))

    def fill_some(
        self,
        pose: FloatArray,
        solids: Solids,
        pairs: _Indices,
        chosen: NDArray[np.bool_],
        distance: FloatArray,
        normal: FloatArray,
    ) -> None:
        """Measure `unsettled` pairs in some scenes only.

        Parameters
        ----------
        pose, solids
            As for `fill`.
        pairs
            Their numbers, shape ``(p,)``.
        chosen
            In which scenes each of them is measured, shape ``(p, n)``.
        distance, normal
            What is written to, shape ``(P, n)`` and ``(d, P, n)``.
        """
        which, scenes = np.nonzero(chosen)
        if not len(which):
            return
        number = pairs[which]
        sides = self._first[number], self._second[number]
        position = pose.take(self._used, axis=0)
        offset = (position[:, sides[0], scenes] - position[:, sides[1], scenes])[:, None]
        a, b = (solids.placed.pick(self._slot[side], scenes) for side in sides)
        found = self._kernel.solid_solid(offset, a, b)
        distance[number, scenes], normal[:, number, scenes] = found[0][0], found[1][:, 0]

    def supports(self, solids: Solids, directions: FloatArray, bodies: _Indices) -> FloatArray:
        """Least component of bodies' points along directions ``(d, P)``, in one scene.

        Relative to their positions; a sphere counts as its centre.
        """
        lowest = np.zeros(len(bodies))
        for part in range(int(self._count.max(initial=0))):
            cornered = np.flatnonzero(self._count[bodies] > part)
            slots = self._slot[bodies[cornered]] + part
            corners = self._kernel.corners(solids.placed).take(slots, axis=2)[..., 0]
            least = dot(directions[:, None, cornered], corners).min(axis=0)
            lowest[cornered] = np.minimum(lowest[cornered], least) if part else least
        return lowest

    def _plan(self, stale: NDArray[np.bool_]) -> tuple[tuple[int, _Work], ...]:
        key = stale.tobytes()
        if (plan := self._plans.get(key)) is None:
            if len(self._plans) >= _MAX_PLANS:
                self._plans.clear()
            works = ((kind, self._work(np.flatnonzero(stale & (self._kind == kind)))) for kind in range(5))
            plan = self._plans[key] = tuple((kind, work) for kind, work in works if len(work.pairs))
        return plan

    def _work(self, pairs: _Indices) -> _Work:
        a, b = self._first[pairs], self._second[pairs]
        # Kernels take the sphere of a mixed pair first.
        swap = np.isin(b, self._spheres) & ~np.isin(a, self._spheres)
        sign = np.where(swap, -1.0, 1.0)[:, None]
        return _Work(pairs, np.where(swap, b, a), np.where(swap, a, b), sign)

    def bounds(self, pose: FloatArray, solids: Solids) -> tuple[FloatArray, FloatArray]:
        """Lows and highs of the bounding boxes relative to the positions, shape ``(d, K, n)`` each."""
        shape = (len(self._used), *pose.shape[1:])
        low, high = np.empty(shape), np.empty(shape)
        if len(self._spheres):
            radius = 0.5 * pose[6 + self._used[0]].take(self._spheres, axis=0)
            low[:, self._spheres], high[:, self._spheres] = -radius, radius
        if len(self._polyhedra):
            lows, highs = solids.bounds()
            cornered = self._polyhedra[self._starts]
            if len(cornered) < len(self._polyhedra):
                lows = np.minimum.reduceat(lows, self._starts, axis=1)
                highs = np.maximum.reduceat(highs, self._starts, axis=1)
            low[:, cornered], high[:, cornered] = lows, highs
        return low, high


def _parts(shape: Shape) -> tuple[Shape, ...]:
    """What the kernels place of a shape: nothing of a sphere, each part of a compound."""
    if isinstance(shape, Sphere):
        return ()
    return tuple(Prism(part) for part in shape.parts) if isinstance(shape, Compound) else (shape,)
