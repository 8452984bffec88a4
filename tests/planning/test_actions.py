from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from relgym.errors import ConfigError
from relgym.planning import ActionCoder

SPACES: list[spaces.Space[Any]] = [
    spaces.Box(-1.0, 1.0, (2,), np.float32),
    spaces.Box(np.array([0.1, -3.0]), np.array([0.3, 7.0]), dtype=np.float64),
    spaces.Discrete(4, start=-1),
    spaces.MultiDiscrete([2, 3, 5]),
    spaces.MultiBinary(3),
]


@pytest.mark.parametrize("space", SPACES, ids=str)
@given(seed=st.integers(0, 2**32 - 1), scale=st.sampled_from([1e-3, 1.0, 1e6]))
def test_every_latent_vector_is_a_legal_action(space: spaces.Space[Any], seed: int, scale: float) -> None:
    coder = ActionCoder(space)
    latents = scale * np.random.default_rng(seed).standard_normal((3, 5, coder.size))
    actions = coder.actions(latents)
    assert actions.shape == (3, 5, *(space.shape or ()))
    for action in actions.reshape(15, *(space.shape or ())):
        assert space.contains(action), (space, action)


def test_zero_is_the_middle_of_a_box() -> None:
    coder = ActionCoder(spaces.Box(2.0, 6.0, (1,), np.float64))
    assert coder.actions(np.array([[0.0], [0.5], [9.0]])).tolist() == [[4.0], [5.0], [6.0]]


def test_the_largest_latent_number_chooses() -> None:
    coder = ActionCoder(spaces.Discrete(3, start=5))
    assert coder.actions(np.array([[0.0, 1.0, -1.0], [3.0, 1.0, 2.0]])).tolist() == [6, 5]


def test_random_latents_choose_each_action_as_often() -> None:
    latents = np.random.default_rng(0).standard_normal((30_000, 3))
    counts = np.bincount(ActionCoder(spaces.Discrete(3)).actions(latents))
    assert np.abs(counts - 10_000).max() < 500  # six standard deviations


@pytest.mark.parametrize("space", [spaces.Box(-np.inf, np.inf, (1,)), spaces.Text(3)], ids=str)
def test_spaces_that_nobody_can_search_are_refused(space: spaces.Space[Any]) -> None:
    with pytest.raises(ConfigError, match="expected"):
        ActionCoder(space)
