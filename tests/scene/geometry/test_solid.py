"""Distances in space: thousands of random rotated pairs against small quadratic and linear programmes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import linprog, nnls
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from relgym.scene.axes import Axes
from relgym.scene.geometry.arrays import ArrayGeometry, Bodies, Measured
from relgym.scene.geometry.mesh import mesh
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, ConvexPolyhedron, Prism, Shape, Sphere, Wedge

SPACE = Axes.of(SceneSchema((), (), up="y", planar=False))
PENTAGON = Prism(tuple((math.cos(a) / 2, math.sin(a) / 2) for a in np.arange(5) * 2 * math.pi / 5))
HULL = ConvexPolyhedron(
    ((0.5, 0, 0), (-0.4, 0.1, 0), (0, 0.5, 0.1), (0, -0.5, 0), (0.1, 0.2, 0.5), (0, 0, -0.5))
)
CORNERED = (Box(), Wedge(), PENTAGON, HULL)
PAIRS = [(a, b) for i, a in enumerate((Sphere(), *CORNERED)) for b in (Sphere(), *CORNERED)[i:]]


def measure(shapes: tuple[Shape, ...], pose: np.ndarray) -> Measured:
    bodies = Bodies(tuple(f"o{k}" for k in range(len(shapes))), shapes)
    return ArrayGeometry(SPACE, bodies).measure(np.ascontiguousarray(pose.transpose(2, 1, 0)))


def random_pose(
    rng: np.random.Generator, shapes: tuple[Shape, ...], n: int, spread: float = 0.9
) -> np.ndarray:
    pose = np.zeros((n, len(shapes), 9))
    pose[..., :3] = rng.uniform(-spread, spread, (n, len(shapes), 3))
    pose[..., 3:6] = rng.uniform(-4.0, 4.0, (n, len(shapes), 3))
    pose[..., 6:] = rng.uniform(0.2, 1.5, (n, len(shapes), 3))
    for k, shape in enumerate(shapes):
        if isinstance(shape, Sphere):
            pose[:, k, 6:] = pose[:, k, 6:7]
    return pose


def points(shape: Shape, pose: np.ndarray) -> np.ndarray:
    """Corners of a placed shape, turned by scipy about the fixed axes x, y, z; a sphere's centre."""
    if isinstance(shape, Sphere):
        return pose[None, :3]
    local = mesh(shape, SPACE.canonical).corners * pose[6:]
    return np.asarray(Rotation.from_euler("xyz", pose[3:6]).apply(local)) + pose[:3]


def differences(shapes: tuple[Shape, ...], pose: np.ndarray) -> np.ndarray:
    a, b = (points(shape, pose[k]) for k, shape in enumerate(shapes))
    return (a[:, None] - b[None]).reshape(-1, 3)


def reach(shapes: tuple[Shape, ...], pose: np.ndarray) -> float:
    return float(sum(pose[k, 6] / 2 for k, shape in enumerate(shapes) if isinstance(shape, Sphere)))


def least_norm(cloud: np.ndarray) -> float:
    """Distance of a convex hull from the origin: min |V w|, w >= 0, sum w = 1 (a QP)."""
    weights, _ = nnls(np.vstack([cloud.T, np.ones(len(cloud))]), np.array([0.0, 0.0, 0.0, 1.0]))
    return float(np.linalg.norm(cloud.T @ weights) / weights.sum())


def signed(shapes: tuple[Shape, ...], pose: np.ndarray) -> float:
    cloud = differences(shapes, pose)
    if len(cloud) > 1:
        depth = float(ConvexHull(cloud).equations[:, 3].max())
        if depth <= 0.0:
            return depth - reach(shapes, pose)
    return least_norm(cloud) - reach(shapes, pose)


