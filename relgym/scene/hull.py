"""Convex hulls of a few points: the faces and edges of polyhedra, and whether a polygon is convex."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ShapeError

__all__ = ["Facets", "check_polygon", "facets", "outline_of"]

Facets: TypeAlias = tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]
"""Outward unit normals (F, 3), one corner on each face (F,), pairs of corners that edges join (E, 2)."""

_FLAT = 1e-9
"""Sines below this count as 0: corners on one line, faces in one plane."""


def check_polygon(corners: Sequence[tuple[float, float]]) -> bool:
    """Check that corners, in order, form a strictly convex polygon; return whether counter-clockwise.

    Raises
    ------
    ShapeError
        Fewer than three corners, a corner on the line of its neighbours, an inward corner, or a curve that
        winds round more than once; the message names the corner.
    """
    points = _finite(corners, 2)
    if len(points) < 3:
        raise ShapeError(f"a polygon needs at least 3 corners, got {len(points)}: {_show(points)}")
    edges = np.roll(points, -1, axis=0) - points
    lengths = np.sqrt(edges[:, 0] ** 2 + edges[:, 1] ** 2)
    if not lengths.all():
        at = int(np.argmin(lengths))
        raise ShapeError(f"corner {at} {_show(points[at])} occurs twice in a row; leave one of them out")
    turn = _turns(edges, lengths)
    if (flat := np.abs(turn) < _FLAT).any():
        at = int(np.argmax(flat))
        raise ShapeError(f"corner {at} {_show(points[at])} lies on the line of its neighbours; leave it out")
    counter_clockwise = bool(turn.sum() > 0.0)
    inward = turn < 0.0 if counter_clockwise else turn > 0.0
    if inward.any():
        at = int(np.argmax(inward))
        raise ShapeError(
            f"not convex: corner {at} {_show(points[at])} points inwards; split the shape into convex parts"
        )
    if _winding(edges) > 1:
        raise ShapeError(
            f"not convex: the corners {_show(points)} cross themselves; give them in order round the outline"
        )
    return counter_clockwise


def facets(corners: Sequence[tuple[float, float, float]]) -> Facets:
    """Return the faces and edges of the polyhedron with these corners.

    Raises
    ------
    ShapeError
        Fewer than four corners, all in one plane, or a corner that isn't one of their convex hull.
    """
    from scipy.spatial import ConvexHull, QhullError

    points = _finite(corners, 3)
    if len(points) < 4:
        raise ShapeError(f"a polyhedron needs at least 4 corners, got {len(points)}: {_show(points)}")
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[2] <= _FLAT * spread[0]:
        raise ShapeError(
            f"degenerate: the corners {_show(points)} lie in one plane; a polyhedron needs a volume"
        )
    try:
        hull = ConvexHull(points)
    except (
        QhullError
    ) as error:  # pragma: no cover - the checks above should leave nothing for Qhull to refuse
        raise ShapeError(f"no convex hull of {_show(points)}: {error}") from error
    inside = sorted(set(range(len(points))) - set(hull.vertices.tolist()))
    if inside:
        raise ShapeError(
            f"not convex: corner {inside[0]} {_show(points[inside[0]])} is no corner of the convex hull; "
            "leave it out, or split the shape into convex parts"
        )
    return _merge(hull.simplices, hull.neighbors, hull.equations[:, :3])


def outline_of(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners of points' convex hull, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted({(float(x), float(y)) for x, y in points})
    lower, upper = _chain(ordered), _chain(ordered[::-1])
    return np.array(lower[:-1] + upper[:-1])


def _merge(
    simplices: NDArray[np.integer[Any]], neighbours: NDArray[np.integer[Any]], normals: NDArray[np.float64]
) -> Facets:
    # Qhull splits faces into triangles; those in one plane are one face, and what divides them is no edge.
    plane = np.full(len(simplices), -1)
    faces: list[int] = []
    for i, normal in enumerate(normals):
        same = [k for k, j in enumerate(faces) if np.linalg.norm(normal - normals[j]) < _FLAT]
        if not same:
            faces.append(i)
        plane[i] = same[0] if same else len(faces) - 1
    edges = {
        tuple(sorted(set(simplices[i].tolist()) & set(simplices[j].tolist())))
        for i, row in enumerate(neighbours)
        for j in row
        if plane[i] != plane[j]
    }
    return normals[faces], simplices[faces, 0].astype(np.intp), np.array(sorted(edges), dtype=np.intp)


def _turns(edges: NDArray[np.float64], lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sine of the turn at each corner; positive where the outline turns left."""
    before, length = np.roll(edges, 1, axis=0), np.roll(lengths, 1)
    sines: NDArray[np.float64] = (before[:, 0] * edges[:, 1] - before[:, 1] * edges[:, 0]) / (
        length * lengths
    )
    return sines


def _winding(edges: NDArray[np.float64]) -> int:
    """Return how often the outline winds round."""
    heading = np.arctan2(edges[:, 1], edges[:, 0])
    turns = np.diff(np.append(heading, heading[0]))
    turns = (turns + np.pi) % (2.0 * np.pi) - np.pi
    return abs(round(float(turns.sum()) / (2.0 * np.pi)))


def _chain(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    chain: list[tuple[float, float]] = []
    for point in points:
        while len(chain) > 1 and not _left(chain[-2], chain[-1], point):
            chain.pop()
        chain.append(point)
    return chain


def _left(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    u, v = (b[0] - a[0], b[1] - a[1]), (c[0] - b[0], c[1] - b[1])
    return u[0] * v[1] - u[1] * v[0] > _FLAT * float(np.hypot(*u) * np.hypot(*v))


def _finite(corners: Sequence[Sequence[float]], size: int) -> NDArray[np.float64]:
    points = np.asarray(corners, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != size or not np.isfinite(points).all():
        raise ShapeError(f"expected corners of {size} finite coordinates each, got {corners!r}")
    return points


def _show(points: NDArray[np.float64]) -> str:
    return str(points.tolist())
