"""Canonical shapes of object types: one per type, of unit size; a scene's `sx sy sz` scale them.

A shape lives in the schema, its size and pose in the observation. Canonical coordinates are
scaled by the extents, rotated about the world axes by `rx`, then `ry`, then `rz` (R = Rz Ry Rx), and moved
to the position. So `sx sy sz` are the full extents along x, y, z before the rotation, for every shape that
fills the unit cube.

In a planar schema only the outline in the plane of the first axis and the up axis counts, turned about the
depth axis; the other two rotations are ignored. The *first* axis is the one that is neither up nor depth: x
unless x is up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing_fields
from relgym.errors import ShapeError
from relgym.scene.hull import check_polygon, facets, outline_of

__all__ = ["Box", "Compound", "ConvexPolyhedron", "Prism", "Shape", "Sphere", "Wedge", "outline", "outlines"]


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball of diameter 1 around the origin (a disc in a planar schema).

    It stays round: a scene's diameter is `sx`, and extents that differ by more than 1e-9 of it raise
    `ShapeError`.
    """


@dataclass(frozen=True, slots=True)
class Box:
    """The cube [-1/2, 1/2]^3."""


@dataclass(frozen=True, slots=True)
class Wedge:
    """Right-angled prism in the unit cube: vertical face at -1/2 of the first axis, slope down to +1/2."""


@refusing_fields(ShapeError)
@dataclass(frozen=True, slots=True)
class Prism:
    """A convex polygon in the plane of first and up axis, extruded from -1/2 to 1/2 along the depth axis.

    Parameters
    ----------
    vertices
        Corners in order round the outline, in either sense. `ShapeError` where they aren't strictly convex.
    """

    vertices: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        check_polygon(self.vertices)


@refusing_fields(ShapeError)
@dataclass(frozen=True, slots=True)
class ConvexPolyhedron:
    """The convex polyhedron with these corners, given along x, y and z.

    Parameters
    ----------
    vertices
        Corners in any order. `ShapeError` where they lie in one plane or one isn't a corner of their convex
        hull.
    """

    vertices: tuple[tuple[float, float, float], ...]

    def __post_init__(self) -> None:
        facets(self.vertices)


@refusing_fields(ShapeError)
@dataclass(frozen=True, slots=True)
class Compound:
    """Convex polygons that hang together, such as the two beams of a T, each extruded like a `Prism`.

    Planar schemas only, and the array geometry.

    Parameters
    ----------
    parts
        Corners of each part in order round its outline, in the plane of first and up axis. Parts may share edges;
        where they overlap, the overlap counts twice in whatever is worked out from areas. `ShapeError` where there is
        no part, or one isn't strictly convex.
    """

    parts: tuple[tuple[tuple[float, float], ...], ...]

    def __post_init__(self) -> None:
        if not self.parts:
            raise ShapeError(
                "a compound needs at least one part, got none; give the corners of each convex part"
            )
        for part in self.parts:
            check_polygon(part)


Shape: TypeAlias = Sphere | Box | Wedge | Prism | ConvexPolyhedron | Compound

_SQUARE = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
_TRIANGLE = ((-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5))


def outline(shape: Shape, plane: tuple[int, int] = (0, 1)) -> NDArray[np.float64]:
    """Outline of a canonical shape in the plane of the first axis and the up axis.

    Parameters
    ----------
    shape
        Any shape but a sphere, whose outline has no corners, and a compound, which has several (`outlines`).
    plane
        World axes (0, 1, 2) that are first and up.

    Returns
    -------
    Corners, counter-clockwise, shape ``(V, 2)``.
    """
    match shape:
        case Box():
            return np.array(_SQUARE)
        case Wedge():
            return np.array(_TRIANGLE)
        case Prism(vertices):
            return np.array(vertices if check_polygon(vertices) else vertices[::-1], dtype=np.float64)
        case ConvexPolyhedron(corners):
            return outline_of(np.array(corners, dtype=np.float64)[:, list(plane)])
        case Compound():
            raise TypeError("a compound has an outline for each of its parts: ask for its outlines")
        case Sphere():
            raise TypeError("a sphere's outline has no corners")


def outlines(shape: Shape, plane: tuple[int, int] = (0, 1)) -> tuple[NDArray[np.float64], ...]:
    """Outlines of a shape's convex parts, as `outline` gives one; a sphere has none."""
    if isinstance(shape, Sphere):
        return ()
    if isinstance(shape, Compound):
        return tuple(outline(Prism(part), plane) for part in shape.parts)
    return (outline(shape, plane),)
