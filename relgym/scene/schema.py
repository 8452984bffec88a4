"""The schema of scenes: which types and objects there may be, and what is declared of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from relgym.arguments import finite, refusing, refusing_fields, unfit
from relgym.errors import ObservationError, QueryError, SchemaError
from relgym.scene.objects import Scene, SceneLayout
from relgym.scene.types import Float1D, Kinematics, ObjectType, Target

__all__ = ["SceneSchema"]


@refusing_fields(SchemaError)
@dataclass(frozen=True)
class SceneSchema:
    """Everything about a family of scenes that never changes while an env lives.

    Parameters
    ----------
    types
        The object types.
    objects
        ``(name, type name)`` of every object that may occur, in the order of the state vector. Names are
        Python identifiers. They match objects across one step and mean nothing else.
    up
        The world axis that points up, ``"x"``, ``"y"`` or ``"z"``.
    planar
        Whether the world is 2-D: the depth axis (z when y is up, else y) carries no information.
    kinematics
        Declared laws; their properties are not learned.
    targets
        What to learn by default, in causal order; ``None``: every property that changes.
    action_scale
        ``(property, low, high)``: the physical range that [-1, 1] of each component of the env's action
        stands for.
    offsets
        Whether clauses may test gaps: where another body's centre lies along the world's axes, how far away it is and
        how fast the two approach, touching or not. Default: contacts only, and of these no offset. A paddle turns a
        ball by where it is hit.
    precision
        Relative precision of the numbers, of numbers below 1 absolute: 0 for float64, some 5e-7 for float32. Bodies
        that are no farther from one another touch.
    """

    types: tuple[ObjectType, ...]
    objects: tuple[tuple[str, str], ...]
    up: str = "y"
    planar: bool = True
    kinematics: tuple[Kinematics, ...] = ()
    targets: tuple[Target, ...] | None = None
    action_scale: tuple[tuple[str, float, float], ...] = ()
    offsets: bool = False
    precision: float = 0.0

    def __post_init__(self) -> None:
        if self.up not in ("x", "y", "z"):
            raise SchemaError(f"up must be 'x', 'y' or 'z', got {self.up!r}")
        names = [t.name for t in self.types]
        if len(set(names)) != len(names):
            raise SchemaError(f"type names must differ, got {names}")
        objects = [name for name, _ in self.objects]
        if len(set(objects)) != len(objects):
            raise SchemaError(f"object names must differ, got {objects}")
        for name, type_name in self.objects:
            if not name.isidentifier():
                raise SchemaError(
                    f"object name {name!r} must be a Python identifier (letters, digits, underscore)"
                )
            if type_name not in names:
                raise SchemaError(f"object {name!r} has unknown type {type_name!r}; the schema has {names}")
        if not 0.0 <= self.precision < 1.0:
            raise SchemaError(f"precision must lie in [0, 1), got {self.precision!r}")
        self._check_derivations()

    def _check_derivations(self) -> None:
        """Each property follows from one law, and none from itself by way of next values."""
        for law in self.kinematics:
            if said := unfit(law):
                raise SchemaError(
                    f"kinematics {said}; expected a finite step, and names of a type and properties"
                )
            for prop in (law.property, law.rate):
                if prop not in self.type(law.type).properties:
                    raise SchemaError(f"kinematics {law}: type {law.type!r} has no property {prop!r}")
            if not math.isfinite(law.step):
                raise SchemaError(f"kinematics {law}: expected a finite step")
        derived = [(law.type, law.property) for law in self.kinematics]
        if twice := sorted({pair for pair in derived if derived.count(pair) > 1}):
            raise SchemaError(
                f"several laws of kinematics for {['.'.join(pair) for pair in twice]}; declare one each"
            )
        if len(self.derivations) < len(derived):
            left = [f"{law.type}.{law.property}" for law in self.kinematics if law not in self.derivations]
            raise SchemaError(f"the kinematics of {left} follow from one another's next values in a circle")

    @cached_property
    def derivations(self) -> tuple[Kinematics, ...]:
        """Laws of kinematics, each after those whose next values it reads, whatever order they were declared in."""
        waiting, found = list(self.kinematics), list[Kinematics]()
        while waiting:
            due = {(law.type, law.property) for law in waiting}
            ready = [law for law in waiting if not (law.uses_next and (law.type, law.rate) in due)]
            if not ready:
                break
            found += ready
            waiting = [law for law in waiting if law not in ready]
        return tuple(found)

    @cached_property
    def _types(self) -> dict[str, ObjectType]:
        return {t.name: t for t in self.types}

    @cached_property
    def _layouts(self) -> dict[tuple[str, ...], SceneLayout]:
        return {}

    @cached_property
    def order(self) -> tuple[str, ...]:
        """Object names in the order of the state vector."""
        return tuple(name for name, _ in self.objects)

    @refusing(QueryError)
    def type(self, name: str) -> ObjectType:
        """Return the type of that name; `QueryError` when there is none."""
        try:
            return self._types[name]
        except KeyError:
            raise QueryError(f"unknown type {name!r}; the schema has {sorted(self._types)}") from None

    @refusing(QueryError)
    def type_of(self, object_name: str) -> ObjectType:
        """Return the type of the object of that name; `QueryError` when there is none."""
        for name, type_name in self.objects:
            if name == object_name:
                return self._types[type_name]
        raise QueryError(f"unknown object {object_name!r}; the schema has {list(self.order)}")

    @refusing(QueryError)
    def ancestry(self, type_name: str) -> tuple[str, ...]:
        """The type's name followed by its parents', nearest first."""
        chain = [type_name]
        while (known := self._types.get(chain[-1])) is not None and known.parent is not None:
            if known.parent in chain:
                raise SchemaError(f"type {type_name!r} is its own ancestor: {chain}")
            chain.append(known.parent)
        return tuple(chain)

    @refusing(ObservationError)
    def layout(self, names: Iterable[str] | None = None) -> SceneLayout:
        """Layout of a scene with these objects (default: all), in schema order; cached."""
        given = self.order if names is None else tuple(names)
        if (known := self._layouts.get(given)) is not None:
            return known
        present = frozenset(given)
        key = tuple(name for name in self.order if name in present)
        if len(key) != len(present):
            raise ObservationError(
                f"unknown objects {sorted(present - set(key))}; the schema has {list(self.order)}"
            )
        if (layout := self._layouts.get(key)) is None:
            layout = self._layouts[key] = SceneLayout(key, tuple(self.type_of(name) for name in key))
        self._layouts[given] = layout
        return layout

    @refusing(ObservationError)
    def scene(self, values: Mapping[str, Any]) -> Scene:
        """Build a scene from ``{object name: property vector}``, checking lengths and finiteness.

        Raises
        ------
        ObservationError
            An unknown object, a wrong length, NaN or infinity; the message names object and property.
        """
        layout = self.layout(values)
        parts = [values[name] for name in layout.names]
        if not _plain(parts, layout.types):
            parts = [
                _checked(name, t, p) for name, t, p in zip(layout.names, layout.types, parts, strict=True)
            ]
        vector = np.concatenate(parts) if parts else np.empty(0)
        if not finite(vector):
            for name, t, part in zip(layout.names, layout.types, parts, strict=True):
                _checked(name, t, part)
        return Scene(self, layout, vector)

    def __getstate__(self) -> dict[str, Any]:
        # Cached layouts are rebuilt on demand; leaving them out keeps pickles small and equal.
        return {name: value for name, value in self.__dict__.items() if not name.startswith("_")}

    def __hash__(self) -> int:
        return hash((self.objects, self.up, self.planar))


def _plain(parts: Sequence[Any], types: Sequence[ObjectType]) -> bool:
    """Whether all are arrays of float64, as long as the types say; `_checked` says what else they are."""
    for part, t in zip(parts, types, strict=True):
        if type(part) is not np.ndarray or part.dtype != np.float64 or part.shape != (len(t.properties),):
            return False
    return True


def _checked(name: str, t: ObjectType, values: Sequence[float] | Float1D) -> Float1D:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ObservationError(
            f"object {name!r} of type {t.name!r}: expected {len(t.properties)} numbers {t.properties}, got {values!r}"
        ) from None
    if array.shape != (len(t.properties),):
        raise ObservationError(
            f"object {name!r} of type {t.name!r}: expected {len(t.properties)} properties {t.properties}, "
            f"got an array of shape {array.shape}"
        )
    if not np.isfinite(array).all():
        for prop, value in zip(t.properties, array, strict=True):
            if not math.isfinite(value):
                raise ObservationError(
                    f"object {name!r}, property {prop!r}: expected a finite number, got {value}; "
                    "check the env's observation before it is learned from"
                )
    return array