@pytest.mark.parametrize("shapes", PAIRS, ids=repr)
def test_distance_is_the_quadratic_programmes(shapes: tuple[Shape, Shape]) -> None:
    pose = random_pose(np.random.default_rng(0), shapes, 200)
    got = measure(shapes, pose).distance[0]
    expected = np.array([signed(shapes, p) for p in pose])
    assert (expected < -0.02).sum() > 10 < (expected > 0.02).sum()
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("shapes", PAIRS, ids=repr)
def test_normal_is_the_way_out(shapes: tuple[Shape, Shape]) -> None:
    pose = random_pose(np.random.default_rng(1), shapes, 300)
    found = measure(shapes, pose)
    normal, distance = found.normal[:, 0], found.distance[0]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=0), 1.0, atol=1e-14)
    for gap in (0.0, 0.25):
        moved = pose.copy()
        moved[:, 0, :3] += ((gap - distance) * normal).T
        np.testing.assert_allclose(measure(shapes, moved).distance[0], gap, atol=1e-12)


@pytest.mark.parametrize("shapes", [(Box(), Box()), (Wedge(), PENTAGON), (HULL, Box())], ids=repr)
def test_overlap_is_the_linear_programmes(shapes: tuple[Shape, Shape]) -> None:
    pose = random_pose(np.random.default_rng(2), shapes, 120)
    got = measure(shapes, pose).distance[0]
    for scene, distance in zip(pose, got, strict=True):
        cloud = differences(shapes, scene)
        # The origin is a mixture of the differences exactly if the two share a point.
        mixture = np.vstack([cloud.T, np.ones(len(cloud))])
        found = linprog(np.zeros(len(cloud)), A_eq=mixture, b_eq=[0.0, 0.0, 0.0, 1.0])
        assert abs(distance) > 1e-6
        assert (found.status == 0) == (distance < 0.0)


def test_hand_worked() -> None:
    def one(shapes: tuple[Shape, Shape], *pose: list[float]) -> tuple[float, list[float]]:
        found = measure(shapes, np.array([pose]))
        return float(found.distance[0, 0]), found.normal[:, 0, 0].tolist()

    def placed(x: float, y: float, z: float, size: float = 1.0) -> list[float]:
        return [x, y, z, 0.0, 0.0, 0.0, size, size, size]

    ball, box = Sphere(), Box()
    assert one((ball, box), placed(0, 3, 0), placed(0, 0, 0, 4)) == (0.5, [0.0, 1.0, 0.0])
    assert one((ball, box), placed(5, 6, 0), placed(0, 0, 0, 4)) == (4.5, [0.6, 0.8, 0.0])
    distance, normal = one((ball, box), placed(3, 4, 4), placed(0, 0, 0, 4))
    assert (distance, normal) == (2.5, pytest.approx([1 / 3, 2 / 3, 2 / 3], abs=1e-15))
    assert one((box, ball), placed(0, 0, 0, 4), placed(0, -1.5, 0)) == (-1.0, [0.0, 1.0, 0.0])
    # Boxes side by side touch at exactly 0, edge to edge and corner to corner they don't.
    assert one((box, box), placed(1, 0.5, 0.25), placed(0, 0, 0)) == (0.0, [1.0, 0.0, 0.0])
    assert one((box, box), placed(4, 5, 0), placed(0, 0, 0)) == (5.0, [0.6, 0.8, 0.0])
    distance, normal = one((box, box), placed(2, 3, 3), placed(0, 0, 0))
    assert (distance, normal) == (3.0, pytest.approx([1 / 3, 2 / 3, 2 / 3], abs=1e-15))
    # Crossed edges: a cube turned by 45 degrees about z over one turned about x, ridge over ridge.
    crossed = np.array([[placed(0, 2, 0), placed(0, 0, 0)]])
    crossed[0, 0, 5] = crossed[0, 1, 3] = math.pi / 4
    found = measure((box, box), crossed)
    assert found.distance[0, 0] == pytest.approx(2.0 - math.sqrt(2.0), abs=1e-15)
    assert found.normal[:, 0, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)


def test_tiny_gaps_keep_exact_distances_and_normals() -> None:
    for gap in (1e-15, 1e-12, 1e-9):
        pose = np.zeros((1, 2, 9))
        pose[..., 6:] = 1.0
        pose[0, 0, :3] = 0.1, 1.0 + gap, 0.2
        for shapes in ((Sphere(), Box()), (Box(), Box())):
            found = measure(shapes, pose)
            assert found.distance[0, 0] == (1.0 + gap) - 1.0
            assert found.normal[:, 0, 0].tolist() == [0.0, 1.0, 0.0]
