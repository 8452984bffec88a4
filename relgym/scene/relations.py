"""Spatial relations of all pairs of bodies, extracted from batches of scenes (§3.4).

Binary relations, for bodies A and B (`BoxRelations` has the exact definitions of those on bounding boxes):

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

from collections.abc import Collection, Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing, refusing_calls
from relgym.errors import ConfigError, ObservationError, QueryError, SchemaError
from relgym.scene import contacts
from relgym.scene.axes import Axes
from relgym.scene.boxes import axis_relations
from relgym.scene.context import close_set
from relgym.scene.geometry.arrays import ArrayGeometry, Bodies, Geometry
from relgym.scene.geometry.vectors import FloatArray
from relgym.scene.measurements import Measurements, Pairs, Plan, square
from relgym.scene.objects import Float2D, SceneLayout, pose_columns
from relgym.scene.schema import SceneSchema
from relgym.scene.unary import unary, unary_names

__all__ = ["TOUCH_EPS", "Extractor", "Relations", "unary"]

TOUCH_EPS = 1e-9
"""Signed distance, in units of length, up to which two bodies touch (the original's threshold)."""

_CHUNK = 50_000
"""Pairs of bodies looked at together: keeps intermediate arrays in the processor's cache."""

_Table: TypeAlias = NDArray[np.bool_]


class Relations:
    """Binary relations and contacts of n scenes with the same objects, worked out when they are asked for.

    Bodies are numbered as in ``layout.bodies`` (K of them): number k is the object ``layout.bodies[k]``.

    Parameters
    ----------
    layout
        The scenes' layout.
    axes
        The schema's axes.
    names
        Names of the relations, alphabetical (R of them).
    chunks
        The scenes, in pieces.
    """

    def __init__(
        self,
        layout: SceneLayout,
        axes: Axes,
        names: tuple[str, ...],
        plan: Plan,
        chunks: Sequence[Measurements],
    ) -> None:
        self.layout, self.names = layout, names
        self._axes, self._plan = axes, plan
        self._chunks = tuple(chunks)
        self._size: int = sum(chunk.pose.shape[2] for chunk in self._chunks)
        self._kept: dict[str, _Table] = {}
        self._of: dict[int, FloatArray] = {}
        self._table: _Table | None = None
        self._distance: FloatArray | None = None

    def __len__(self) -> int:
        return self._size

    @property
    def table(self) -> _Table:
        """Which relation holds for which ordered pair, shape ``(n, R, K, K)``; False on the diagonal."""
        if self._table is None:
            for chunk in self._chunks:
                chunk.boxes.prepare()
            self._table = self._filled(self.names)
        return self._table

    def table_of(self, names: Collection[str]) -> _Table:
        """`table`, of which only the relations with these names are filled in; the others are False throughout."""
        return self._filled(names) if self._table is None else self._table

    def _filled(self, names: Collection[str]) -> _Table:
        count = len(self._plan.pairs.number)
        table = np.zeros((len(self), len(self.names), count, count), dtype=np.bool_)
        at = 0
        for chunk in self._chunks:
            rows = slice(at, at + chunk.pose.shape[2])
            at = rows.stop
            for r, name in enumerate(self.names):
                if name in names:
                    table[rows, r] = _found(self._axes, chunk, name).transpose(2, 0, 1)
        table &= self._plan.pairs.others
        return table

    def relation(self, name: str) -> _Table:
        """One relation's table, shape ``(n, K, K)``."""
        if self._table is not None:
            return self._table[:, self.names.index(name)]
        if (known := self._kept.get(name)) is None:
            parts = [_found(self._axes, chunk, name) for chunk in self._chunks]
            known = self._kept[name] = _joined(parts).transpose(2, 0, 1) & self._plan.pairs.others
        return known

    @property
    def distance(self) -> FloatArray:
        """Signed distances, shape ``(n, K, K)``; symmetric, infinite on the diagonal."""
        if self._distance is None:
            parts = [chunk.every().distance for chunk in self._chunks]
            both = np.concatenate([np.concatenate(parts, axis=1), np.full((1, len(self)), np.inf)])
            self._distance = np.ascontiguousarray(
                both.take(self._plan.pairs.number, axis=0).transpose(2, 0, 1)
            )
        return self._distance

    def distances(self, body: int) -> FloatArray:
        """Signed distances of one body, shape ``(n, K)``; infinite for itself."""
        if (known := self._of.get(body)) is None:
            parts = [chunk.of(body).distance for chunk in self._chunks]
            both = np.concatenate([_joined(parts), np.full((1, len(self)), np.inf)])
            known = self._of[body] = np.ascontiguousarray(both.take(self._plan.pairs.number[body], axis=0).T)
        return known

    def touching(self, first: NDArray[np.intp], second: NDArray[np.intp]) -> _Table:
        """Whether the bodies of some pairs touch, shape ``(n, len(first))``; a pair is of two bodies."""
        pairs = self._plan.pairs
        mask, numbers = pairs.among(first, second), pairs.number[first, second]
        parts = [chunk.touches(mask).take(numbers, axis=0) for chunk in self._chunks]
        return np.ascontiguousarray(_joined(parts).T)

    def near(self, first: NDArray[np.intp], second: NDArray[np.intp]) -> _Table:
        """Whether the bodies of some pairs may touch, as `touching`: sure where it says no, and cheaper."""
        pairs = self._plan.pairs
        mask, numbers = pairs.among(first, second), pairs.number[first, second]
        parts = [chunk.near(mask).take(numbers, axis=0) for chunk in self._chunks]
        return np.ascontiguousarray(_joined(parts).T)

    def rows(self, chosen: slice | NDArray[np.intp] | NDArray[np.bool_]) -> Relations:
        """Relations of some of the scenes."""
        vectors = np.concatenate([chunk.vectors for chunk in self._chunks])[chosen]
        chunks = [Measurements(self._plan, vectors, self._chunks[0].eps, self._chunks[0].precision)]
        return Relations(self.layout, self._axes, self.names, self._plan, chunks)

    def touched(self, body: int) -> _Table:
        """Which bodies touch one, shape ``(n, K)``; it doesn't touch itself."""
        return self.distances(body) <= self.touch(body)

    def touch(self, body: int) -> float | FloatArray:
        """Distance up to which others touch a body; where numbers are coarse of shape ``(n, K)``."""
        return self._limits(body, [chunk.touch for chunk in self._chunks])

    def parting(self, body: int) -> float | FloatArray:
        """Speed up to which others don't part from a body that they touch; as `touch`."""
        return self._limits(body, [chunk.parting for chunk in self._chunks])

    def _limits(self, body: int, parts: Sequence[float | FloatArray]) -> float | FloatArray:
        arrays = [part for part in parts if isinstance(part, np.ndarray)]
        if not arrays:
            return parts[0]
        both = np.concatenate([_joined(arrays), np.zeros((1, len(self)))])
        return np.ascontiguousarray(both.take(self._plan.pairs.number[body], axis=0).T)

    def context(self, body: int) -> _Table:
        """Return the target's close set (`close_set`), shape ``(n, K)``."""
        return close_set(self.touched(body), self.distances(body), body)

    def normals(self, body: int) -> FloatArray:
        """Return the unit normals from each other body to this one, shape ``(n, K, d)``; NaN for itself."""
        return self._normals(body).transpose(2, 1, 0)

    def contacts(self, body: int) -> FloatArray:
        """Return the contact features (`contact_features`) of the pairs (body, other), shape ``(n, K, F)``.

        NaN for the body itself. Velocities are the scenes', in length per step.
        """
        normal = self._normals(body)
        velocity = _joined([chunk.velocity for chunk in self._chunks])
        approach, slip = contacts.motion(velocity[:, body, None] - velocity, normal)
        last = len(normal) + 3
        out = np.empty((len(self), len(self._plan.pairs.number), last + len(normal) * self._plan.offsets))
        out[..., 0] = self.distances(body)
        out[..., 1 : last - 2] = normal.transpose(2, 1, 0)
        out[..., last - 2], out[..., last - 1] = approach.T, slip.T
        if self._plan.offsets:
            position = _joined([chunk.boxes.position for chunk in self._chunks])
            out[..., last:] = (position[:, body, None] - position).transpose(2, 1, 0)
        out[:, body] = np.nan
        return out

    def _normals(self, body: int) -> FloatArray:
        """Normals of the body's pairs, shape ``(d, K, n)``."""
        pairs = self._plan.pairs
        count = len(pairs.number)
        if count == 1:
            return np.full((len(self._axes.used), 1, len(self)), np.nan)
        numbers = np.minimum(pairs.number[body], len(pairs.first) - 1)
        signs = np.where(np.arange(count) > body, 1.0, -1.0)
        signs[body] = np.nan
        parts = [chunk.of(body).normal.take(numbers, axis=1) for chunk in self._chunks]
        normals: FloatArray = _joined(parts) * signs[:, None]
        return normals


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """Pieces put together along their last axis."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=-1)


def _found(axes: Axes, chunk: Measurements, name: str) -> _Table:
    """One relation's table in a piece of the scenes, shape ``(K, K, n)``; the diagonal means nothing."""
    if name == "intersect":
        return chunk.touching()
    if name == "on-top":
        return chunk.boxes.on_top(chunk.touching())
    if name == "smaller-than":
        return chunk.boxes.smaller()
    if name.startswith("approaching"):
        closing = chunk.closing()
        found: _Table = closing < np.inf
        if name == "approaching-fastest":
            slack = chunk.parting
            if isinstance(slack, np.ndarray):
                slack = square(slack, chunk.pairs, contacts.APPROACH_EPS)
            found &= closing <= closing.min(axis=1, initial=np.inf, keepdims=True) + slack
        return found
    return chunk.boxes.along(*axis_relations(axes)[name])


@refusing_calls(QueryError)
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
        Distance up to which bodies touch, in units of length; more where the schema says that numbers are coarse
        (`SceneSchema.precision`). A larger value makes near bodies touch.

    Raises
    ------
    ConfigError
        An unknown geometry.
    SchemaError
        A type has the name of a spatial relation.
    """

    @refusing(ConfigError)
    def __init__(
        self, schema: SceneSchema, *, geometry: Literal["arrays", "fcl"] = "arrays", eps: float = TOUCH_EPS
    ) -> None:
        if geometry not in ("arrays", "fcl"):
            raise ConfigError(f"geometry must be 'arrays' or 'fcl', got {geometry!r}")
        self.schema, self.geometry, self.eps = schema, geometry, eps
        self.axes = Axes.of(schema)
        per_axis = list(axis_relations(self.axes))
        contact = ["approaching", "approaching-fastest", "intersect"]
        self.names = tuple(sorted([*contact, "on-top", "smaller-than", *per_axis]))
        self.features = contacts.contact_features(schema)
        self.unary_names = unary_names(schema)
        for name in self.unary_names:
            if name in self.names:
                raise SchemaError(f"type name {name!r} is the name of a spatial relation; rename the type")
        self._plans: dict[tuple[str, ...], Plan] = {}

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
        if getattr(vectors, "ndim", 0) != 2 or vectors.shape[1] != layout.width:
            raise ObservationError(
                f"expected state vectors of shape (n, {layout.width}) for {layout.names}, got {np.shape(vectors)}"
            )
        plan = self._plan(layout)
        chunk = max(1, _CHUNK // max(1, plan.pairs.number.size))
        starts = range(0, max(1, len(vectors)), chunk)
        coarse = self.schema.precision
        chunks = [Measurements(plan, vectors[i : i + chunk], self.eps, coarse) for i in starts]
        return Relations(layout, self.axes, self.names, plan, chunks)

    def unary(self, layout: SceneLayout) -> dict[str, _Table]:
        """Return the unary relations of a layout's bodies (`unary`)."""
        return unary(self.schema, layout)

    def _plan(self, layout: SceneLayout) -> Plan:
        if (plan := self._plans.get(layout.names)) is None:
            plan = self._plans[layout.names] = self._make_plan(layout)
        return plan

    def _make_plan(self, layout: SceneLayout) -> Plan:
        names = tuple(layout.names[i] for i in layout.bodies)
        shapes = tuple(shape for i in layout.bodies if (shape := layout.types[i].shape) is not None)
        velocities = contacts.velocity_columns(layout, self.axes)
        moves = np.asarray((velocities >= 0).any(axis=0))
        pairs = Pairs.of(len(names))
        return Plan(
            self.axes,
            np.ascontiguousarray(pose_columns(layout)[0].T),
            np.where(velocities < 0, layout.width, velocities),
            pairs,
            np.flatnonzero(moves[pairs.first] | moves[pairs.second]),
            self._make_geometry(Bodies(names, shapes)),
            self.schema.offsets,
        )

    def _make_geometry(self, bodies: Bodies) -> Geometry:
        if self.geometry == "arrays":
            return ArrayGeometry(self.axes, bodies)
        from relgym.scene.geometry.fcl import FclGeometry

        return FclGeometry(self.axes, bodies)
