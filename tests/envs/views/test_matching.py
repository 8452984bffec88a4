"""Rows of a table that come in another order: the assignment is the best there is."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from relgym.envs.views.matching import matched

POINTS = st.integers(-20, 20).map(lambda k: k / 10.0)


def cost(chosen: list[int], rows: np.ndarray, expected: np.ndarray, farthest: float) -> float:
    """Squared distances, and the limit's square for each row and each object that is left alone."""
    squares = [((rows[r] - expected[o]) ** 2).sum() for r, o in enumerate(chosen) if o >= 0]
    alone = min(chosen.count(-1), len(expected) - len(squares))
    return float(sum(squares) + alone * farthest**2)


def every_way(rows: int, objects: int) -> list[list[int]]:
    ways = itertools.product(range(-1, objects), repeat=rows)
    return [list(w) for w in ways if len([o for o in w if o >= 0]) == len({o for o in w if o >= 0})]


@given(
    rows=arrays(np.float64, st.tuples(st.integers(0, 4), st.just(2)), elements=POINTS),
    expected=arrays(np.float64, st.tuples(st.integers(0, 4), st.just(2)), elements=POINTS),
    farthest=st.sampled_from((0.5, 1.0, 3.0)),
)
def test_no_other_assignment_is_closer(rows: np.ndarray, expected: np.ndarray, farthest: float) -> None:
    chosen = matched(rows, expected, farthest).tolist()
    taken = [o for o in chosen if o >= 0]
    assert len(chosen) == len(rows) and len(set(taken)) == len(taken)
    for row, number in zip(rows, chosen, strict=True):
        assert number < 0 or math.dist(row, expected[number]) <= farthest
    if min(len(rows), len(expected)):
        least = min(
            cost(way, rows, expected, farthest)
            for way in every_way(len(rows), len(expected))
            if all(o < 0 or math.dist(rows[r], expected[o]) <= farthest for r, o in enumerate(way))
        )
        assert cost(chosen, rows, expected, farthest) == pytest.approx(least, abs=1e-9)


def test_rows_in_another_order_keep_their_objects() -> None:
    expected = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 5.0]])
    rows = expected[[2, 0, 1]] + 0.01
    assert matched(rows, expected, 1.0).tolist() == [2, 0, 1]


def test_what_is_far_from_all_is_news() -> None:
    expected = np.array([[0.0, 0.0]])
    assert matched(np.array([[3.0, 0.0], [0.5, 0.0]]), expected, 1.0).tolist() == [-1, 0]
    assert matched(np.array([[1.01, 0.0]]), expected, 1.0).tolist() == [-1]
