"""Scenes of one model put together and compared: actions filled in, next values lined up, schemas matched."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing
from relgym.config.constants import LAYOUTS
from relgym.errors import ObservationError
from relgym.scene.objects import ACTION, TASK, ObjectType, Scene, SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = [
    "Arrival",
    "Passage",
    "angle_columns",
    "mismatch",
    "next_values",
    "passage",
    "scene_of",
    "unwrapped",
    "with_action",
    "wrap",
]


@refusing(ObservationError)
def with_action(scene: Scene, values: Sequence[float] | NDArray[np.float64]) -> Scene:
    """The scene with other values of the action object's properties (physical units)."""
    layout = scene.layout
    where = layout.slice(layout.index(ACTION))
    vector = scene.vector.copy()
    if np.shape(values) != vector[where].shape:
        raise ObservationError(f"action: expected {vector[where].shape} values, got shape {np.shape(values)}")
    vector[where] = values
    return Scene(scene.schema, layout, vector)


def scene_of(schema: SceneSchema, layout: SceneLayout, vector: NDArray[np.float64]) -> Scene:
    """A scene of numbers that are known to fit its layout, which becomes their owner: nothing is looked at again."""
    vector.flags.writeable = False
    scene = Scene.__new__(Scene)
    scene.schema, scene.layout, scene.vector = schema, layout, vector
    return scene


@dataclass(frozen=True, slots=True)
class Passage:
    """Which objects of one layout are in another one, of the same name and type, and where their numbers lie.

    Attributes
    ----------
    later
        The other layout.
    stays
        Of each object, whether it is.
    columns, sources
        Columns of those that are, and the same numbers' columns in the other layout, shape ``(m,)``.
    """

    later: SceneLayout
    stays: tuple[bool, ...]
    columns: NDArray[np.intp]
    sources: NDArray[np.intp]


def passage(before: SceneLayout, after: SceneLayout) -> Passage:
    """What becomes of the objects of a layout in another one; cached on the first."""
    known: dict[int, Passage] = before.__dict__.setdefault("_passages", {})
    found = known.get(id(after))
    if found is None or found.later is not after:  # kept alive, so that its id stays its own
        there = {name: i for i, name in enumerate(after.names)}
        both = [(i, there.get(name, -1)) for i, name in enumerate(before.names)]
        stay = tuple(k >= 0 and after.types[k] == before.types[i] for i, k in both)
        columns, sources = list[int](), list[int]()
        for (i, k), stays in zip(both, stay, strict=True):
            if stays:
                columns += range(before.width)[before.slice(i)]
                sources += range(after.width)[after.slice(k)]
        if len(known) >= LAYOUTS:
            known.clear()
        found = known[id(after)] = Passage(
            after, stay, np.array(columns, dtype=np.intp), np.array(sources, dtype=np.intp)
        )
    return found


def mismatch(schema: SceneSchema, known: SceneSchema) -> str:
    """Why a model of one schema can't predict scenes of another; empty if it can."""
    if (schema.up, schema.planar) != (known.up, known.planar):
        return f"up={schema.up!r}, planar={schema.planar} instead of up={known.up!r}, planar={known.planar}"
    types = {t.name: t for t in known.types}
    for t in schema.types:
        if t.name not in types:
            return f"unknown type {t.name!r}, expected one of {sorted(types)}"
        if t.properties != types[t.name].properties:
            return f"type {t.name!r} has properties {t.properties}, expected {types[t.name].properties}"
        if t != types[t.name]:
            return f"type {t.name!r} has another shape, parent, pose or velocity"
    return ""


