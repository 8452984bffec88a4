"""Contacts acting together: hand-worked corners, order, company."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.laws import composition
from relgym.laws.composition import Engaged, compose
from relgym.laws.frames import Bearings
from relgym.laws.joints import Joints
from relgym.laws.records import ZERO, AxisLaw, PairLaw, Piece
from relgym.laws.touching import Group

FREE_N, BOUNCE = Piece((("u_n", 1.0),)), Piece((("v_n", -0.9),))
FREE_T, FRICTION = Piece((("u_t", 1.0),)), Piece((("u_t", 1.0), ("J_n", -0.2)))
KIND = ("ball", "wall")
NORMAL = AxisLaw((FREE_N, BOUNCE), "max", (KIND,))
SMOOTH = PairLaw("contact", ((NORMAL,), (AxisLaw((FREE_T,), "max", (KIND,)),)), 0.0)
ROUGH = PairLaw("contact", ((NORMAL,), (AxisLaw((FRICTION, ZERO), "max", (KIND,)),)), 0.0)
G = np.array([0.0, -0.01])


def joints(share: np.ndarray) -> Joints:
    """Bodies that don't spin."""
    return Joints(share, None, np.zeros((2, *share.shape)))


def step(
    law: PairLaw, v: list[float], angles: list[float], *, shares: list[float] | None = None
) -> list[float]:
    """Next velocity of body 0 that touches resting bodies 1, 2, … along these normals."""
    count = len(angles)
    now = np.zeros((2, 1, count + 1))
    now[:, 0, 0] = v
    free = now.copy()
    free[:, 0, 0] += G
    normals = np.array([[math.cos(a) for a in angles], [math.sin(a) for a in angles]])[:, None]
    chosen = np.zeros((2, count), dtype=np.intp)
    engaged = Engaged(law, chosen, np.zeros(count, dtype=np.intp), np.arange(1, count + 1))
    bearings = Bearings(normals, normals, np.zeros((3, 1, count)))
    group = Group(np.array([0]), np.arange(count)[None], bearings)
    velocity = compose(engaged, group, joints(np.array([shares or [1.0] * count])), now, free).velocity
    return [float(c) for c in velocity[:, 0, 0]]


UP, RIGHT = math.pi / 2, 0.0


def test_a_bounce() -> None:
    assert step(SMOOTH, [0.3, -0.5], [UP]) == pytest.approx([0.3, 0.45])


def test_a_body_that_leaves_is_let_go() -> None:
    assert step(SMOOTH, [0.3, 0.5], [UP]) == pytest.approx([0.3, 0.49])


def test_a_slide_with_friction_and_its_halt() -> None:
    # Resting on the floor, J = 0.01: friction takes 0.002 of what slips.
    assert step(ROUGH, [0.3, 0.0], [UP]) == pytest.approx([0.298, 0.0])
    assert step(ROUGH, [0.001, 0.0], [UP]) == pytest.approx([0.0, 0.0])


def test_a_corner_reflects_both_ways() -> None:
    assert step(SMOOTH, [-0.3, -0.5], [UP, RIGHT]) == pytest.approx([0.27, 0.45])


def test_friction_of_a_corner_by_hand() -> None:
    # Sliding left along the floor into a wall. Floor and wall push by J1 and J2; each one's friction acts along the
    # other's normal: J1 = 0.01 + 0.2 J2 as long as the wall's friction pulls up, J2 = 0.57 - 0.002 ...
    x, y = step(ROUGH, [-0.3, 0.0], [UP, RIGHT])
    assert x == pytest.approx(0.27)
    assert y == pytest.approx(0.0, abs=1e-12)


def test_a_wedge_settles_on_both_conditions() -> None:
    angles = [UP, math.radians(30.0)]
    v = np.array([-0.4, -0.1])
    after = np.array(step(SMOOTH, v.tolist(), angles))
    for angle in angles:
        n = np.array([math.cos(angle), math.sin(angle)])
        assert after @ n >= -0.9 * (v @ n) - 1e-12  # neither surface is entered


