"""Worlds of other packages: those that are installed are made, and numbers are what they show."""

from __future__ import annotations

import importlib.util
import warnings

import gymnasium as gym
import pytest

from relgym.experiments.strangers.elsewhere import ELSEWHERE, WORLDS


@pytest.mark.parametrize(("env_id", "name"), list(zip(ELSEWHERE, WORLDS, strict=True)))
def test_they_show_numbers(env_id: str, name: str) -> None:
    package = WORLDS[name][0].split(":")[0]
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} isn't installed (extra bench-elsewhere)")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # other packages warn, of their rewards and of their types
        env = gym.make(env_id)
        observation, _ = env.reset(seed=1)
    assert isinstance(env.observation_space, gym.spaces.Box)
    assert observation.ndim <= 1
    env.close()


def test_each_has_an_id() -> None:
    assert all(env_id in gym.registry for env_id in ELSEWHERE)
    assert len(set(ELSEWHERE)) == len(WORLDS)