class Arrival:
    """The scene that the latest transition came to, which the next one begins with.

    Parameters
    ----------
    layout, vector
        Its layout, and its numbers.
    """

    __slots__ = ("_sought", "layout", "vector")

    def __init__(self, layout: SceneLayout, vector: NDArray[np.float64]) -> None:
        self.layout, self.vector = layout, vector
        self._sought: tuple[SceneLayout, NDArray[np.intp], NDArray[np.float64], int, float] | None = None

    def __reduce__(self) -> tuple[type[Arrival], tuple[SceneLayout, NDArray[np.float64]]]:
        return Arrival, (self.layout, self.vector)

    def to_json(self) -> dict[str, Any]:
        """JSON representation."""
        names = zip(self.layout.names, (t.name for t in self.layout.types), strict=True)
        return {"objects": [list(pair) for pair in names], "values": self.vector.tolist()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any], types: Mapping[str, ObjectType]) -> Arrival:
        """The scene that `to_json` wrote, of types by their names."""
        names, kinds = zip(*data["objects"], strict=True)
        return cls(SceneLayout(names, tuple(types[kind] for kind in kinds)), np.array(data["values"]))

    def rows(self, layout: SceneLayout, vectors: NDArray[np.float64]) -> NDArray[np.intp]:
        """Which of n scenes hold its numbers, but for what is done there and what a task says, ascending."""
        _, columns, sought, first, value = self._of(layout)
        if not len(columns):
            return columns
        rows = np.flatnonzero(vectors[:, first] == value)
        return rows[(vectors[np.ix_(rows, columns)] == sought).all(axis=1)] if len(rows) else rows

    def begins(self, layout: SceneLayout, vector: NDArray[np.float64]) -> bool:
        """Whether one scene does; most are told by their first number, in a fraction of a microsecond."""
        _, columns, sought, first, value = self._of(layout)
        if not len(columns) or vector.item(first) != value:
            return False
        return bool((vector[columns] == sought).all())

    def _of(
        self, layout: SceneLayout
    ) -> tuple[SceneLayout, NDArray[np.intp], NDArray[np.float64], int, float]:
        """Columns to be compared, what they hold in this scene, and the first of both."""
        known = self._sought
        if known is None or known[0] is not layout:
            whole, way = np.full(layout.width, np.nan), passage(layout, self.layout)
            whole[way.columns] = self.vector[way.sources]  # NaN: what isn't there equals nothing
            columns = _observed(layout)
            first = int(columns[0]) if len(columns) else 0
            known = self._sought = layout, columns, whole[columns], first, float(whole[first])
        return known


def _observed(layout: SceneLayout) -> NDArray[np.intp]:
    """Columns of a state vector that are neither of an action nor of a task; cached on the layout."""
    found: NDArray[np.intp] | None = layout.__dict__.get("_observed_columns")
    if found is None:
        there = [i for i, t in enumerate(layout.types) if t.name not in (ACTION, TASK)]
        places = [column for i in there for column in range(layout.width)[layout.slice(i)]]
        found = layout.__dict__["_observed_columns"] = np.array(places, dtype=np.intp)
    return found


def angle_columns(layout: SceneLayout) -> NDArray[np.intp]:
    """Columns of a state vector that hold angles; cached on the layout."""
    found: NDArray[np.intp] | None = layout.__dict__.get("_angle_columns")
    if found is None:
        places = [layout.column(i, p) for i, t in enumerate(layout.types) for p in t.angles]
        found = layout.__dict__["_angle_columns"] = np.array(places, dtype=np.intp)
    return found


def unwrapped(
    layout: SceneLayout, now: NDArray[np.float64], following: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The next values with every angle turned to within half a turn of the present one.

    So that an angle that goes round at π obeys the same law there as everywhere.
    """
    columns = angle_columns(layout)
    if not len(columns):
        return following
    turned = following.copy()
    turned[..., columns] -= math.tau * np.round((following[..., columns] - now[..., columns]) / math.tau)
    return turned


def wrap(layout: SceneLayout, following: NDArray[np.float64]) -> None:
    """Bring all angles into [-π, π], in place."""
    columns = angle_columns(layout)
    if len(columns):
        following[..., columns] -= math.tau * np.round(following[..., columns] / math.tau)


def next_values(before: Scene, after: Scene) -> NDArray[np.float64]:
    """The next values in the layout of the scene before; objects that vanished keep theirs."""
    if after.layout is before.layout:
        return after.vector
    following, way = before.vector.copy(), passage(before.layout, after.layout)
    following[way.columns] = after.vector[way.sources]
    return following
