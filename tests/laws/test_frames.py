from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.laws.frames import FRAMES, Bearings, axes_of, axis_names

ANGLES = st.floats(0.0, 6.28)
SPEEDS = st.floats(-2.0, 2.0)


def bearings(normal: float, centres: float = 0.3, turn: float = 0.0) -> Bearings:
    sides = [np.array([[math.cos(a)], [math.sin(a)]]) for a in (normal, centres)]
    return Bearings(*sides, np.full((3, 1), turn))


@pytest.mark.parametrize("frame", FRAMES)
@given(ANGLES, ANGLES, ANGLES, SPEEDS, SPEEDS)
def test_axes_in_the_plane_are_orthonormal(
    frame: str, a: float, b: float, c: float, x: float, y: float
) -> None:
    axes = np.stack(axes_of(frame, bearings(a, b, c), np.array([[x], [y]])))[..., 0]
    assert len(axes) == len(axis_names(frame, 2))
    assert np.allclose(axes @ axes.T, np.eye(2), atol=1e-12)


@given(ANGLES, SPEEDS, SPEEDS)
def test_slip_is_never_against_its_direction(angle: float, x: float, y: float) -> None:
    velocity = np.array([[x], [y]])
    _, along = axes_of("contact", bearings(angle), velocity)
    assert float((velocity * along).sum()) >= 0.0


@given(st.tuples(*[SPEEDS] * 3), st.tuples(*[SPEEDS] * 3))
def test_slip_in_space(normal: tuple[float, ...], velocity: tuple[float, ...]) -> None:
    n, v = np.array(normal), np.array(velocity)
    if np.linalg.norm(n) < 0.1:
        return
    n = (n / np.linalg.norm(n))[:, None]
    _, along = axes_of("contact", Bearings(n, n, np.zeros((3, 1))), v[:, None])
    left = v[:, None] - (v[:, None] * n).sum() * n
    assert np.allclose((left * along).sum() * along, left, atol=1e-9)


def test_where_nothing_slips_there_is_no_direction_in_space() -> None:
    n = np.array([[0.0], [1.0], [0.0]])
    _, along = axes_of("contact", Bearings(n, n, np.zeros((3, 1))), -n)
    assert along[:, 0].tolist() == [0.0, 0.0, 0.0]


def test_own_axes_turn_with_the_body() -> None:
    first, second = axes_of("own", bearings(0.0, turn=math.pi / 2), np.zeros((2, 1)))
    assert np.allclose(first[:, 0], [0.0, 1.0])
    assert np.allclose(second[:, 0], [-1.0, 0.0])


def test_own_axes_in_space() -> None:
    n = np.array([[0.0], [1.0], [0.0]])
    turned = Bearings(n, n, np.array([[0.0], [0.0], [math.pi / 2]]))
    axes = np.stack(axes_of("own", turned, np.zeros((3, 1))))[..., 0]
    assert np.allclose(axes, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
