"""What users declare of an env's objects: which numbers are whose, what never moves, what is an angle."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from relgym.arguments import refusing, refusing_fields
from relgym.errors import ConfigError
from relgym.model.files.storage import shape_from_json, shape_to_json
from relgym.scene.objects import ObjectType
from relgym.scene.shapes import Shape

__all__ = ["Angle", "Part", "Rows", "Static", "identifier", "identifiers", "merged"]


@refusing_fields(ConfigError)
@dataclass(frozen=True, slots=True)
class Part:
    """One object, and the numbers of the observation that are its properties.

    Parameters
    ----------
    name
        The object's name.
    columns
        Names of its numbers; or property name -> name of the number, so that objects of one type have the
        same properties: ``{"contact": "left_contact"}``.
    type
        The type's name; default: the object's.
    shape
        The type's shape; ``None``: it has no body and takes part in no spatial relation.
    pose
        Which property supplies which pose component: ``{"px": "x"}`` (`ObjectType.pose`).
    velocity
        The velocity along the three axes (`ObjectType.velocity`).
    constants
        Properties that no number supplies, and their values: ``{"sx": 2.0}``.
    angles
        Properties that are angles in radians already (`ObjectType.angles`).
    """

    name: str
    columns: Sequence[str] | Mapping[str, str]
    type: str | None = None
    shape: Shape | None = None
    pose: Mapping[str, str] = field(default_factory=dict)
    velocity: tuple[str | None, ...] = ()
    constants: Mapping[str, float] = field(default_factory=dict)
    angles: tuple[str, ...] = ()

    @property
    def sources(self) -> dict[str, str]:
        """Name of the number that each property comes from."""
        if isinstance(self.columns, Mapping):
            return dict(self.columns)
        return {name: name for name in self.columns}

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        columns = [[prop, source] for prop, source in self.sources.items()]
        return {"name": self.name, "columns": columns, **_traits_to_json(self)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Part:
        """Read what `to_json` wrote."""
        columns = {str(prop): str(source) for prop, source in data["columns"]}
        return cls(data["name"], columns, **_traits_from_json(data))


@refusing_fields(ConfigError)
@dataclass(frozen=True, slots=True)
class Rows:
    """Consecutive rows of a table that show objects of one kind.

    Parameters
    ----------
    name
        Name of the object if there is one row; with more rows the objects are called ``name1``, ``name2``, ….
    count
        Number of rows, >= 1.
    type
        The type's name; default: `name`.
    shape, pose, velocity, constants, angles
        As of `Part`; `pose` and `velocity` name columns.
    """

    name: str
    count: int = 1
    type: str | None = None
    shape: Shape | None = None
    pose: Mapping[str, str] = field(default_factory=dict)
    velocity: tuple[str | None, ...] = ()
    constants: Mapping[str, float] = field(default_factory=dict)
    angles: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ConfigError(f"rows {self.name!r}: expected a count of at least 1, got {self.count}")

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {"name": self.name, "count": self.count, **_traits_to_json(self)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Rows:
        """Read what `to_json` wrote."""
        return cls(data["name"], int(data["count"]), **_traits_from_json(data))


@refusing_fields(ConfigError)
@dataclass(frozen=True, slots=True)
class Static:
    """An object that the observation doesn't show, because it never changes: a wall, the floor.

    Parameters
    ----------
    name
        The object's name.
    values
        Its properties: ``{"px": 0.0, "py": 5.0, "sx": 1.0, "sy": 10.0}``.
    type
        The type's name; default: the object's.
    shape
        The type's shape; ``None``: no body.
    """

    name: str
    values: Mapping[str, float]
    type: str | None = None
    shape: Shape | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        shape = None if self.shape is None else shape_to_json(self.shape)
        return {
            "name": self.name,
            "values": [[p, v] for p, v in self.values.items()],
            "type": self.type,
            "shape": shape,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Static:
        """Read what `to_json` wrote."""
        shape = None if data["shape"] is None else shape_from_json(data["shape"])
        return cls(data["name"], {str(p): float(v) for p, v in data["values"]}, data["type"], shape)


@refusing_fields(ConfigError)
@dataclass(frozen=True, slots=True)
class Angle:
    """Two numbers that are cosine and sine of an angle; scenes hold the angle instead, in radians.

    Parameters
    ----------
    cos, sin
        Names of the two numbers.
    name
        Name of the angle; default: what follows ``cos`` in the cosine's, else ``angle_`` and the cosine's.
    """

    cos: str
    sin: str
    name: str | None = None

    @refusing(ConfigError)
    def named(self, prop: str) -> str:
        """Name of the angle of an object that calls the cosine `prop`."""
        if self.name is not None:
            return self.name
        rest = prop.removeprefix("cos").removeprefix("_")
        return rest if rest != prop and rest.isidentifier() else f"angle_{prop}"


def identifier(text: Any) -> str:
    """`text` as a Python identifier: other characters become underscores."""
    name = re.sub(r"\W", "_", str(text))
    return name if name.isidentifier() else f"_{name}"


def identifiers(what: str, names: Sequence[str], count: int) -> None:
    """Raise `ConfigError` unless these are `count` different identifiers."""
    wrong = [name for name in names if not str(name).isidentifier()]
    if len(names) != count or len(set(names)) != count or wrong:
        raise ConfigError(
            f"{what}: expected {count} different Python identifiers (letters, digits, underscore), got {tuple(names)}"
        )


def merged(kinds: Sequence[ObjectType]) -> tuple[ObjectType, ...]:
    """The different types among these; `ConfigError` where two of one name differ."""
    found: dict[str, ObjectType] = {}
    for kind in kinds:
        if found.setdefault(kind.name, kind) != kind:
            raise ConfigError(
                f"two objects of type {kind.name!r} differ in properties, shape, pose or velocity: "
                f"{found[kind.name].properties} and {kind.properties}; give them types of their own, or columns as "
                "{property: column}"
            )
    return tuple(found.values())


def _traits_to_json(of: Part | Rows) -> dict[str, Any]:
    """What both kinds of object say of their type, as plain data."""
    return {
        "type": of.type,
        "shape": None if of.shape is None else shape_to_json(of.shape),
        "pose": dict(of.pose),
        "velocity": list(of.velocity),
        "constants": [[p, v] for p, v in of.constants.items()],
        "angles": list(of.angles),
    }


def _traits_from_json(data: Mapping[str, Any]) -> dict[str, Any]:
    """Inverse of `_traits_to_json`: arguments."""
    return {
        "type": data["type"],
        "shape": None if data["shape"] is None else shape_from_json(data["shape"]),
        "pose": dict(data["pose"]),
        "velocity": tuple(data["velocity"]),
        "constants": {str(p): float(v) for p, v in data["constants"]},
        "angles": tuple(data["angles"]),
    }
