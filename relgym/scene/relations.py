"""Spatial relations of all pairs of bodies, extracted from batches of scenes (§3.4; design §4).

Binary relations, for bodies A and B (`box_relations` has the exact definitions of those on bounding boxes):

=================== =========================================================================================
intersect           signed distance <= `TOUCH_EPS`: touching or overlapping
approaching         touching, not separating (`APPROACH_EPS`), and at least one of the types has a velocity
approaching-fastest approaching, and A approaches no other body faster: of several contacts this one is decisive
on-top              A's bottom is about at B's top, a tenth of A's extent lies over B, and they touch
smaller-than        B's bounding box has a diagonal more than 1.1 times as long
x-less-than         A is left of B, up to 5 % of the smaller extent; likewise y and z, but no depth axis
x-greater-than      A is right of B
x-aligned           neither
=================== =========================================================================================

Beside them, every type name and every ancestor of one is a unary relation.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError, ObservationError, SchemaError
from relgym.scene import contacts
from relgym.scene.axes import Axes
from relgym.scene.boxes import box_relations
from relgym.scene.context import close_set
from relgym.scene.geometry.arrays import ArrayGeometry, Bodies, Geometry, pairs_of
from relgym.scene.geometry.vectors import FloatArray, dot
from relgym.scene.objects import Float2D, SceneLayout, SceneSchema, pose_columns
from relgym.scene.unary import unary, unary_names

__all__ = ["TOUCH_EPS", "Extractor", "Relations", "unary"]

TOUCH_EPS = 1e-9
"""Signed distance, in units of length, up to which two bodies touch (the original's threshold)."""

_CHUNK = 16_000
"""Pairs of bodies measured at a time: keeps intermediate arrays in the processor's cache."""

_Table: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Index arrays of a layout: its P pairs, and where pair (a, b) lies among them (P on the diagonal)."""

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    number: NDArray[np.intp]

    @classmethod
    def of(cls, count: int) -> _Pairs:
        first, second = pairs_of(count)
        number = np.full((count, count), len(first), dtype=np.intp)
        number[first, second] = number[second, first] = np.arange(len(first))
        return cls(first, second, number)


@dataclass(frozen=True, slots=True)
class Relations:
    """Binary relations and contacts of n scenes with the same objects.

    Bodies are numbered as in ``layout.bodies`` (K of them): number k is the object ``layout.bodies[k]``.

    Parameters
    ----------
    layout
        The scenes' layout.
    names
        Names of the relations, alphabetical (R of them).
    table
        Which relation holds for which ordered pair, shape ``(n, R, K, K)``; False on the diagonal.
    distance
        Signed distances, shape ``(n, K, K)``; symmetric, infinite on the diagonal.
    """

    layout: SceneLayout
    names: tuple[str, ...]
    table: _Table
    distance: FloatArray
    _normal: FloatArray = field(repr=False)  # (d, P, n), from the second body of a pair to the first
    _velocity: FloatArray = field(repr=False)  # (d, K, n)
    _pairs: _Pairs = field(repr=False)

    def __len__(self) -> int:
        return len(self.table)

    def rows(self, chosen: slice | NDArray[np.intp] | NDArray[np.bool_]) -> Relations:
        """Relations of some of the scenes."""
        return replace(
            self,
            table=self.table[chosen],
            distance=self.distance[chosen],
            _normal=self._normal[..., chosen],
            _velocity=self._velocity[..., chosen],
        )

    def relation(self, name: str) -> _Table:
        """One relation's table, shape ``(n, K, K)``."""
        return self.table[:, self.names.index(name)]

    def context(self, body: int) -> _Table:
        """Return the target's close set (`close_set`), shape ``(n, K)``."""
        return close_set(self.relation("intersect")[:, body], self.distance[:, body], body)

    def normals(self, body: int) -> FloatArray:
        """Return the unit normals from each other body to this one, shape ``(n, K, d)``; NaN for itself."""
        return self._normals(body).transpose(2, 1, 0)

    def contacts(self, body: int) -> FloatArray:
        """Return the contact features (`contact_features`) of the pairs (body, other), shape ``(n, K, F)``.

        NaN for the body itself. Velocities are the scenes', in length per step.
        """
        normal = self._normals(body)
        relative = self._velocity[:, body, None] - self._velocity
        approach, slip = contacts.motion(relative, normal)
        out = np.empty((len(self), len(self._pairs.number), len(normal) + 3))
        out[..., 0] = self.distance[:, body]
        out[..., 1:-2] = normal.transpose(2, 1, 0)
        out[..., -2], out[..., -1] = approach.T, slip.T
        out[:, body] = np.nan
        return out

    def _normals(self, body: int) -> FloatArray:
        """Normals of the body's pairs, shape ``(d, K, n)``."""
        count = len(self._pairs.number)
        if count == 1:
            return np.full((len(self._normal), 1, len(self)), np.nan)
        numbers = np.minimum(self._pairs.number[body], len(self._pairs.first) - 1)
        signs = np.where(np.arange(count) > body, 1.0, -1.0)
        signs[body] = np.nan
        normals: FloatArray = self._normal.take(numbers, axis=1) * signs[:, None]
        return normals


@dataclass(frozen=True, slots=True)
class _Plan:
    """What extraction needs to know of a layout."""

    columns: NDArray[np.intp]  # (9, K) of a state vector with (0, 1) appended
    velocities: NDArray[np.intp]  # (d, K), likewise
    pairs: _Pairs
    moving: NDArray[np.intp]  # pairs in which at least one type has a velocity
    geometry: Geometry


class Extractor:
    """Extracts the relations of scenes; one per schema.

    It holds nothing but caches: results depend on the scenes alone, and a scene's are the same bits alone
    and in any batch. Pickles without its caches.

    Parameters
    ----------
    schema
        The schema of the scenes.
    geometry
        ``"arrays"``: batched NumPy, exact. ``"fcl"``: the Flexible Collision Library, scene by scene.
    eps
        Distance up to which bodies touch, in units of length. A larger value makes near bodies touch.

    Raises
    ------
    ConfigError
        An unknown geometry.
    SchemaError
        A type has the name of a spatial relation.
    """

    def __init__(
        self, schema: SceneSchema, *, geometry: Literal["arrays", "fcl"] = "arrays", eps: float = TOUCH_EPS
    ) -> None:
        if geometry not in ("arrays", "fcl"):
            raise ConfigError(f"geometry must be 'arrays' or 'fcl', got {geometry!r}")
        self.schema, self.geometry, self.eps = schema, geometry, eps
        self.axes = Axes.of(schema)
        per_axis = [
            f"{axis}-{kind}" for axis in self.axes.names for kind in ("less-than", "greater-than", "aligned")
        ]
        contact = ["approaching", "approaching-fastest", "intersect"]
        self.names = tuple(sorted([*contact, "on-top", "smaller-than", *per_axis]))
        self.features = contacts.contact_features(schema)
        self.unary_names = unary_names(schema)
        for name in self.unary_names:
            if name in self.names:
                raise SchemaError(f"type name {name!r} is the name of a spatial relation; rename the type")
        self._plans: dict[tuple[str, ...], _Plan] = {}

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_plans": {}}

    def extract(self, layout: SceneLayout, vectors: Float2D) -> Relations:
        """Extract the relations of n scenes.

        Parameters
        ----------
        layout
            Layout of all n scenes.
        vectors
            State vectors, shape ``(n, layout.width)``.

        Raises
        ------
        ObservationError
            The vectors' shape doesn't fit the layout.
        ShapeError
            An extent isn't positive, or a sphere isn't round; the message names the object.

        Notes
        -----
        Cost: about 0.1 ms for one scene of seven objects, 5 us each in a batch.
        """
        if vectors.ndim != 2 or vectors.shape[1] != layout.width:
            raise ObservationError(
                f"expected state vectors of shape (n, {layout.width}) for {layout.names}, got {vectors.shape}"
            )
        plan = self._plan(layout)
        chunk = max(1, _CHUNK // max(1, plan.pairs.number.size))
        if len(vectors) <= chunk:
            return self._extract(layout, plan, vectors)
        parts = [self._extract(layout, plan, vectors[i : i + chunk]) for i in range(0, len(vectors), chunk)]
        return Relations(
            layout,
            self.names,
            np.concatenate([p.table for p in parts]),
            np.concatenate([p.distance for p in parts]),
            np.concatenate([p._normal for p in parts], axis=-1),
            np.concatenate([p._velocity for p in parts], axis=-1),
            plan.pairs,
        )

    def unary(self, layout: SceneLayout) -> dict[str, _Table]:
        """Return the unary relations of a layout's bodies (`unary`)."""
        return unary(self.schema, layout)

    def _extract(self, layout: SceneLayout, plan: _Plan, vectors: Float2D) -> Relations:
        padded = np.concatenate([vectors, np.broadcast_to(_CONSTANTS, (len(vectors), 2))], axis=1).T
        pose, velocity = padded.take(plan.columns, axis=0), padded.take(plan.velocities, axis=0)
        measured = plan.geometry.measure(pose)
        beyond = np.full((1, len(vectors)), np.inf)
        distance = np.concatenate([measured.distance, beyond]).take(plan.pairs.number, axis=0)
        touching = distance <= self.eps
        found = box_relations(
            self.axes, pose.take(self.axes.used, axis=0), measured.low, measured.high, touching
        )
        found["intersect"] = touching
        closing = self._closing(plan, measured.distance, measured.normal, velocity)
        found["approaching"] = closing < np.inf
        decisive = closing.min(axis=1, initial=np.inf, keepdims=True) + contacts.APPROACH_EPS
        found["approaching-fastest"] = found["approaching"] & (closing <= decisive)
        table = np.empty((len(vectors), len(self.names), *plan.pairs.number.shape), dtype=bool)
        for r, name in enumerate(self.names):
            table[:, r] = found[name].transpose(2, 0, 1)
        table &= ~np.eye(len(plan.pairs.number), dtype=bool)
        between = np.ascontiguousarray(distance.transpose(2, 0, 1))
        return Relations(layout, self.names, table, between, measured.normal, velocity, plan.pairs)

    def _closing(
        self, plan: _Plan, distance: FloatArray, normal: FloatArray, velocity: FloatArray
    ) -> FloatArray:
        """Normal velocities of touching pairs that don't separate, infinite for the others, shape ``(K, K, n)``."""
        closing = np.full((len(distance) + 1, distance.shape[1]), np.inf)
        pairs, moving = plan.pairs, plan.moving
        if len(moving):
            relative = velocity.take(pairs.first[moving], axis=1) - velocity.take(
                pairs.second[moving], axis=1
            )
            speed = dot(relative, normal.take(moving, axis=1))
            near = (speed <= contacts.APPROACH_EPS) & (distance.take(moving, axis=0) <= self.eps)
            closing[moving] = np.where(near, speed, np.inf)
        return closing.take(pairs.number, axis=0)

    def _plan(self, layout: SceneLayout) -> _Plan:
        if (plan := self._plans.get(layout.names)) is None:
            plan = self._plans[layout.names] = self._make_plan(layout)
        return plan

    def _make_plan(self, layout: SceneLayout) -> _Plan:
        names = tuple(layout.names[i] for i in layout.bodies)
        shapes = tuple(shape for i in layout.bodies if (shape := layout.types[i].shape) is not None)
        velocities = contacts.velocity_columns(layout, self.axes)
        moves = np.asarray((velocities >= 0).any(axis=0))
        pairs = _Pairs.of(len(names))
        return _Plan(
            np.ascontiguousarray(pose_columns(layout)[0].T),
            np.where(velocities < 0, layout.width, velocities),
            pairs,
            np.flatnonzero(moves[pairs.first] | moves[pairs.second]),
            self._make_geometry(Bodies(names, shapes)),
        )

    def _make_geometry(self, bodies: Bodies) -> Geometry:
        if self.geometry == "arrays":
            return ArrayGeometry(self.axes, bodies)
        from relgym.scene.geometry.fcl import FclGeometry

        return FclGeometry(self.axes, bodies)


_CONSTANTS = np.array([0.0, 1.0])
"""What `pose_columns` appends to a state vector: components that no property supplies."""
