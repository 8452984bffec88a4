"""From any env to a dream of it, through one file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from carts import run
from gymnasium.utils.env_checker import check_env
from plain_envs import Slider

from relgym.wrappers import ModelLearner


def test_a_pendulum_swings_in_a_dream_as_in_truth(tmp_path: Path) -> None:
    env = ModelLearner(gym.make("Pendulum-v1"), config={"features": ("trig",)})
    run(env, 300, length=50)
    env.save(tmp_path / "pendulum.json")
    dream = gym.make("relgym/LearnedModel-v0", model=tmp_path / "pendulum.json")
    assert (dream.observation_space, dream.action_space) == (env.observation_space, env.action_space)
    truth: Any = gym.make("Pendulum-v1")
    truth.reset(seed=1)
    compared = 0
    for seed in range(3):
        seen, _ = dream.reset(seed=seed)
        truth.unwrapped.state = np.array([np.arctan2(seen[1], seen[0]), seen[2]])
        dream.action_space.seed(seed)
        for _ in range(12):
            action = dream.action_space.sample()
            imagined, *_, truncated, _ = dream.step(action)
            came, *_ = truth.step(action)
            if truncated:  # beyond its top speed, which so few steps don't teach
                break
            np.testing.assert_allclose(imagined, came, rtol=0, atol=1e-4)
            compared += 1
    assert compared >= 20


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version.*")
def test_a_dream_of_numbers_and_their_reward_is_a_sound_env(tmp_path: Path) -> None:
    env = ModelLearner(Slider(), learn_reward=True)
    run(env, 60)
    env.save(tmp_path / "slider.json")
    dream = gym.make("relgym/LearnedModel-v0", model=tmp_path / "slider.json")
    check_env(dream.unwrapped, skip_render_check=True)
    dream.reset(seed=0)
    seen, reward, terminated, truncated, _ = dream.step(np.array([0.5]))
    assert not (terminated or truncated)
    assert reward == pytest.approx(-seen[0], abs=1e-9)
