"""One state of the world: its layout, scenes, the objects in them, and transitions between two.

A *scene* is one state of the world: the objects that are present, each with its type's property vector. All
of them share one flat float64 array, the thesis' state vector (§1.2.1): the concatenation of the property
vectors in schema order. Which objects lie where in that array is the scene's `SceneLayout`, shared by all
scenes with the same objects, so that a batch of scenes is simply a matrix.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing, refusing_fields, whole
from relgym.errors import ObservationError, QueryError
from relgym.scene.types import (
    ACTION,
    POSE,
    STILL,
    TASK,
    TERMINATED,
    Float1D,
    Float2D,
    Kinematics,
    ObjectType,
    Target,
)

if TYPE_CHECKING:
    from relgym.scene.schema import SceneSchema

__all__ = [
    "ACTION",
    "POSE",
    "STILL",
    "TASK",
    "TERMINATED",
    "Float1D",
    "Float2D",
    "Kinematics",
    "ObjectType",
    "Scene",
    "SceneLayout",
    "SceneObject",
    "Target",
    "Transition",
]

_POSE_DEFAULTS = {name: (1.0 if name[0] == "s" else 0.0) for name in POSE}


@dataclass(frozen=True)
class SceneLayout:
    """Which objects a state vector holds, and where (thesis: signature)."""

    names: tuple[str, ...]
    types: tuple[ObjectType, ...]

    def __getstate__(self) -> dict[str, Any]:
        # What is kept beside these is worked out again: it names other layouts, and those would name others.
        return {"names": self.names, "types": self.types}

    @cached_property
    def offsets(self) -> tuple[int, ...]:
        """Where each object's property vector starts."""
        offsets, at = [], 0
        for t in self.types:
            offsets.append(at)
            at += len(t.properties)
        return tuple(offsets)

    @cached_property
    def width(self) -> int:
        """Length of the state vector."""
        return sum(len(t.properties) for t in self.types)

    @cached_property
    def bodies(self) -> tuple[int, ...]:
        """Indices of the objects that have a body."""
        return tuple(i for i, t in enumerate(self.types) if t.has_body)

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.names)}

    @cached_property
    def _by_type(self) -> dict[str, tuple[int, ...]]:
        names = [t.name for t in self.types]
        return {
            name: tuple(i for i, each in enumerate(names) if each == name) for name in dict.fromkeys(names)
        }

    @cached_property
    def places(self) -> Mapping[tuple[str, str], int]:
        """Column of each (object, property)."""
        names = (
            (name, prop) for name, t in zip(self.names, self.types, strict=True) for prop in t.properties
        )
        return {key: column for column, key in enumerate(names)}

    @cached_property
    def angles(self) -> frozenset[int]:
        """Columns that hold angles, in radians."""
        return frozenset(
            self.places[n, p] for n, t in zip(self.names, self.types, strict=True) for p in t.angles
        )

    @refusing(QueryError)
    def index(self, name: str) -> int:
        """Position of the object of that name; `QueryError` when it is not in the scene."""
        try:
            return self._index[name]
        except KeyError:
            raise QueryError(f"no object {name!r} in the scene; it has {list(self.names)}") from None

    @refusing(QueryError)
    def slice(self, index: int) -> slice:
        """Where the `index`-th object's property vector lies; `QueryError` where there are fewer objects."""
        index = whole("index", index, -len(self.types), len(self.types), QueryError)
        start = self.offsets[index]
        return slice(start, start + len(self.types[index].properties))

    @refusing(QueryError)
    def column(self, index: int, prop: str) -> int:
        """Column of a property of the `index`-th object; `QueryError` when its type has no such property."""
        if not -len(self.types) <= index < len(self.types):
            raise QueryError(f"index={index}: the scene has {len(self.types)} objects")
        try:
            return self.offsets[index] + self.types[index].properties.index(prop)
        except ValueError:
            t = self.types[index]
            raise QueryError(f"type {t.name!r} has no property {prop!r}; it has {t.properties}") from None

    @refusing(QueryError)
    def of_type(self, type_name: str) -> tuple[int, ...]:
        """Indices of the objects of exactly that type."""
        return self._by_type.get(type_name, ())


@dataclass(frozen=True, slots=True)
class SceneObject:
    """One object of a scene, for people: name, type and property vector (read-only view)."""

    name: str
    type: ObjectType
    values: Float1D

    @refusing(QueryError)
    def __getitem__(self, prop: str) -> float:
        if prop not in self.type.properties:
            raise QueryError(f"object {self.name!r} has no property {prop!r}; it has {self.type.properties}")
        return float(self.values[self.type.properties.index(prop)])