@given(
    st.lists(st.floats(0.2, 3.0), min_size=2, max_size=3, unique=True),
    st.floats(-0.5, 0.5),
    st.floats(-0.5, 0.5),
)
def test_order_does_not_matter_without_friction(angles: list[float], x: float, y: float) -> None:
    if min(abs(a - b) for i, a in enumerate(angles) for b in angles[:i]) < 0.5:
        return  # sweeps between nearly parallel surfaces settle slowly
    forward, backward = step(SMOOTH, [x, y], angles), step(SMOOTH, [x, y], angles[::-1])
    # Where three surfaces meet, several impulses give the same velocity; two are unique anyway.
    assert forward == pytest.approx(backward, abs=1e-9)


def test_both_bodies_take_their_shares() -> None:
    assert step(SMOOTH, [0.0, -0.5], [UP], shares=[0.25])[1] == pytest.approx(-0.51 + 0.25 * (0.45 + 0.51))


def test_company_changes_no_bit(rng: np.random.Generator) -> None:
    m = 40
    now = np.zeros((2, m, 3))
    now[:, :, 0] = rng.normal(size=(2, m))
    free = now + G[:, None, None]
    angles = np.stack([np.full(m, UP), rng.uniform(0.1, 1.2, m)], axis=1)
    normals = np.stack([np.cos(angles), np.sin(angles)])
    engaged = Engaged(ROUGH, np.zeros((2, 2), dtype=np.intp), np.zeros(2, dtype=np.intp), np.array([1, 2]))

    def run(rows: slice) -> np.ndarray:
        there = Bearings(normals[:, rows], normals[:, rows], np.zeros((3, *angles[rows].shape)))
        size = len(angles[rows])
        group = Group(np.arange(size), np.tile([0, 1], (size, 1)), there)
        return compose(engaged, group, joints(np.ones((size, 2))), now[:, rows], free[:, rows]).velocity

    whole = run(slice(None))
    for k in range(m):
        assert run(slice(k, k + 1)).tobytes() == np.ascontiguousarray(whole[:, k : k + 1]).tobytes()


def test_leaps_lead_where_sweeps_would(monkeypatch: pytest.MonkeyPatch) -> None:
    # A ball jammed between two rough surfaces: each sweep stops it at one and sets it moving at the other.
    angles, v = [math.radians(167.0), math.radians(65.0)], [4.3e-6, -1.65e-5]
    found = step(ROUGH, v, angles)
    monkeypatch.setattr(composition._Settling, "leap", lambda *_: None)
    assert np.abs(np.array(step(ROUGH, v, angles)) - found).max() > 1e-9  # not there yet
    monkeypatch.setattr(composition, "SWEEPS", 150)  # 22,500 sweeps
    assert step(ROUGH, v, angles) == pytest.approx(found, abs=1e-12)


def test_what_does_not_settle_is_told() -> None:
    # Surfaces that turn every velocity round: at 60 degrees to each other they undo each other's work for ever.
    mirror = AxisLaw((Piece((("u_n", -1.0),)),), "max", (KIND,))
    mirrors = PairLaw("contact", ((mirror,), SMOOTH.axes[1]), 0.0)
    now = np.zeros((2, 2, 3))
    now[:, :, 0] = [[-0.3], [-0.5]]
    angles = np.array([[UP, UP - math.pi / 3], [UP, UP - math.pi / 2]])
    normals = np.stack([np.cos(angles), np.sin(angles)])
    bearings = Bearings(normals, normals, np.zeros((3, 2, 2)))
    engaged = Engaged(mirrors, np.zeros((2, 2), dtype=np.intp), np.zeros(2, dtype=np.intp), np.array([1, 2]))
    group = Group(np.arange(2), np.tile([0, 1], (2, 1)), bearings)
    found = compose(engaged, group, joints(np.ones((2, 2))), now, now)
    assert found.settled.tolist() == [False, True]  # at right angles they leave each other alone
