from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.numeric.version_space import VersionSpace


def boxes(held: list[list[float]], others: list[list[float]], seed: int = 0) -> VersionSpace:
    return VersionSpace(np.array(held), np.array(others), rng=np.random.default_rng(seed))


def test_a_threshold_between_two_examples_lies_anywhere() -> None:
    found = boxes([[0.0], [1.0]], [[3.0]])
    assert found.found
    inside, near, middle, far = found.share(np.array([[0.5], [1.2], [2.0], [3.0]]))
    assert inside == 1.0 and far == 0.0
    assert near > middle > 0.0
    assert middle == pytest.approx(0.5, abs=0.2)


def test_rules_are_of_the_smallest_sets_of_columns() -> None:
    # The first column tells them apart alone; the other two do so only together.
    found = boxes([[0.0, 1.0, 1.0]], [[2.0, 1.0, 0.0], [2.0, 0.0, 1.0]])
    elsewhere = np.array([[0.0, 9.0, 9.0], [2.0, 1.0, 1.0]])
    share = found.share(elsewhere)
    assert 0.0 < share[0] < 1.0 and 0.0 < share[1] < 1.0
    assert share[0] > share[1]  # shorter rules are likelier
    alone = boxes([[0.0, 1.0, 1.0]], [[2.0, 1.0, 1.0]])
    assert alone.share(np.array([[0.0, 7.0, -7.0]])).tolist() == [1.0]


def test_two_conditions_at_once() -> None:
    # Stopped (first column 0), and near to the goal (second).
    found = boxes([[0.0, 0.2], [0.0, -0.3]], [[0.0, 5.0], [0.0, -5.0], [3.0, 0.0], [1.0, 0.1]])
    share = found.share(np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 5.0], [0.0, 1.0], [0.0, 4.0]]))
    assert share[:3].tolist() == [1.0, 0.0, 0.0]
    assert 1.0 > share[3] > share[4] > 0.0


def test_what_no_box_tells_apart_has_no_rules() -> None:
    assert not boxes([[0.0], [2.0]], [[1.0]]).found


@given(
    st.lists(st.lists(st.integers(-3, 3), min_size=3, max_size=3), min_size=1, max_size=4),
    st.lists(st.lists(st.integers(-3, 3), min_size=3, max_size=3), min_size=1, max_size=12),
    st.integers(0, 9),
)
def test_all_rules_fit_all_examples(held: list[list[float]], others: list[list[float]], seed: int) -> None:
    found = boxes(held, others, seed)
    if found.found:
        assert found.share(np.array(held, dtype=float)).tolist() == [1.0] * len(held)
        assert found.share(np.array(others, dtype=float)).tolist() == [0.0] * len(others)
    else:
        low, high = np.min(held, axis=0), np.max(held, axis=0)
        assert any(((np.array(one) >= low) & (np.array(one) <= high)).all() for one in others)


def test_same_seed_same_rules() -> None:
    points = np.random.default_rng(5).normal(size=(50, 2))
    first, second = (boxes([[0.0, 0.0]], [[1.0, 1.0], [-1.0, 0.5]]).share(points) for _ in range(2))
    assert first.tolist() == second.tolist()
