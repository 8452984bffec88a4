"""Flat views: scenes as short vectors for neural nets, relative to one object and scaled.

Nets learn slowly from absolute positions and from numbers of very different size; and in float32 a position of a
thousand units has lost what a stop to within a tenth needs. A `FlatSpec` says what to show and how large it typically
is, a `Flattener` does it for any number of scenes at once. Both know types and properties only through the schema.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.errors import ConfigError
from relgym.scene.objects import ACTION, Float2D, ObjectType, SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = ["LIMIT", "FlatSpec", "Flattener"]

LIMIT: Final = 5.0
"""Scaled numbers are clipped to [-5, 5]."""


@dataclass(frozen=True)
class FlatSpec:
    """What a flat view shows of a scene.

    Parameters
    ----------
    actor
        Name of the object to which positions are relative; empty: the world's origin.
    anchor
        The point of the actor that counts, in its extents from its centre: (0.5, 0, 0) is the middle of the
        face towards +x.
    scales
        Typical size of each property that is shown, in its unit. With several sizes a property is shown once at
        each: coarse from afar, fine close by. Empty: all properties as they are.
    slots
        For how many objects of a type there is room; what stays empty is 0 and so is its mask. By default as
        many as the schema has.
    """

    actor: str = ""
    anchor: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scales: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    slots: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        wrong = {name: sizes for name, sizes in self.scales.items() if not sizes or not min(sizes) > 0.0}
        if wrong:
            raise ConfigError(f"scales={wrong}: expected one or more positive sizes for each property")


class _Number(NamedTuple):
    """One element of a flat vector: a property of an object, or its mask where `property` is empty."""

    object: str
    property: str
    scale: float
    axis: int  # 0, 1, 2: a position along that axis; 3: no position


class Flattener:
    """Turns scenes of one schema into vectors.

    Parameters
    ----------
    schema
        The scenes' schema.
    spec
        What to show.

    Attributes
    ----------
    names : tuple of str
        What each element is, for people: ``"box1.px/10"``, ``"box1"`` for a mask.
    space : gymnasium.spaces.Box
        The space of the vectors, float32.

    Raises
    ------
    ConfigError
        The schema has no such object, property or type, or more objects than there is room for.

    Notes
    -----
    Objects are masked where some may be absent: those of optional types, and of types that `FlatSpec.slots` names.
    """

    def __init__(self, schema: SceneSchema, spec: FlatSpec) -> None:
        self.schema, self.spec = schema, spec
        _check(schema, spec)
        self._numbers = list(self._all())
        self.names = tuple(_name(number) for number in self._numbers)
        self.space = spaces.Box(-LIMIT, LIMIT, (len(self._numbers),), np.float32)
        self._inverse = np.array([1.0 / number.scale for number in self._numbers])
        self._axes = np.array([number.axis for number in self._numbers], dtype=np.intp)
        self._columns: dict[tuple[str, ...], NDArray[np.intp]] = {}

    def __call__(self, layout: SceneLayout, vectors: Float2D) -> NDArray[np.float32]:
        """Flat vectors, shape ``(n, len(names))``, of n state vectors with that layout, shape ``(n, layout.width)``.

        Cost: three array operations, whatever the number of scenes.
        """
        padded = np.concatenate([vectors, np.broadcast_to([0.0, 1.0], (len(vectors), 2))], axis=1)
        columns = self._places(layout)
        origin = self._origin(layout, vectors)[:, self._axes]
        # What is absent, and every mask, stands in no relation to the actor.
        origin[:, columns >= layout.width] = 0.0
        scaled = (padded[:, columns] - origin) * self._inverse
        flat: NDArray[np.float32] = np.clip(scaled, -LIMIT, LIMIT).astype(np.float32)
        return flat

    def _origin(self, layout: SceneLayout, vectors: Float2D) -> Float2D:
        """The point that positions are relative to, and a 0 for what is no position; shape ``(n, 4)``."""
        origin = np.zeros((len(vectors), 4))
        if not self.spec.actor:
            return origin
        index = layout.index(self.spec.actor)
        places = layout.types[index].pose_columns()
        start = layout.offsets[index]
        for axis, share in enumerate(self.spec.anchor):
            if places[axis] >= 0:
                origin[:, axis] = vectors[:, start + places[axis]]
            if share and places[6 + axis] >= 0:
                origin[:, axis] += share * vectors[:, start + places[6 + axis]]
        return origin

    def _places(self, layout: SceneLayout) -> NDArray[np.intp]:
        """Column of each element in a state vector with the constants (0, 1) appended; cached."""
        if (known := self._columns.get(layout.names)) is None:
            known = np.array([_place(layout, number) for number in self._numbers], dtype=np.intp)
            self._columns[layout.names] = known
        return known

    def _all(self) -> Iterator[_Number]:
        for t in self.schema.types:
            names = [name for name, kind in self.schema.objects if kind == t.name and t.name != ACTION]
            spare = max(0, self.spec.slots.get(t.name, 0) - len(names))
            for name in (*names, *(f"{t.name} {k + 1} (spare)" for k in range(spare))):
                yield from self._of(name, t)
                if t.name in self.spec.slots or t.optional:
                    yield _Number(name, "", 1.0, 3)

    def _of(self, name: str, t: ObjectType) -> Iterator[_Number]:
        positions = {t.properties[k]: axis for axis, k in enumerate(t.pose_columns()[:3]) if k >= 0}
        for prop in t.properties:
            if name == self.spec.actor and prop in positions:
                continue  # the same in every scene
            sizes = self.spec.scales.get(prop, ()) if self.spec.scales else (1.0,)
            for size in sizes:
                yield _Number(name, prop, size, positions.get(prop, 3))


def _place(layout: SceneLayout, number: _Number) -> int:
    if number.object not in layout.names:
        return layout.width
    if not number.property:
        return layout.width + 1
    return layout.column(layout.index(number.object), number.property)


def _name(number: _Number) -> str:
    if not number.property:
        return number.object
    scale = f"/{number.scale:g}" if number.scale != 1.0 else ""
    return f"{number.object}.{number.property}{scale}"


def _check(schema: SceneSchema, spec: FlatSpec) -> None:
    if spec.actor and spec.actor not in schema.order:
        raise ConfigError(f"actor={spec.actor!r}: the schema has the objects {list(schema.order)}")
    known = {prop for t in schema.types for prop in t.properties}
    if unknown := sorted(set(spec.scales) - known):
        raise ConfigError(f"scales: no type has the properties {unknown}; there are {sorted(known)}")
    for name, room in spec.slots.items():
        count = sum(kind == schema.type(name).name for _, kind in schema.objects)
        if count > room:
            raise ConfigError(f"slots[{name!r}]={room}: the schema has {count} objects of that type")
