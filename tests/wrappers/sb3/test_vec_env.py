"""Stable-Baselines3 trains in Gymnasium's vector envs, and sees episodes end as in its own."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from dreams import CART_SCHEMA, Errand, cart_model, room_model

from relgym.envs import LearnedModelEnv, LearnedModelVectorEnv
from relgym.errors import ConfigError
from relgym.scene.objects import Scene

pytestmark = pytest.mark.sb3


def start(rng: np.random.Generator) -> Scene:
    return CART_SCHEMA.scene({"cart": [-3.0, 0.0]})


def starts(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.repeat([[-3.0, 0.0, 0.0, 0.0]], count, axis=0)


def dreams(count: int = 3, **arguments: Any) -> Any:
    from relgym.wrappers.sb3 import VectorAsVecEnv

    defaults: dict[str, Any] = {"task": Errand(), "start": starts, "horizon": 4, "autoreset_mode": "SameStep"}
    return VectorAsVecEnv(LearnedModelVectorEnv(cart_model(), count, **{**defaults, **arguments}))


def test_it_steps_as_sb3s_own_vec_env_does() -> None:
    from stable_baselines3.common.vec_env import DummyVecEnv

    def single() -> LearnedModelEnv:
        return LearnedModelEnv(cart_model(), task=Errand(), start=start, horizon=4)

    own, ours = DummyVecEnv([single] * 3), dreams()
    assert own.observation_space == ours.observation_space and own.action_space == ours.action_space
    expected, seen = own.reset(), ours.reset()
    rng, ends = np.random.default_rng(0), {"cut": 0, "reached": 0}
    for _ in range(13):
        np.testing.assert_array_equal(seen["cart"], expected["cart"])
        actions = rng.uniform(-1.0, 0.5, (3, 1)).astype(np.float32)
        expected, *flags, told = own.step(actions)
        seen, *found, infos = ours.step(actions)
        for a, b in zip(flags, found, strict=True):
            np.testing.assert_array_equal(a, b)
            assert a.dtype == b.dtype
        for theirs, mine in zip(told, infos, strict=True):
            assert mine["is_success"] is theirs["is_success"]
            if "terminal_observation" in theirs:
                np.testing.assert_array_equal(
                    mine["terminal_observation"]["cart"], theirs["terminal_observation"]["cart"]
                )
                assert mine["TimeLimit.truncated"] is theirs["TimeLimit.truncated"]
                assert mine.get("reason") == theirs.get("reason")
                ends["cut" if mine["TimeLimit.truncated"] else "reached"] += 1
            else:
                assert "terminal_observation" not in mine
    assert ends["cut"] and ends["reached"]


def test_an_agent_trains_in_it() -> None:
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    envs = VecNormalize(VecMonitor(dreams(8), info_keywords=()))
    agent = PPO("MultiInputPolicy", envs, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    agent.learn(256)
    assert agent.num_timesteps == 256
    assert len(agent.ep_info_buffer) > 10
    assert all(episode["l"] <= 4 for episode in agent.ep_info_buffer)


def test_an_off_policy_agent_bootstraps_from_the_last_observation() -> None:
    from stable_baselines3 import SAC

    envs = dreams(4)
    agent = SAC("MultiInputPolicy", envs, learning_starts=8, batch_size=8, seed=0, device="cpu")
    agent.learn(40)
    buffer = agent.replay_buffer
    over = buffer.dones[: buffer.pos].astype(bool)
    assert over.any()
    # What follows an end is its own last observation, at most two steps from the start: never the next start.
    assert (buffer.next_observations["cart"][: buffer.pos][over][:, 1] != 0.0).all()
    assert (buffer.timeouts[: buffer.pos] <= over).all()


def test_seeds_and_options_hold_for_the_next_reset() -> None:
    envs = dreams(20, start=None, task=None, reward="learned")
    envs.seed(3)
    first = envs.reset()["cart"].copy()
    envs.seed(3)
    np.testing.assert_array_equal(envs.reset()["cart"], first)
    assert (envs.reset()["cart"] != first).any()
    envs.set_options({"scene": CART_SCHEMA.scene({"cart": [7.0, 0.0]})})
    assert (envs.reset()["cart"] == [7.0, 0.0]).all()
    assert (envs.reset()["cart"] != [7.0, 0.0]).any()


def test_what_sb3_asks_of_single_envs_is_answered() -> None:
    from relgym.wrappers.sb3 import VectorAsVecEnv

    wrapped = gym.wrappers.vector.ClipReward(
        LearnedModelVectorEnv(cart_model(), 3, autoreset_mode="SameStep"), 0.0, 1.0
    )
    envs = VectorAsVecEnv(wrapped)
    assert envs.get_attr("num_envs", [0, 2]) == [3, 3]
    assert envs.get_attr("model")[0] is cart_model()
    assert envs.env_is_wrapped(gym.wrappers.vector.ClipReward) == [True] * 3
    assert envs.env_is_wrapped(gym.wrappers.vector.RecordEpisodeStatistics, 1) == [False]
    envs.reset()
    assert len(envs.env_method("reset", seed=1, indices=[0, 1])) == 2
    envs.set_attr("mark", 5)
    assert envs.get_attr("mark") == [5, 5, 5]
    with pytest.raises(ConfigError, match="they are one object"):
        envs.set_attr("mark", 6, indices=[0])
    envs.close()


def test_pictures_are_tiled() -> None:
    from relgym.wrappers.sb3 import VectorAsVecEnv

    envs = VectorAsVecEnv(
        LearnedModelVectorEnv(room_model(), 2, render_mode="rgb_array", autoreset_mode="SameStep")
    )
    envs.reset()
    picture = envs.render("rgb_array")
    assert picture.dtype == np.uint8 and picture.ndim == 3
    envs.close()


def test_bad_input_names_the_remedy() -> None:
    from relgym.wrappers.sb3 import VectorAsVecEnv

    with pytest.raises(ConfigError, match=r"gym\.make_vec makes one"):
        VectorAsVecEnv(LearnedModelEnv(cart_model()))  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"autoreset_mode=AutoresetMode\.SAME_STEP"):
        VectorAsVecEnv(LearnedModelVectorEnv(cart_model(), 2))
