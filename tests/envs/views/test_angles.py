"""Pairs of numbers that are cosine and sine of an angle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.envs.views.angles import SLACK, candidates, circular, decoded, disjoint, on_circle, tolerance

INF = math.inf


@pytest.mark.parametrize(
    ("low", "high", "pairs"),
    [
        ([-1, -1, -8], [1, 1, 8], ((0, 1),)),  # Pendulum
        ([-1, -1, -1], [1, 1, 1], ((0, 1), (1, 2))),
        ([-INF, -INF], [INF, INF], ((0, 1),)),
        ([-1, -INF], [1, INF], ()),
        ([-1, -1], [1, 0.9], ()),
        ([0, -1, -1], [1, 1, 1], ((1, 2),)),
        ([-1], [1], ()),
    ],
)
def test_pairs_that_bounds_allow(
    low: list[float], high: list[float], pairs: tuple[tuple[int, int], ...]
) -> None:
    assert candidates(np.array(low, dtype=float), np.array(high, dtype=float)) == pairs


def test_the_circle_by_hand() -> None:
    values = np.array([[0.6, 0.8, 0.6], [1.0, 0.0, 1.0]])
    assert circular(values, (0, 1), bounded=True, single=False)
    assert not circular(values, (0, 2), bounded=True, single=False)  # 0.72
    off = values + [[0.0, 1e-7, 0.0]] * 2
    assert circular(off, (0, 1), bounded=True, single=True)
    assert not circular(off, (0, 1), bounded=True, single=False)


def test_points_on_the_axes_prove_nothing_of_unbounded_numbers() -> None:
    axes = np.array([[1.0, 0.0], [0.0, -1.0]])
    assert circular(axes, (0, 1), bounded=True, single=False)
    assert not circular(axes, (0, 1), bounded=False, single=False)
    assert circular(np.vstack([axes, [0.6, -0.8]]), (0, 1), bounded=False, single=False)


def test_a_known_pair_may_be_ten_times_as_far_off() -> None:
    for single in (False, True):
        limit = SLACK * tolerance(single)
        assert on_circle(math.sqrt(1.0 + 0.9 * limit), 0.0, single=single)
        assert not on_circle(math.sqrt(1.0 + 1.1 * limit), 0.0, single=single)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=8))
def test_pairs_that_share_nothing_first_come_first_served(pairs: list[tuple[int, int]]) -> None:
    kept = disjoint(pairs)
    for k, pair in enumerate(pairs):
        before = {n for other in pairs[:k] if other in kept for n in other}
        assert (pair in kept) or before & set(pair)
    assert len({n for pair in set(kept) for n in pair}) == sum(len(set(pair)) for pair in set(kept))


@given(st.floats(-math.pi, math.pi))
def test_angles_are_read_back(angle: float) -> None:
    assert decoded(math.cos(angle), math.sin(angle), single=False) == pytest.approx(angle, abs=1e-15)
    rounded = decoded(float(np.float32(math.cos(angle))), float(np.float32(math.sin(angle))), single=True)
    assert rounded == float(np.float32(rounded))
    assert math.remainder(rounded - angle, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
