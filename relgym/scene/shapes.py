"""Canonical shapes of object types: one per type, of unit size; a scene's `sx sy sz` scale them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

__all__ = ["Box", "ConvexPolyhedron", "Prism", "Shape", "Sphere", "Wedge"]


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball of diameter 1 around the origin (a disc in a planar schema)."""


@dataclass(frozen=True, slots=True)
class Box:
    """The cube [-1/2, 1/2]^3."""


@dataclass(frozen=True, slots=True)
class Wedge:
    """Right-angled prism in the unit cube: vertical face at -1/2 on the first axis, slope descending to +1/2."""


@dataclass(frozen=True, slots=True)
class Prism:
    """A convex polygon in the plane of the first axis and the up axis, extruded along the depth axis."""

    vertices: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class ConvexPolyhedron:
    """The convex polyhedron with these corners."""

    vertices: tuple[tuple[float, float, float], ...]


Shape: TypeAlias = Sphere | Box | Wedge | Prism | ConvexPolyhedron
