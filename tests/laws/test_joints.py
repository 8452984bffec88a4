"""Who takes which part of what a contact does: centres, surfaces, shares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.laws.frames import turned
from relgym.laws.joints import Joint, Joints

SPEEDS = st.floats(-2.0, 2.0)
PARTS = st.floats(0.05, 0.95)


def joint(angle: float, *, share: float = 1.0, grip: float | None = None, arms: tuple[float, float]) -> Joint:
    """Body 0 touches body 1 of a single scene."""
    normal = np.array([[np.cos(angle)], [np.sin(angle)]])
    parts = None if grip is None else np.array([[grip]])
    joints = Joints(np.array([[share]]), parts, np.array(arms).reshape(2, 1, 1))
    return joints.at(np.array([0]), 0, np.array([0]), np.array([1]), normal)


def state(*bodies: tuple[float, float, float]) -> np.ndarray:
    """Velocity and spin of each body, shape ``(3, 1, K)``."""
    return np.array(bodies).T[:, None]


def test_a_disc_that_rolls_does_not_slip() -> None:
    # On a floor: moving right by 0.2 and turning clockwise by 2 rad a step, with a radius of 0.1.
    rolling = joint(np.pi / 2, grip=1 / 3, arms=(0.1, 0.0))
    assert rolling.relative(state((0.2, 0.0, -2.0), (0.0, 0.0, 0.0))).ravel() == pytest.approx([0.0, 0.0])
    assert rolling.relative(state((0.2, 0.0, 2.0), (0.0, 0.0, 0.0))).ravel() == pytest.approx([0.4, 0.0])


def test_what_drags_at_the_rim_turns_the_disc() -> None:
    moving = state((0.3, 0.0, 0.0), (0.0, 0.0, 0.0))
    joint(np.pi / 2, grip=1 / 3, arms=(0.1, 0.0)).apply(np.array([[-0.3], [0.0]]), moving)
    # It rolls from then on: two thirds of its velocity, and the spin that belongs to it.
    assert moving[:, 0, 0] == pytest.approx([0.2, 0.0, -2.0])
    assert moving[:, 0, 1].tolist() == [0.0, 0.0, 0.0]


def test_without_grip_centres_count() -> None:
    moving = np.array([[[0.3, 0.1]], [[-0.2, 0.0]]])
    plain = joint(np.pi / 2, share=0.25, arms=(0.0, 0.0))
    assert plain.relative(moving).ravel() == pytest.approx([0.2, -0.2])
    plain.apply(np.array([[0.0], [0.4]]), moving)
    assert moving[:, 0, 0] == pytest.approx([0.3, -0.1])
    assert moving[:, 0, 1] == pytest.approx([0.1, -0.3])


@given(st.floats(0.0, 6.28), PARTS, PARTS, st.tuples(*[SPEEDS] * 6), st.tuples(SPEEDS, SPEEDS))
def test_the_relative_velocity_changes_by_just_that(
    angle: float, share: float, grip: float, moving: tuple[float, ...], change: tuple[float, float]
) -> None:
    between = joint(angle, share=share, grip=grip, arms=(0.1, 0.25))
    bodies = state(moving[:3], moving[3:])  # type: ignore[arg-type]
    before, wanted = between.relative(bodies), np.array(change)[:, None]
    between.apply(wanted, bodies)
    assert np.allclose(between.relative(bodies) - before, wanted, atol=1e-12)


@given(st.floats(0.0, 6.28), st.floats(0.2, 5.0), st.tuples(SPEEDS, SPEEDS))
def test_momentum_and_turning_are_kept(angle: float, mass: float, change: tuple[float, float]) -> None:
    # Two discs of masses `mass` and 1, radii 0.1 and 0.25.
    radii, masses = np.array([0.1, 0.25]), np.array([mass, 1.0])
    between = joint(angle, share=1.0 / (1.0 + mass), grip=1 / 3, arms=(0.1, 0.25))
    bodies = state((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    between.apply(np.array(change)[:, None], bodies)
    assert np.allclose((bodies[:2, 0] * masses).sum(axis=1), 0.0, atol=1e-12)
    impulse = masses[0] * bodies[:2, 0, 0]
    torque = -radii * float(impulse @ turned(between.normal)[:, 0])
    assert np.allclose(bodies[2, 0], torque / (0.5 * masses * radii**2), atol=1e-9)


def test_what_is_unknown_is_told() -> None:
    share, grip = np.array([[1.0, np.nan]]), np.array([[np.nan, 0.5]])
    arms = np.zeros((2, 1, 2))
    assert Joints(share, None, arms).known().tolist() == [[True, False]]
    assert Joints(share, grip, arms).known().tolist() == [[False, False]]
