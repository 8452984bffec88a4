"""What can be told of n scenes with the same bodies: distances, normals, boxes; measured when asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.scene.axes import Axes
from relgym.scene.boxes import BoxRelations
from relgym.scene.contacts import APPROACH_EPS
from relgym.scene.geometry.arrays import ArrayGeometry, Geometry, Measured, pairs_of
from relgym.scene.geometry.vectors import FloatArray, dot

__all__ = ["Measurements", "Pairs", "Plan", "square"]

_CLEAR = 1e-6
_LENGTHS = [0, 1, 2, 6, 7, 8]  # of a pose: place and size; angles are no lengths
"""Gap between bounding boxes, in units of length, above which two bodies can't touch, whatever rounding does."""

_Bools: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Pairs:
    """Index arrays of a layout: its P pairs, and where pair (a, b) lies among them (P on the diagonal)."""

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    number: NDArray[np.intp]
    others: _Bools  # False on the diagonal, shape (K, K)

    @classmethod
    def of(cls, count: int) -> Pairs:
        """Return the pairs of so many bodies."""
        first, second = pairs_of(count)
        number = np.full((count, count), len(first), dtype=np.intp)
        number[first, second] = number[second, first] = np.arange(len(first))
        return cls(first, second, number, ~np.eye(count, dtype=np.bool_))

    def among(self, a: NDArray[np.intp] | int, b: NDArray[np.intp] | int) -> _Bools:
        """Mask of the pairs (a, b), shape ``(P,)``; pairs of a body with itself are left out."""
        mask = np.zeros(len(self.first) + 1, dtype=np.bool_)
        mask[self.number[a, b]] = True
        return mask[:-1]


@dataclass(frozen=True, slots=True)
class Plan:
    """What must be known of a layout to look at its scenes."""

    axes: Axes
    columns: NDArray[np.intp]  # (9, K) of a state vector with (0, 1) appended
    velocities: NDArray[np.intp]  # (d, K), likewise
    pairs: Pairs
    moving: NDArray[np.intp]  # pairs in which at least one type has a velocity
    geometry: Geometry
    offsets: bool = False  # whether contact features hold them


