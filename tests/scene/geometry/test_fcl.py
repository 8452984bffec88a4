"""The two geometries against each other, on thousands of random scenes."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from relgym.scene.axes import Axes
from relgym.scene.geometry.arrays import ArrayGeometry, Bodies
from relgym.scene.geometry.fcl import FclGeometry
from relgym.scene.relations import TOUCH_EPS
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, ConvexPolyhedron, Prism, Sphere, Wedge

PENTAGON = Prism(tuple((math.cos(a) / 2, math.sin(a) / 2) for a in np.arange(5) * 2 * math.pi / 5))
HULL = ConvexPolyhedron(
    ((0.5, 0, 0), (-0.4, 0.1, 0), (0, 0.5, 0.1), (0, -0.5, 0), (0.1, 0.2, 0.5), (0, 0, -0.5))
)
SHAPES = (Sphere(), Box(), Wedge(), Sphere(), PENTAGON, HULL, Box())
BODIES = Bodies(tuple("abcdefg"), SHAPES)


def random_pose(rng: np.random.Generator, n: int, spread: float) -> np.ndarray:
    pose = np.empty((9, len(SHAPES), n))
    pose[:3] = rng.uniform(-spread, spread, (3, len(SHAPES), n))
    pose[3:6] = rng.uniform(-4.0, 4.0, (3, len(SHAPES), n))
    pose[6:] = rng.uniform(0.2, 1.5, (3, len(SHAPES), 1))
    pose[6:, [0, 3]] = pose[6, [0, 3]]
    return pose


@pytest.mark.parametrize("up", ["x", "y", "z"])
@pytest.mark.parametrize("planar", [True, False])
def test_geometries_agree(planar: bool, up: str) -> None:
    axes = Axes.of(SceneSchema((), (), up=up, planar=planar))
    arrays, by_fcl = ArrayGeometry(axes, BODIES), FclGeometry(axes, BODIES)
    pose = random_pose(np.random.default_rng(0), 150, 1.2)
    a, b = arrays.measure(pose), by_fcl.measure(pose)
    np.testing.assert_allclose(b.distance, a.distance, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(b.low, a.low)
    np.testing.assert_array_equal(b.high, a.high)
    # Where two ways out are equally short, either normal is right; that is rare.
    assert (np.abs(b.normal - a.normal).max(axis=0) < 1e-6).mean() > 0.999


@pytest.mark.parametrize("planar", [True, False])
def test_touching_agrees_to_the_threshold(planar: bool) -> None:
    axes = Axes.of(SceneSchema((), (), planar=planar))
    arrays, by_fcl = ArrayGeometry(axes, BODIES), FclGeometry(axes, BODIES)
    rng = np.random.default_rng(1)
    count = len(SHAPES)
    for gap in (2.5e-9, 1e-12, -1e-12, -1e-7):
        for other in range(1, count):
            # Bring two bodies to almost touching: the first moves along the normal.
            pose = random_pose(rng, 20, 1.0)
            before = arrays.measure(pose)
            push = (gap - before.distance[other - 1]) * before.normal[:, other - 1]
            for k, axis in enumerate(axes.used):
                pose[axis, 0] += push[k]
            a, b = arrays.measure(pose).distance, by_fcl.measure(pose).distance
            assert ((a <= TOUCH_EPS) == (b <= TOUCH_EPS)).all()
            np.testing.assert_allclose(a[other - 1], gap, rtol=0, atol=1e-14)


def test_bodies_that_touch_exactly_touch() -> None:
    axes = Axes.of(SceneSchema((), (), planar=False))
    bodies = Bodies(("lower", "upper", "ball"), (Box(), Box(), Sphere()))
    pose = np.zeros((9, 3, 1))
    pose[6:] = 1.0
    pose[:3, 1, 0] = 0.25, 1.0, 0.25
    pose[:3, 2, 0] = 0.25, 2.0, 0.25
    measured = FclGeometry(axes, bodies).measure(pose)
    np.testing.assert_array_equal(measured.distance[:, 0], [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(measured.normal[:, :, 0], [[0, 0, 0], [-1, -1, -1], [0, 0, 0]])


def test_ball_sunk_beyond_its_centre_is_measured_too() -> None:
    axes = Axes.of(SceneSchema((), (), planar=True))
    pose = np.zeros((9, 2, 1))
    pose[6:] = 1.0
    pose[0, 0] = 0.3
    measured = FclGeometry(axes, Bodies(("ball", "ramp"), (Sphere(), Box()))).measure(pose)
    np.testing.assert_allclose(measured.distance, [[-0.7]], atol=1e-15)
    np.testing.assert_array_equal(measured.normal[:, 0, 0], [1.0, 0.0])


def test_geometry_survives_pickling_and_resizing() -> None:
    axes = Axes.of(SceneSchema((), (), planar=False))
    geometry = FclGeometry(axes, BODIES)
    rng = np.random.default_rng(2)
    geometry.measure(random_pose(rng, 2, 1.0))
    copy = pickle.loads(pickle.dumps(geometry))
    pose = random_pose(rng, 3, 1.0)
    np.testing.assert_array_equal(copy.measure(pose).distance, geometry.measure(pose).distance)
