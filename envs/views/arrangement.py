"""Which of an observation's numbers lie where in the scenes of a `NumbersView`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.envs.views.records import Angle, Part, Static, identifier, identifiers, merged
from relgym.errors import ConfigError
from relgym.scene.objects import ACTION, TASK, Float1D, ObjectType, SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = ["SELF", "Arrangement", "arranged", "default_parts", "numbered"]

SELF = "self"
"""Name of the object that has all numbers that nobody gave to another one."""


@dataclass(frozen=True)
class Arrangement:
    """Scenes and where they come from.

    Attributes
    ----------
    schema, layout
        The scenes' schema, and their layout without an action.
    gather
        Where each element of the state vector comes from: the concatenation of numbers, angles and constants.
    constants
        Values of what never changes.
    pairs
        Numbers that are (cos, sin), one pair per angle.
    """

    schema: SceneSchema
    layout: SceneLayout
    gather: NDArray[np.intp]
    constants: Float1D
    pairs: tuple[tuple[int, int], ...]


def numbered(count: int, name: str = "x") -> tuple[str, ...]:
    """Names of an object's numbers where nobody named them: ``x`` if there is one, else ``x0``, ``x1``, …."""
    return (name,) if count == 1 else tuple(f"{name}{k}" for k in range(count))


def default_parts(names: Sequence[str], parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts, and objects for the numbers that are in none: by key (``key.x0``) or `SELF`.

    Raises
    ------
    ConfigError
        A number that isn't there, or that two parts claim; keys that differ only in what no identifier may hold.
    """
    claimed = [source for part in parts for source in part.sources.values()]
    if unknown := sorted(set(claimed) - set(names)):
        raise ConfigError(f"parts name numbers {unknown} that the observation lacks; it has {tuple(names)}")
    if twice := sorted({name for name in claimed if claimed.count(name) > 1}):
        raise ConfigError(f"the numbers {twice} are claimed by several parts; give each to one")
    rest: dict[str, dict[str, str]] = {}
    keys: dict[str, str] = {}
    for name in names:
        if name not in claimed:
            key, dot, prop = name.rpartition(".")
            owner = identifier(key) if dot else SELF
            if keys.setdefault(owner, key) != key:
                raise ConfigError(
                    f"the keys {keys[owner]!r} and {key!r} would both be objects {owner!r}; name one of them yourself: "
                    f"parts=[Part('other', {{{prop!r}: {name!r}, ...}})]"
                )
            rest.setdefault(owner, {})[prop] = name
    return (*parts, *(Part(owner, columns) for owner, columns in rest.items()))


def arranged(
    names: Sequence[str],
    parts: Sequence[Part],
    angles: Sequence[Angle],
    static: Sequence[Static],
    action: ObjectType,
    axes: tuple[str, bool],
    precision: float,
) -> Arrangement:
    """Put objects together from numbers.

    Parameters
    ----------
    names
        Names of all numbers, in order.
    parts, angles, static
        What there is: see `NumbersView`; every number is in one part.
    action
        Type of the action object.
    axes
        `up` and `planar` of the schema.
    precision
        Of the numbers.

    Raises
    ------
    ConfigError
        Names that clash, angles of numbers that aren't there or belong to two objects.
    """
    pairs = _pairs({name: k for k, name in enumerate(names)}, angles)
    sources: list[int] = []
    constants: list[float] = []
    kinds: list[ObjectType] = []
    everything: list[Part | Static] = [*parts, *static]
    for part in everything:
        own = _shown(part, names, pairs, angles) if isinstance(part, Part) else {}
        fixed = part.constants if isinstance(part, Part) else part.values
        if twice := sorted(set(own) & set(fixed)):
            raise ConfigError(
                f"object {part.name!r}: the properties {twice} are columns and constants at once"
            )
        first = len(names) + len(angles) + len(constants)
        sources += [*own.values(), *range(first, first + len(fixed))]
        constants += [float(value) for value in fixed.values()]
        turning = tuple(prop for prop, source in own.items() if source >= len(names))
        kinds.append(_kind(part, (*own, *fixed), turning))
    owners = [part.name for part in everything]
    identifiers("names of the objects", owners, len(owners))
    for taken, what in ((ACTION, "what the agent does"), (TASK, "what a step brings")):
        if taken in owners:
            raise ConfigError(
                f"an object of an observation can't be called {taken!r}: that is {what}; call it otherwise (numbers "
                f"under a Dict's key {taken!r}: parts=[Part('other', {{'x0': '{taken}.x0', ...}})])"
            )
    objects = [(name, kind.name) for name, kind in zip(owners, kinds, strict=True)]
    up, planar = axes
    types, shown = (*merged(kinds), action), (*objects, (ACTION, ACTION))
    schema = SceneSchema(types, shown, up=up, planar=planar, precision=precision)
    return Arrangement(schema, schema.layout(owners), np.array(sources, np.intp), np.array(constants), pairs)


def _pairs(place: Mapping[str, int], angles: Sequence[Angle]) -> tuple[tuple[int, int], ...]:
    for angle in angles:
        if missing := [name for name in (angle.cos, angle.sin) if name not in place]:
            raise ConfigError(
                f"{angle}: the observation has no numbers {missing}; it has {tuple(place)}, and angles are pairs of "
                "those: (cosine, sine)"
            )
    return tuple((place[angle.cos], place[angle.sin]) for angle in angles)


def _shown(
    part: Part, names: Sequence[str], pairs: Sequence[tuple[int, int]], angles: Sequence[Angle]
) -> dict[str, int]:
    """Source of each property: where a cosine stands the angle, where its sine stands nothing."""
    place = {name: k for k, name in enumerate(names)}
    cosines = {pair[0]: k for k, pair in enumerate(pairs)}
    sines = {pair[1] for pair in pairs}
    found: dict[str, int] = {}
    for prop, source in part.sources.items():
        number = place[source]
        if number in sines:
            continue
        shown, where = prop, number
        if number in cosines:
            angle = angles[cosines[number]]
            if angle.sin not in part.sources.values():
                raise ConfigError(f"{angle}: both numbers must belong to the same object")
            shown, where = angle.named(prop), len(names) + cosines[number]
        if shown in found:
            raise ConfigError(f"object {part.name!r} has two properties {shown!r}; rename one of them")
        found[shown] = where
    return found


def _kind(part: Part | Static, properties: tuple[str, ...], decoded: tuple[str, ...]) -> ObjectType:
    if isinstance(part, Static):
        return ObjectType(part.type or part.name, properties, part.shape)
    return ObjectType(
        part.type or part.name,
        properties,
        part.shape,
        pose=dict(part.pose),
        velocity=tuple(part.velocity),
        angles=(*part.angles, *decoded),
    )