class Measurements:
    """Geometry of n scenes, pair by pair and as it is asked for; what was measured is kept.

    A pair's numbers are the same bits whenever and however they are come by. All arrays have scenes last.

    Parameters
    ----------
    plan
        What is known of the layout.
    vectors
        State vectors, shape ``(n, width)``.
    eps
        Distance up to which bodies touch.
    precision
        Relative precision of the numbers (`SceneSchema.precision`): what is no farther off touches, and what is no
        faster doesn't part.

    Attributes
    ----------
    touch, parting
        Distance up to which bodies touch, and speed up to which they don't part; where numbers are coarse for each
        pair, by its own places, sizes and velocities, shape ``(P, n)``.

    Raises
    ------
    ShapeError
        An extent isn't positive, or a sphere isn't round.
    """

    def __init__(self, plan: Plan, vectors: FloatArray, eps: float, precision: float = 0.0) -> None:
        padded = np.concatenate([vectors, np.broadcast_to(_CONSTANTS, (len(vectors), 2))], axis=1).T
        self.vectors, self.eps, self.precision = vectors, eps, precision
        self._plan, self.pairs = plan, plan.pairs
        self.pose: FloatArray = padded.take(plan.columns, axis=0)
        self.velocity: FloatArray = padded.take(plan.velocities, axis=0)
        self.touch = self._limit(eps, self.pose[_LENGTHS]) if precision else eps
        self.parting = self._limit(APPROACH_EPS, self.velocity) if precision else APPROACH_EPS
        shape = (len(plan.pairs.first), len(vectors))
        self._touching: _Bools | None = None
        self._closing: FloatArray | None = None
        if len(vectors) != 1 and isinstance(plan.geometry, ArrayGeometry):
            self._arrays: ArrayGeometry | None = plan.geometry
            self._exact, self._told = np.zeros((2, shape[0]), dtype=np.bool_)
            self._touches = np.zeros(shape, dtype=np.bool_)
            self._solids = plan.geometry.place(self.pose)
            # Normals of all pairs are multiplied by signs, measured or not: what lies in memory may be no number.
            distance, normal = np.empty(shape), np.zeros((len(plan.axes.used), *shape))
            self._measured = Measured(distance, normal, *plan.geometry.bounds(self.pose, self._solids))
        else:  # a single scene is compared with the one before, and fcl looks at whole scenes
            self._arrays = None
            self._measured = plan.geometry.measure(self.pose)
        position = self.pose.take(plan.axes.used, axis=0)
        self.boxes = BoxRelations(plan.axes, position, self._measured.low, self._measured.high)

    def _limit(self, least: float, numbers: FloatArray) -> float | FloatArray:
        """What coarse numbers, shape ``(…, K, n)``, add to a limit, pair by pair, shape ``(P, n)``."""
        size = np.abs(numbers).max(axis=0, initial=1.0)
        pairs = self.pairs
        found: FloatArray = least + self.precision * np.maximum(size[pairs.first], size[pairs.second])
        return found

    # ------------------------------------------------------------------ distances and normals
    def measured(self, pairs: _Bools) -> Measured:
        """The geometry, in which the pairs that the mask marks are measured; others may hold anything."""
        if self._arrays is not None and (missing := pairs & ~self._exact).any():
            self._arrays.fill(
                self.pose, self._solids, missing, self._measured.distance, self._measured.normal
            )
            self._exact |= missing
        return self._measured

    def every(self) -> Measured:
        """The geometry of all pairs."""
        return self.measured(np.ones(len(self._plan.pairs.first), dtype=np.bool_))

    def of(self, body: int) -> Measured:
        """The geometry, in which a body's pairs are measured."""
        if self._arrays is None:
            return self._measured
        return self.measured(self._plan.pairs.among(body, np.arange(len(self._plan.pairs.number))))

    # ------------------------------------------------------------------ contacts
    def touches(self, pairs: _Bools) -> _Bools:
        """Whether bodies touch, shape ``(P, n)``; pairs that the mask doesn't mark may hold anything.

        Of polyhedra only those are measured whose bounding boxes meet.
        """
        if self._arrays is None:
            return self._measured.distance <= self.touch
        missing = pairs & ~self._told
        if not missing.any():
            return self._touches
        slow = self._arrays.unsettled(missing & ~self._exact)
        near = missing.copy()
        near[slow] = False
        self._touches[near] = self.measured(near).distance[near] <= _some(self.touch, near)
        if len(slow):
            meet = self._meet(slow)
            m = self._measured
            self._arrays.fill_some(self.pose, self._solids, slow, meet, m.distance, m.normal)
            self._touches[slow] = meet & (np.where(meet, m.distance[slow], np.inf) <= _some(self.touch, slow))
        self._told |= missing
        return self._touches

    def near(self, pairs: _Bools) -> _Bools:
        """Whether bodies may touch, shape ``(P, n)``: where bounding boxes don't meet they surely don't.

        Pairs that the mask doesn't mark may hold anything.
        """
        if self._arrays is None:
            return self._measured.distance <= self.touch
        found, chosen = np.zeros_like(self._touches), np.flatnonzero(pairs)
        found[chosen] = self._meet(chosen)
        return found

    def touching(self) -> _Bools:
        """Which bodies touch, shape ``(K, K, n)``; none touches itself."""
        if self._touching is None:
            found = self.touches(np.ones(len(self._plan.pairs.first), dtype=np.bool_))
            self._touching = square(found, self._plan.pairs, False)
        return self._touching

    def _meet(self, pairs: NDArray[np.intp]) -> _Bools:
        """Whether the bounding boxes of some pairs meet, shape ``(p, n)``."""
        a, b = self._plan.pairs.first[pairs], self._plan.pairs.second[pairs]
        low, high = self._measured.low, self._measured.high
        meet = np.ones((len(pairs), self.pose.shape[2]), dtype=np.bool_)
        clear = np.maximum(_CLEAR, 2.0 * np.asarray(_some(self.touch, pairs)))
        for k, axis in enumerate(self._plan.axes.used):
            offset = self.pose[axis, a] - self.pose[axis, b]
            meet &= (low[k, a] + offset - high[k, b] <= clear) & (low[k, b] - offset - high[k, a] <= clear)
        return meet

    def closing(self) -> FloatArray:
        """Normal velocities of touching pairs that don't separate, infinite for the others, ``(K, K, n)``."""
        if self._closing is None:
            self._closing = self._normal_speed()
        return self._closing

    def _normal_speed(self) -> FloatArray:
        pairs, moving = self._plan.pairs, self._plan.moving
        closing = np.full((len(pairs.first), self.pose.shape[2]), np.inf)
        if len(moving):
            mask = np.zeros(len(pairs.first), dtype=np.bool_)
            mask[moving] = True
            found = self.measured(mask)
            relative = self.velocity.take(pairs.first[moving], axis=1) - self.velocity.take(
                pairs.second[moving], axis=1
            )
            speed = dot(relative, found.normal.take(moving, axis=1))
            near = found.distance.take(moving, axis=0) <= _some(self.touch, moving)
            near &= speed <= _some(self.parting, moving)
            closing[moving] = np.where(near, speed, np.inf)
        return square(closing, pairs, np.inf)


def _some(limit: float | FloatArray, pairs: NDArray[Any]) -> float | FloatArray:
    """Limits of some pairs; one for all stays so."""
    return limit[pairs] if isinstance(limit, np.ndarray) else limit


def square(found: NDArray[Any], pairs: Pairs, diagonal: float | bool) -> NDArray[Any]:
    """Values of pairs, ``(P, n)``, as a symmetric table ``(K, K, n)``."""
    beyond = np.full((1, found.shape[1]), diagonal, dtype=found.dtype)
    return np.concatenate([found, beyond]).take(pairs.number, axis=0)


_CONSTANTS = np.array([0.0, 1.0])
"""What `pose_columns` appends to a state vector: components that no property supplies."""
