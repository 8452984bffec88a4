"""Which numbers a law may read: an object's own velocity and properties, and what bodiless objects say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.scene.axes import WORLD, Axes
from relgym.scene.objects import ObjectType, SceneLayout, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Sphere

__all__ = ["Sources", "spin_of", "vector_types"]


def vector_types(schema: SceneSchema, targets: tuple[Target, ...]) -> tuple[ObjectType, ...]:
    """Types with a body whose velocity has a component along every axis in use, each of them a target."""
    used = Axes.of(schema).used
    known = {(t.type, t.property) for t in targets}
    found = []
    for t in schema.types:
        names = [t.velocity[axis] for axis in used] if t.velocity else [None]
        if t.has_body and all(name is not None and (t.name, name) in known for name in names):
            found.append(t)
    return tuple(found)


def spin_of(schema: SceneSchema, t: ObjectType, targets: tuple[Target, ...]) -> str | None:
    """Name of the property that says how fast a type spins in the plane; None where none is learned.

    It is the one that is declared as the rate of the rotation about the depth axis. The points at which bodies touch
    are known, and so is, with the spin, how fast they move.
    """
    axes = Axes.of(schema)
    if not axes.planar or t.shape is None:
        return None
    rotation = f"r{WORLD[axes.depth]}"
    angle = t.pose.get(rotation, rotation)
    rates = [k.rate for k in schema.kinematics if (k.type, k.property) == (t.name, angle)]
    known = {(target.type, target.property) for target in targets}
    return next((rate for rate in rates if (t.name, rate) in known), None)


@dataclass(frozen=True, slots=True)
class Sources:
    """Columns that the laws of one moving type may read.

    Attributes
    ----------
    type
        The type.
    velocity
        Names of the velocity's components along the axes in use.
    spin
        Name of the property that is the angular velocity (`spin_of`), if there is one.
    names
        Names of all columns: velocity and spin first, then the type's other properties (the pose left out: laws
        hold everywhere), then those of bodiless objects, as ``type.property``; `drag` and `where` last.
    drag
        Names of the velocity's components times its magnitude: resistance of the air goes with them. As `where`.
    where
        Names of the position's components, by which laws of free motion may differ from region to region. Only where
        bodies turn: of others modes know regions by their clauses.
    """

    type: ObjectType
    velocity: tuple[str, ...]
    spin: str | None
    names: tuple[str, ...]
    drag: tuple[str, ...] = ()
    where: tuple[str, ...] = ()

    @classmethod
    def of(cls, schema: SceneSchema, t: ObjectType, targets: tuple[Target, ...] = ()) -> Sources:
        """Return the columns of a type whose velocity is a vector; `targets` are what is learned."""
        velocity = tuple(name for axis in Axes.of(schema).used if (name := t.velocity[axis]) is not None)
        posed = {t.properties[k] for k in t.pose_columns() if k >= 0}
        spin = spin_of(schema, t, targets)
        moving = velocity if spin is None else (*velocity, spin)
        others = [p for p in t.properties if p not in posed and p not in moving]
        single = [b for b in schema.types if not b.has_body and _count(schema, b) == 1]
        outside = [f"{b.name}.{p}" for b in sorted(single, key=_by_name) for p in b.properties]
        drag: tuple[str, ...] = ()
        where: tuple[str, ...] = ()
        if any(_turns(o, spin_of(schema, o, targets)) for o in vector_types(schema, targets)):
            columns = t.pose_columns()
            where = tuple(t.properties[columns[axis]] for axis in Axes.of(schema).used if columns[axis] >= 0)
            drag = tuple(f"|v|*{name}" for name in velocity)
        return cls(t, velocity, spin, (*moving, *others, *outside, *drag, *where), drag, where)

    @property
    def turns(self) -> bool:
        """Whether the type spins and isn't round: where it is touched depends on how it is turned."""
        return _turns(self.type, self.spin)

    @property
    def readable(self) -> tuple[str, ...]:
        """Columns that functions may read: all but where the body is."""
        return self.names[: len(self.names) - len(self.where)]

    @property
    def moving(self) -> tuple[str, ...]:
        """What laws of motion predict: the velocity's components, then the spin if there is one."""
        return self.velocity if self.spin is None else (*self.velocity, self.spin)

    def places(self, layout: SceneLayout, index: int, drag: int = 0) -> NDArray[np.intp]:
        """Where the columns of an object lie in a state vector with NaN appended, those of `drag` from a place on."""
        places = []
        for name in self.names:
            if name in self.drag:
                places.append(drag + self.drag.index(name))
                continue
            owner, _, prop = name.rpartition(".")
            if not owner:
                places.append(layout.column(index, name))
                continue
            where = layout.of_type(owner)
            places.append(layout.column(where[0], prop) if len(where) == 1 else layout.width)
        return np.array(places, dtype=np.intp)

    def preference(self, component: int) -> tuple[int, ...]:
        """Columns in the order in which a component's law prefers them: the component itself first."""
        return (component, *(k for k in range(len(self.readable)) if k != component))


def _turns(t: ObjectType, spin: str | None) -> bool:
    return spin is not None and not isinstance(t.shape, Sphere)


def _by_name(t: ObjectType) -> str:
    return t.name


def _count(schema: SceneSchema, t: ObjectType) -> int:
    return sum(name == t.name for _, name in schema.objects)