class Scene:
    """One state of the world; immutable.

    Parameters
    ----------
    schema
        The schema it follows.
    layout
        Which objects are present.
    vector
        Numbers of shape ``(layout.width,)``, in units of the properties. A float64 array is made read-only, not
        copied; of anything else one is made.

    Raises
    ------
    ObservationError
        Another shape, or no numbers.
    """

    __slots__ = ("layout", "schema", "vector")

    @refusing(ObservationError)
    def __init__(self, schema: SceneSchema, layout: SceneLayout, vector: Float1D) -> None:
        try:
            vector = np.asarray(vector, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise ObservationError(f"expected {layout.width} numbers, got {vector!r}") from None
        if vector.shape != (layout.width,):
            raise ObservationError(
                f"expected a state vector of shape {(layout.width,)} for {list(layout.names)}, got shape {vector.shape}"
            )
        vector.flags.writeable = False
        self.schema = schema
        self.layout = layout
        self.vector = vector

    @refusing(QueryError)
    def __getitem__(self, name: str) -> SceneObject:
        i = self.layout.index(name)
        return SceneObject(name, self.layout.types[i], self.vector[self.layout.slice(i)])

    def __iter__(self) -> Iterator[SceneObject]:
        return (self[name] for name in self.layout.names)

    def __len__(self) -> int:
        return len(self.layout.names)

    def __contains__(self, name: object) -> bool:
        return name in self.layout.names

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scene):
            return NotImplemented
        return self.layout == other.layout and bool(np.array_equal(self.vector, other.vector))

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return Scene, (self.schema, self.layout, self.vector.copy())

    def __repr__(self) -> str:
        inside = ", ".join(f"{o.name}: {o.type.name}" for o in self)
        return f"Scene({inside})"

    def values(self) -> dict[str, Float1D]:
        """Property vectors by object name; copies."""
        return {o.name: o.values.copy() for o in self}

    @refusing(ObservationError)
    def replace(self, changes: Mapping[tuple[str, str], float]) -> Scene:
        """A scene with ``{(object, property): value}`` changed."""
        vector, places = self.vector.copy(), self.layout.places
        for key, value in changes.items():
            if (place := places.get(key)) is None:
                place = self.layout.column(self.layout.index(key[0]), key[1])  # which says what is wrong
            vector[place] = value
        return Scene(self.schema, self.layout, vector)

    def pose(self) -> Float2D:
        """Poses of all bodies, shape ``(len(layout.bodies), 9)``, in the order of `POSE`."""
        only: Float2D = poses(self.layout, self.vector[None])[0]
        return only


def poses(layout: SceneLayout, vectors: Float2D) -> NDArray[np.float64]:
    """Poses of all bodies in a batch of scenes.

    Parameters
    ----------
    layout
        The layout that all scenes share.
    vectors
        State vectors, shape ``(n, layout.width)``.

    Returns
    -------
    Shape ``(n, len(layout.bodies), 9)``, components in the order of `POSE`.
    """
    columns, constants = pose_columns(layout)
    padded = np.concatenate([vectors, np.broadcast_to(constants, (len(vectors), 2))], axis=1)
    picked: NDArray[np.float64] = padded[:, columns]
    return picked


def pose_columns(layout: SceneLayout) -> tuple[NDArray[np.intp], Float1D]:
    """Columns of `poses` in a state vector with the constants (0, 1) appended; cached on the layout."""
    cached = layout.__dict__.get("_pose_columns")
    if cached is None:
        columns = np.empty((len(layout.bodies), len(POSE)), dtype=np.intp)
        for row, i in enumerate(layout.bodies):
            for k, own in enumerate(layout.types[i].pose_columns()):
                default = layout.width + int(_POSE_DEFAULTS[POSE[k]])
                columns[row, k] = default if own < 0 else layout.offsets[i] + own
        cached = layout.__dict__["_pose_columns"] = (columns, np.array([0.0, 1.0]))
    result: tuple[NDArray[np.intp], Float1D] = cached
    return result


@refusing_fields(ObservationError)
@dataclass(frozen=True, slots=True)
class Transition:
    """One step of the world: the scene before (with the action), and the scene after (§1.2.3)."""

    before: Scene
    after: Scene
