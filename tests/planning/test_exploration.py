from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.errors import ConfigError
from relgym.planning import Coverage


def test_what_was_seen_is_nothing_new() -> None:
    coverage = Coverage([0, 2])
    coverage.add(np.array([4.0, 99.0, -1.0]))
    assert coverage.novelty(np.array([[4.0, -7.0, -1.0], [-4.0, 99.0, 1.0]])).tolist() == [0.0, 1.0]


def test_two_values_that_were_never_seen_together_are_new() -> None:
    coverage = Coverage([0, 1])
    for state in ([4.0, 0.0], [0.0, 4.0], [4.0, 4.0]):
        coverage.add(np.array(state))
    # Alone each 0 is known; both at once (stopped, and at the goal) are one of the three pairs.
    assert coverage.novelty(np.array([[0.0, 0.0]])) == pytest.approx([1 / 3])


@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3), st.integers(1, 20))
def test_every_state_is_known_after_it_was_seen(values: list[float], more: int) -> None:
    rng = np.random.default_rng(more)
    coverage = Coverage(range(3), capacity=50)
    coverage.add(np.array(values))
    for _ in range(more):
        coverage.add(rng.standard_normal(3))
    assert coverage.novelty(np.array([values]))[0] == 0.0


def test_memory_is_bounded() -> None:
    coverage = Coverage([0], capacity=5)
    for k in range(20):
        coverage.add(np.array([float(k)]))
    assert len(coverage) == 5


def test_the_bonus_is_the_next_states() -> None:
    coverage = Coverage([0])
    coverage.add(np.array([1.0]))
    before, after = np.array([[1.0], [1.0]]), np.array([[1.0], [-1.0]])
    assert coverage.bonus(3.0)(before, np.zeros((2, 1)), after).tolist() == [0.0, 3.0]


def test_without_columns_nothing_is_new() -> None:
    coverage = Coverage([])
    coverage.add(np.zeros(3))
    assert coverage.novelty(np.ones((2, 3))).tolist() == [0.0, 0.0]


def test_a_capacity_of_nothing_is_refused() -> None:
    with pytest.raises(ConfigError, match="capacity"):
        Coverage([0], capacity=0)
