"""Bodies in the engine: moments, order of events, and that nothing is remembered where nothing shall be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from relgym.envs.bodies import Body, BodyWorld
from relgym.envs.box_push import TEE
from relgym.envs.physics import TIME_STEP
from relgym.scene.geometry.areas import mean_squares
from relgym.scene.shapes import Box, Sphere, Wedge

WALL = Body(Box(), (4.0, 1.0), math.inf, 0.0, 0.0)


def test_moments_of_uniform_bodies() -> None:
    assert Body(Box(), (3.0, 4.0), 6.0).moment == pytest.approx(6.0 * 25.0 / 12.0)
    assert Body(Sphere(), (2.0, 2.0), 3.0).moment == pytest.approx(1.5)
    assert Body(Sphere(), (2.0, 2.0), 3.0).area == pytest.approx(math.pi)
    assert Body(Box(), (1.0, 1.0), turns=False).moment == math.inf


def test_mean_squares_of_a_right_triangle() -> None:
    area, x2, y2 = mean_squares((Wedge(),), (0, 1))[:, 0]
    # Corners (-1/2, -1/2), (1/2, -1/2), (-1/2, 1/2): centroid (-1/6, -1/6), variance 1/18.
    assert (area, x2, y2) == pytest.approx((0.5, 1 / 18 + 1 / 36, 1 / 18 + 1 / 36))


def test_the_centroid_of_a_t_is_its_origin() -> None:
    moments = np.zeros(2)
    for part in TEE.parts:
        corners = np.array(part)
        size = np.ptp(corners, axis=0)
        moments += size.prod() * (corners.min(axis=0) + size / 2.0)
    assert moments == pytest.approx([0.0, 0.0], abs=1e-15)


def placed(x: float, v: float, *, memoryless: bool = False) -> BodyWorld:
    world = BodyWorld([Body(Box(), (1.0, 1.0), 1.0, 0.0, 0.0), WALL], memoryless=memoryless)
    world.place(np.array([[x, 0.0, 0.0], [0.0, -0.99, 0.0]]), np.array([[v, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    return world


def test_what_is_decided_in_a_state_acts_on_its_contacts() -> None:
    world = placed(0.0, 0.0)
    world.step(np.array([[2.0, -5.0], [0.0, 0.0]]))
    moved = world.poses()[0] - (0.0, 0.0, 0.0)
    # The push to the side moves it in the very next displacement; the wall below takes the other one.
    assert moved == pytest.approx([2.0 * TIME_STEP**2, 0.0, 0.0], abs=1e-15)
    assert world.contacts() == [(0, 1)]


def test_without_memory_states_are_all_there_is() -> None:
    world = placed(0.0, 0.01, memoryless=True)
    for _ in range(5):
        world.step()
    twin = placed(0.0, 0.0, memoryless=True)
    twin.resume(world.state())
    world.step()
    twin.step()
    assert np.array_equal(world.state(), twin.state())
