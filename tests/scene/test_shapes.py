"""Shapes: which are refused and why, and the outlines and meshes of those that aren't."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.errors import ShapeError
from relgym.scene.geometry.mesh import mesh
from relgym.scene.shapes import Box, ConvexPolyhedron, Prism, Sphere, Wedge, outline

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
CUBE = tuple((x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0))
PENTAGRAM = tuple((np.cos(a), np.sin(a)) for a in np.arange(5) * 4 * np.pi / 5)


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        (SQUARE[:2], "at least 3 corners, got 2"),
        ((*SQUARE[:2], (0.4, 0.4), *SQUARE[2:]), r"not convex: corner 2 \[0.4, 0.4\] points inwards"),
        ((SQUARE[0], (0.5, 0.0), *SQUARE[1:]), r"corner 1 \[0.5, 0.0\] lies on the line of its neighbours"),
        ((SQUARE[0], SQUARE[0], *SQUARE[1:]), "corner 0 .* occurs twice in a row"),
        (PENTAGRAM, "cross themselves"),
        (((0.0, 0.0), (1.0, 0.0), (2.0, 0.0)), "lies on the line"),
        (((0.0, 0.0), (1.0, 0.0), (np.nan, 1.0)), "finite coordinates"),
        (((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0)), "2 finite coordinates each"),
    ],
)
def test_unusable_polygons_are_refused(corners: tuple[tuple[float, float], ...], message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        Prism(corners)
    with pytest.raises(ShapeError):
        Prism(corners[::-1])


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        (CUBE[:3], "at least 4 corners, got 3"),
        (tuple((x, y, 0.5) for x, y in SQUARE), "degenerate: .* lie in one plane"),
        ((*CUBE, (0.5, 0.5, 0.5)), r"not convex: corner 8 \[0.5, 0.5, 0.5\] is no corner of the convex hull"),
        ((*CUBE, (0.5, 0.5, 1.0)), r"corner 8 .* is no corner"),
        (((np.inf, 0.0, 0.0), *CUBE), "finite coordinates"),
    ],
)
def test_unusable_polyhedra_are_refused(
    corners: tuple[tuple[float, float, float], ...], message: str
) -> None:
    with pytest.raises(ShapeError, match=message):
        ConvexPolyhedron(corners)


def test_outlines_run_counter_clockwise() -> None:
    for shape in (Box(), Wedge(), Prism(SQUARE), Prism(SQUARE[::-1]), ConvexPolyhedron(CUBE)):
        corners = outline(shape)
        x, y = corners.T
        area = 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum()
        assert area == pytest.approx(0.5 if isinstance(shape, Wedge) else 1.0)
    with pytest.raises(TypeError, match="no corners"):
        outline(Sphere())


@pytest.mark.parametrize("canonical", [(0, 1, 2), (0, 2, 1), (2, 0, 1)])
def test_meshes_enclose_their_volume(canonical: tuple[int, int, int]) -> None:
    cube = ConvexPolyhedron(tuple((x - 0.5, y - 0.5, z - 0.5) for x, y, z in CUBE))
    for shape, faces, edges, directions in ((Box(), 6, 12, 3), (Wedge(), 5, 9, 4), (cube, 6, 12, 3)):
        found = mesh(shape, canonical)
        assert (len(found.normals), len(found.edges), len(found.directions)) == (faces, edges, directions)
        # Euler: corners - edges + faces = 2. And no corner lies beyond any face.
        assert len(found.corners) - edges + faces == 2
        heights = (found.corners[:, None] - found.corners[found.anchors]) @ found.normals.T
        assert np.einsum("cff->cf", heights).max() < 1e-12
        assert [len(ring) for ring in found.rings()].count(4) == (6 if faces == 6 else 3)


def test_wedge_stands_upright_left_and_descends_to_the_right() -> None:
    corners = {tuple(c) for c in outline(Wedge())}
    assert corners == {(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5)}
