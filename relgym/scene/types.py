"""Kinds of objects, and what is declared about them once: types, kinematics and learning targets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing_fields
from relgym.errors import SchemaError
from relgym.scene.shapes import Shape

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
    "Target",
]

Float1D: TypeAlias = NDArray[np.float64]
"""A float64 array with one axis."""
Float2D: TypeAlias = NDArray[np.float64]
"""A float64 array with two axes; rows are examples or scenes."""

POSE = ("px", "py", "pz", "rx", "ry", "rz", "sx", "sy", "sz")
"""Position, rotation (radians, applied about x, then y, then z) and full extents of every body (§4.1)."""

ACTION = "action"
"""Name of the bodiless object whose properties are the agent's output (§1.2.3)."""

TASK = "task"
"""Name of the bodiless object whose properties are reward and termination."""

STILL = "still"
"""Name of the type of the bodiless object that holds what never changes within an episode, in the scenes of a task."""

TERMINATED = "terminated"
"""Property of `task`: 1 where the step ended the episode (terminated, not truncated), else 0."""


@refusing_fields(SchemaError)
@dataclass(frozen=True, slots=True)
class ObjectType:
    """A kind of object: its properties, its shape and what is known of them (§1.2.6).

    Parameters
    ----------
    name
        The type's name; also the name of a unary relation.
    properties
        Names of the property vector's elements, in order.
    shape
        Canonical shape; ``None`` for a bodiless type, which takes part in functions but not in relations.
    parent
        Name of a more general type, itself declared in the schema or not; it too becomes a unary relation.
    pose
        Which property supplies which pose component, where it isn't the one of the same name:
        ``{"px": "x"}``. Components that no property supplies are constant: 0, or 1 for an extent.
    velocity
        The three properties that form the velocity along the x, y and z axis, ``None`` where there is none
        (``("vx", "vy", None)``). Empty: the type has no velocity and counts as resting.
    angles
        Properties that are angles in radians: they go round at ±π, and π and -π are the same place.
    exogenous
        Properties resampled from outside the world; the model never predicts them (they persist in roll-outs).
    optional
        Whether objects of the type may be absent from a scene.
    flags
        Properties that are 1 or 0 as something holds or not: which choice was made. Tests of them are written as
        relations are, ``action.left`` and ``¬action.left``. Types that differ in nothing else are equal.
    """

    name: str
    properties: tuple[str, ...]
    shape: Shape | None = None
    parent: str | None = None
    pose: Mapping[str, str] = field(default_factory=dict)
    velocity: tuple[str | None, ...] = ()
    exogenous: tuple[str, ...] = ()
    optional: bool = False
    angles: tuple[str, ...] = ()
    flags: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        given: object = self.properties
        if isinstance(given, str):
            raise SchemaError(
                f"type {self.name!r}: expected a tuple of property names, got {self.properties!r}"
            )
        object.__setattr__(self, "properties", tuple(self.properties))
        if self.shape is not None and not isinstance(self.shape, Shape):
            raise SchemaError(f"type {self.name!r}: expected a shape such as Box(), got {self.shape!r}")
        if len(set(self.properties)) != len(self.properties):
            raise SchemaError(f"type {self.name!r}: property names must differ, got {self.properties}")
        named = [*self.pose.values(), *(v for v in self.velocity if v), *self.exogenous]
        for name in (*named, *self.angles, *self.flags):
            if name not in self.properties:
                raise SchemaError(
                    f"type {self.name!r}: {name!r} is named as a pose, velocity, angle, flag or exogenous property "
                    f"but is not among its properties {self.properties}; add it or correct the name"
                )
        for component in self.pose:
            if component not in POSE:
                raise SchemaError(
                    f"type {self.name!r}: {component!r} is no pose component; expected one of {POSE}"
                )
        if self.velocity and len(self.velocity) != 3:
            raise SchemaError(
                f"type {self.name!r}: velocity needs three entries (x, y, z), got {self.velocity}"
            )

    def __hash__(self) -> int:
        return hash((self.name, self.properties))

    @property
    def has_body(self) -> bool:
        """Whether objects of this type have a shape and take part in spatial relations."""
        return self.shape is not None

    def pose_columns(self) -> tuple[int, ...]:
        """Index of the property that supplies each of the nine pose components; -1 where it is constant."""
        return tuple(self._index_or_missing(self.pose.get(name, name)) for name in POSE)

    def velocity_columns(self) -> tuple[int, int, int]:
        """Index of the velocity property along x, y and z; -1 where there is none."""
        names = self.velocity or (None, None, None)
        x, y, z = (-1 if name is None else self.properties.index(name) for name in names)
        return x, y, z

    def _index_or_missing(self, name: str) -> int:
        return self.properties.index(name) if name in self.properties else -1


@dataclass(frozen=True, slots=True)
class Kinematics:
    """A declared law ``property' = property + step * rate'`` (or ``* rate`` when `uses_next` is false)."""

    type: str
    property: str
    rate: str
    step: float = 1.0
    uses_next: bool = True


@refusing_fields(SchemaError, always=True)
@dataclass(frozen=True, slots=True, order=True)
class Target:
    """What one `PropertyModel` predicts: a property of all objects of a type.

    `given` lists (type, property) pairs whose *next* values may enter the function: targets predicted
    before this one. They appear as columns with a prime (``truck.vx'``).
    """

    type: str
    property: str
    given: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "given", tuple((t, p) for t, p in self.given)
        )  # lists can't be told apart in sets

    def __str__(self) -> str:
        return f"{self.type}.{self.property}"
