from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from relgym.errors import ConfigError

pytestmark = pytest.mark.sb3


class Dotted(gym.Env[Any, Any]):
    """Observations are a Dict with a dot in one key."""

    def __init__(self, key: str = "arm.x") -> None:
        self.observation_space = spaces.Dict({key: spaces.Box(-1, 1, (1,)), "y": spaces.Box(-1, 1, (1,))})
        self.action_space = spaces.Discrete(2)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        return {key: np.zeros(1, dtype=np.float32) for key in self.observation_space}, {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return self.reset()[0], 0.0, False, False, {}


def test_a_dot_in_a_key_is_refused_before_any_agent_is_made() -> None:
    from relgym.wrappers.sb3 import TransitionRecorder, VectorAsVecEnv

    remedy = r"'arm.x'.*rename them .*'arm_x'.*TransformObservation.*FlattenObservation"
    with pytest.raises(ConfigError, match=remedy):
        TransitionRecorder(Dotted())
    with pytest.raises(ConfigError, match=remedy):
        VectorAsVecEnv(SyncVectorEnv([Dotted], autoreset_mode=AutoresetMode.SAME_STEP))
    assert TransitionRecorder(Dotted("arm_x")).view.schema
    assert VectorAsVecEnv(SyncVectorEnv([lambda: Dotted("arm_x")], autoreset_mode=AutoresetMode.SAME_STEP))


def test_the_remedy_works() -> None:
    from stable_baselines3 import PPO

    from relgym.wrappers.sb3 import TransitionRecorder

    env = Dotted()
    names = {"arm_x": "arm.x", "y": "y"}
    space = spaces.Dict({new: env.observation_space[old] for new, old in names.items()})
    renamed = gym.wrappers.TransformObservation(
        env, lambda seen: {new: seen[old] for new, old in names.items()}, space
    )
    PPO("MultiInputPolicy", TransitionRecorder(renamed), n_steps=8, batch_size=8, device="cpu").learn(8)
    with pytest.raises(KeyError, match="contain"):  # what PyTorch says of the other
        PPO("MultiInputPolicy", env, device="cpu")
