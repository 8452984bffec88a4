from __future__ import annotations

import math

import pytest

from relgym.envs.physics import BallWorld, Obstacle

G = 9.8e-4
FLOOR = Obstacle("floor", ((-5.0, -1.0), (5.0, -1.0), (5.0, 0.0), (-5.0, 0.0)), elasticity=0.5, friction=0.2)


def step_of(world: BallWorld, index: int = 0) -> tuple[float, float]:
    x0, y0 = world.positions()[index]
    world.step()
    x1, y1 = world.positions()[index]
    return x1 - x0, y1 - y0


def test_free_flight_gains_g_per_step() -> None:
    world = BallWorld([], {"ball": 0.1})
    world.land([(0.0, 1.0)], [(0.02, 0.01)])
    assert world.positions()[0] == pytest.approx((0.0, 1.0), abs=1e-15)
    assert step_of(world) == pytest.approx((0.02, 0.01 - G), abs=1e-15)
    assert step_of(world) == pytest.approx((0.02, 0.01 - 2 * G), abs=1e-15)
    assert world.contacts() == ()


def test_a_bounce_uses_the_velocity_before_gravity() -> None:
    world = BallWorld([FLOOR], {"ball": 0.1})
    world.land([(0.0, 0.095)], [(0.03, -0.02)])
    (contact,) = world.contacts()
    assert (contact.ball, contact.other, contact.normal) == ("ball", "floor", (0.0, 1.0))
    assert contact.depth == pytest.approx(0.005, abs=1e-15)
    # J = -((1 + e) v_n + g_n); v' = v + g + J n, friction mu J against the sliding.
    impulse = 1.5 * 0.02 + G
    assert contact.impulse == pytest.approx(impulse, abs=1e-15)
    assert step_of(world) == pytest.approx((0.03 - 0.2 * impulse, 0.5 * 0.02), abs=1e-15)


def test_a_separating_contact_is_not_active_and_pushes_nothing_out() -> None:
    world = BallWorld([FLOOR], {"ball": 0.1})
    world.land([(0.0, 0.05)], [(0.0, 0.01)])
    (contact,) = world.contacts()
    assert not contact.active and contact.depth == pytest.approx(0.05, abs=1e-15)
    assert step_of(world) == pytest.approx((0.0, 0.01 - G), abs=1e-15)


def test_friction_halts_but_does_not_reverse() -> None:
    world = BallWorld([FLOOR], {"ball": 0.1})
    world.land([(0.0, 0.095)], [(0.001, -0.02)])
    assert step_of(world) == pytest.approx((0.0, 0.01), abs=1e-15)


@pytest.mark.parametrize("x", [5.0 - 1e-12, 5.05, 4.9])
def test_corner_contacts_are_told_from_faces(x: float) -> None:
    world = BallWorld([FLOOR], {"ball": 0.1})
    height = math.sqrt(0.095**2 - max(0.0, x - 5.0) ** 2)
    world.land([(x, height)], [(0.0, -0.01)])
    (contact,) = world.contacts()
    assert contact.corner == (x > 5.0)
    expected = (max(0.0, x - 5.0) / 0.095, height / 0.095)
    assert contact.normal == pytest.approx(expected, abs=1e-12)


def test_two_balls_meet_with_their_own_coefficients() -> None:
    world = BallWorld([], {"a": 0.1, "b": 0.1}, ball_elasticity=0.5, ball_friction=0.0)
    world.land([(-0.095, 1.0), (0.095, 1.0)], [(0.02, 0.0), (-0.02, 0.0)])
    a, b = world.contacts()
    assert (a.ball, a.other, b.ball, b.other) == ("a", "b", "b", "a")
    assert a.normal[0] == pytest.approx(-1.0) and b.normal[0] == pytest.approx(1.0)
    assert not a.corner and not b.corner
    assert step_of(world, 0)[0] == pytest.approx(-0.01, abs=1e-14)


def test_resuming_goes_on_as_if_never_interrupted() -> None:
    world, other = BallWorld([FLOOR], {"ball": 0.1}), BallWorld([FLOOR], {"ball": 0.1})
    world.land([(0.0, 0.5)], [(0.03, 0.0)])
    for _ in range(10):
        world.step()
    other.resume(world.positions(), world.velocities())
    assert step_of(other) == step_of(world)


def test_face_normals_point_outwards() -> None:
    triangle = Obstacle("ramp", ((0.0, 0.0), (3.0, 0.0), (0.0, 4.0)), 1.0, 0.0)
    expected = [(0.0, -1.0), (0.8, 0.6), (-1.0, 0.0)]
    for found, normal in zip(triangle.face_normals(), expected, strict=True):
        assert found == pytest.approx(normal, abs=1e-15)
