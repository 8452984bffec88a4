"""Data augmentation without a model: real transitions under other names."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from dyna_worlds import LineEnv

from relgym.errors import ConfigError
from relgym.wrappers.dyna.recorder import TransitionRecorder

pytestmark = pytest.mark.sb3


class Places(gym.ObservationWrapper[Any, Any, Any]):
    """Shows where both carts are."""

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self.observation_space = gym.spaces.Box(-100.0, 100.0, (2,), np.float32)

    def observation(self, observation: Any) -> Any:
        return np.array([observation["cart"][0], observation["other"][0]], dtype=np.float32)


def trained(**options: Any) -> Any:
    import torch
    from stable_baselines3 import SAC

    from relgym.wrappers.sb3.permuting import PermutedReplay
    from relgym.wrappers.sb3.replay import replay_options

    torch.set_num_threads(1)
    env = Places(TransitionRecorder(LineEnv()))
    agent = SAC(
        "MlpPolicy",
        env,
        learning_starts=100,
        buffer_size=500,
        device="cpu",
        seed=0,
        **replay_options(env.observation_space, **options),
    )
    return agent.learn(30, callback=PermutedReplay(copies=3, seed=0))


def test_a_second_training_keeps_what_was_renamed() -> None:
    from relgym.wrappers.sb3.permuting import PermutedReplay

    agent, replay = trained(), PermutedReplay(copies=3, seed=0)
    agent.learn(20, callback=replay)
    agent.learn(5, callback=replay)
    assert (agent.replay_buffer.size(), agent.replay_buffer.imagined.size()) == (55, 75)


def test_rewards_are_normalised_once_and_steps_made_before_are_left_out() -> None:
    import torch
    from stable_baselines3 import SAC
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    from relgym.wrappers.sb3.permuting import PermutedReplay
    from relgym.wrappers.sb3.replay import replay_options

    torch.set_num_threads(1)
    env = Places(TransitionRecorder(LineEnv()))
    env.reset(seed=0)
    env.step(env.action_space.sample())
    envs = VecNormalize(DummyVecEnv([lambda: env]), norm_obs=False)
    mixing = replay_options(env.observation_space)
    agent = SAC("MlpPolicy", envs, learning_starts=100, buffer_size=500, device="cpu", seed=0, **mixing)
    agent.learn(20, callback=PermutedReplay(copies=1, seed=0))
    buffer = agent.replay_buffer
    assert not buffer.accepted
    np.testing.assert_array_equal(buffer.imagined.rewards[:20, 0], buffer.rewards[:20, 0])
    np.testing.assert_array_equal(
        np.sort(buffer.imagined.observations[:20, 0]), np.sort(buffer.observations[:20, 0])
    )


def test_copies_tell_the_same_under_other_names() -> None:
    buffer = trained().replay_buffer
    copies = buffer.imagined
    assert (buffer.size(), copies.size()) == (30, 90)
    for k in range(30):
        seen, following = buffer.observations[k, 0], buffer.next_observations[k, 0]
        for at in range(3 * k, 3 * k + 3):
            order = [0, 1] if copies.observations[at, 0, 0] == seen[0] else [1, 0]
            np.testing.assert_array_equal(copies.observations[at, 0], seen[order])
            np.testing.assert_array_equal(copies.next_observations[at, 0], following[order])
            assert copies.actions[at, 0] == buffer.actions[k, 0]
            assert copies.rewards[at, 0] == buffer.rewards[k, 0]
            assert (copies.dones[at, 0], copies.timeouts[at, 0]) == (
                buffer.dones[k, 0],
                buffer.timeouts[k, 0],
            )
    exchanged = copies.observations[: copies.size(), 0, 0] != np.repeat(buffer.observations[:30, 0, 0], 3)
    assert 20 < int(exchanged.sum()) < 70
    assert buffer.real_ratio == 0.25


def test_no_n_step_returns() -> None:
    with pytest.raises(ConfigError, match="give no n-step returns: take n_steps=1"):
        trained(n_steps=3)
