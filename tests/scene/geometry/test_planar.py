"""Planar distances and normals: hand-worked cases, and thousands of random pairs against shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from relgym.scene.axes import Axes
from relgym.scene.geometry.arrays import ArrayGeometry, Bodies, Measured
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, ConvexPolyhedron, Prism, Shape, Sphere, Wedge, outline

PLANE = Axes.of(SceneSchema((), (), up="y", planar=True))
PENTAGON = Prism(tuple((math.cos(a) / 2, math.sin(a) / 2) for a in np.arange(5) * 2 * math.pi / 5))
CORNERED = (Box(), Wedge(), PENTAGON)


def measure(shapes: tuple[Shape, ...], pose: np.ndarray) -> Measured:
    """Measure scenes; `pose` has shape (n, K, 9)."""
    bodies = Bodies(tuple(f"o{k}" for k in range(len(shapes))), shapes)
    return ArrayGeometry(PLANE, bodies).measure(np.ascontiguousarray(pose.transpose(2, 1, 0)))


def placed(x: float, y: float, sx: float = 1.0, sy: float = 1.0, turn: float = 0.0) -> list[float]:
    return [x, y, 7.0, 0.3, 0.4, turn, sx, sy, 9.0]


def random_pose(
    rng: np.random.Generator, shapes: tuple[Shape, ...], n: int, spread: float = 1.2
) -> np.ndarray:
    pose = np.zeros((n, len(shapes), 9))
    pose[..., :3] = rng.uniform(-spread, spread, (n, len(shapes), 3))
    pose[..., 3:6] = rng.uniform(-4.0, 4.0, (n, len(shapes), 3))
    pose[..., 6:] = rng.uniform(0.2, 1.5, (n, len(shapes), 3))
    for k, shape in enumerate(shapes):
        if isinstance(shape, Sphere):
            pose[:, k, 6:] = pose[:, k, 6:7]
    return pose


def corners(shape: Shape, pose: np.ndarray) -> np.ndarray:
    local = outline(shape) * pose[6:8]
    cos, sin = math.cos(pose[5]), math.sin(pose[5])
    return local @ np.array([[cos, sin], [-sin, cos]]) + pose[:2]


def signed(shapes: tuple[Shape, ...], pose: np.ndarray) -> float:
    """Signed distance of two placed shapes by shapely: of the origin from their Minkowski difference."""
    points = [
        pose[k, None, :2] if isinstance(shape, Sphere) else corners(shape, pose[k])
        for k, shape in enumerate(shapes)
    ]
    radii = sum(pose[k, 6] / 2 for k, shape in enumerate(shapes) if isinstance(shape, Sphere))
    differences = (points[0][:, None] - points[1][None]).reshape(-1, 2)
    hull, origin = shapely.MultiPoint(differences).convex_hull, shapely.Point(0, 0)
    if hull.geom_type == "Polygon" and hull.contains(origin):
        return float(-hull.exterior.distance(origin) - radii)
    return float(hull.distance(origin) - radii)


@pytest.mark.parametrize("a", (Sphere(), *CORNERED), ids=repr)
@pytest.mark.parametrize("b", (Sphere(), *CORNERED), ids=repr)
def test_distance_is_shapelys(a: Shape, b: Shape) -> None:
    rng = np.random.default_rng(0)
    pose = random_pose(rng, (a, b), 300)
    got = measure((a, b), pose).distance[0]
    expected = np.array([signed((a, b), p) for p in pose])
    assert (expected < -0.05).sum() > 20 < (expected > 0.05).sum()
    np.testing.assert_allclose(got, expected, rtol=0, atol=2e-14)


@pytest.mark.parametrize("a", (Sphere(), *CORNERED), ids=repr)
@pytest.mark.parametrize("b", (Sphere(), *CORNERED), ids=repr)
def test_normal_is_the_way_out(a: Shape, b: Shape) -> None:
    rng = np.random.default_rng(1)
    pose = random_pose(rng, (a, b), 500)
    found = measure((a, b), pose)
    normal, distance = found.normal[:, 0], found.distance[0]
    np.testing.assert_allclose(np.hypot(*normal), 1.0, atol=1e-14)
    # Moved along the normal by -distance, the two just touch; moved by more, they are as far apart as that.
    for gap in (0.0, 0.25):
        moved = pose.copy()
        moved[:, 0, :2] += ((gap - distance) * normal).T
        np.testing.assert_allclose(measure((a, b), moved).distance[0], gap, atol=1e-13)


def test_hand_worked() -> None:
    def one(shapes: tuple[Shape, Shape], *pose: list[float]) -> tuple[float, list[float]]:
        found = measure(shapes, np.array([pose]))
        return float(found.distance[0, 0]), found.normal[:, 0, 0].tolist()

    # A ball of radius 1/2 beside, over the corner of, and sunk into a box of 4 x 2.
    ball, box = Sphere(), Box()
    assert one((ball, box), placed(3, 0), placed(0, 0, 4, 2)) == (0.5, [1.0, 0.0])
    assert one((ball, box), placed(5, 5), placed(0, 0, 4, 2)) == (4.5, [0.6, 0.8])
    distance, normal = one((box, ball), placed(0, 0, 4, 2), placed(1, 1.25))
    assert (distance, normal) == (-0.25, [0.0, -1.0])
    # Centre inside: the nearest face is the way out.
    assert one((ball, box), placed(1, 0.75), placed(0, 0, 4, 2)) == (-0.75, [0.0, 1.0])
    # The slope of a wedge descends to the right: at its middle it is half as high.
    distance, normal = one((ball, Wedge()), placed(1, 1), placed(0, 0, 2, 2))
    assert distance == pytest.approx(math.sqrt(2) - 0.5, abs=1e-15)
    assert normal == pytest.approx([math.sqrt(0.5)] * 2, abs=1e-15)
    # Boxes on each other touch at exactly 0; corner to corner the distance is the diagonal.
    assert one((box, box), placed(0.3, 1.5), placed(0, 0, 4, 2)) == (0.0, [0.0, 1.0])
    assert one((box, box), placed(0, 0), placed(4, 5)) == (5.0, [-0.6, -0.8])
    # Concentric discs are pushed out upwards.
    assert one((ball, ball), placed(0, 0), placed(0, 0)) == (-1.0, [0.0, 1.0])


def test_tiny_gaps_keep_exact_distances_and_normals() -> None:
    for gap in (1e-15, 1e-12, 1e-9):
        pose = np.array([[placed(0.1, 1.0 + gap), placed(0.0, 0.0)]])
        for shapes in ((Sphere(), Box()), (Box(), Box())):
            found = measure(shapes, pose)
            assert found.distance[0, 0] == (1.0 + gap) - 1.0
            assert found.normal[:, 0, 0].tolist() == [0.0, 1.0]


def test_polyhedron_counts_as_its_outline() -> None:
    octahedron = ConvexPolyhedron(((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)))
    rhombus = Prism(((1, 0), (0, 1), (-1, 0), (0, -1)))
    pose = random_pose(np.random.default_rng(2), (Sphere(), Box()), 50)
    for other in (Sphere(), Box()):
        shared = measure((other, octahedron), pose), measure((other, rhombus), pose)
        np.testing.assert_allclose(shared[0].distance, shared[1].distance, atol=1e-15)


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_any_up_axis_sees_the_same_plane(up: str) -> None:
    axes = Axes.of(SceneSchema((), (), up=up, planar=True))
    first, rise, depth = axes.canonical
    shapes = (Sphere(), Wedge(), PENTAGON)
    flat = random_pose(np.random.default_rng(3), shapes, 40)
    pose = np.empty_like(flat)
    for block in (0, 6):
        pose[..., block + first], pose[..., block + rise] = flat[..., block], flat[..., block + 1]
        pose[..., block + depth] = flat[..., block + 2]
    pose[..., 3:6] = 0.0
    pose[..., 3 + depth] = flat[..., 5] * axes.turn
    pose[:, 0, 6:] = flat[:, 0, 6:7]
    bodies = Bodies(("a", "b", "c"), shapes)
    there = ArrayGeometry(axes, bodies).measure(np.ascontiguousarray(pose.transpose(2, 1, 0)))
    here = measure(shapes, flat)
    np.testing.assert_array_equal(there.distance, here.distance)
    np.testing.assert_array_equal(there.normal, here.normal)
