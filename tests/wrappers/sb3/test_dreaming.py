"""Training inside the dream: the vector env by hand, on-policy algorithms in it, and check-ups in the world."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from dyna_worlds import Flat, LineEnv, LineModel, LineTask

from relgym.errors import ConfigError, QueryError
from relgym.model.world_model import WorldModel
from relgym.wrappers.dyna.config import DynaConfig
from relgym.wrappers.dyna.recorder import TransitionRecorder
from relgym.wrappers.dyna.trainer import ModelTrainer

pytestmark = pytest.mark.sb3

QUICK = DynaConfig(horizon=3, least=5, window=10, shuffle=5, from_start=1.0, permute=False, resample=False)


def world() -> gym.Env[Any, Any]:
    return Flat(TransitionRecorder(gym.wrappers.TimeLimit(LineEnv(), 8)))


def trainer(**model: float) -> ModelTrainer:
    from relgym.wrappers.sb3.dreaming import explore

    found = ModelTrainer(LineModel(**model), LineTask(), QUICK)
    explore(found, world(), 40, seed=0)
    return found


def dreams(num_envs: int = 4, **model: float) -> Any:
    from relgym.wrappers.sb3.dreaming import DreamVecEnv

    return DreamVecEnv(trainer(**model), world(), num_envs=num_envs, config=QUICK)


def test_dreams_go_on_and_begin_anew() -> None:
    env = dreams()
    place = 2.0 * env.reset()[:, 0]
    push = np.full((4, 1), 0.25, dtype=np.float32)
    for k in range(2):
        seen, rewards, dones, infos = env.step(push)
        place = place + 0.5
        np.testing.assert_allclose(2.0 * seen[:, 0], place, atol=1e-5)
        np.testing.assert_allclose(rewards, -np.abs(place), atol=1e-5)
        assert not dones.any(), k
    seen, _, dones, infos = env.step(push)
    assert dones.all()
    assert all(info["TimeLimit.truncated"] for info in infos)
    last = np.array([info["terminal_observation"][0] for info in infos])
    np.testing.assert_allclose(2.0 * last, place + 0.5, atol=1e-5)
    assert (np.abs(2.0 * seen[:, 0]) <= 2.0).all()  # where real episodes begin


def test_a_dream_that_ends_is_no_time_limit() -> None:
    env = dreams(off=200.0)  # so far that every step ends it, or leaves the observation space
    env.reset()
    _, rewards, dones, infos = env.step(np.zeros((4, 1), dtype=np.float32))
    assert dones.all()
    assert all(info["TimeLimit.truncated"] for info in infos)  # outside what can be seen: not known
    assert not rewards.any()
    env = dreams(off=6.0)
    env.reset()
    place = 2.0 * env.reset()[:, 0]
    _, rewards, dones, infos = env.step(np.zeros((4, 1), dtype=np.float32))
    np.testing.assert_array_equal(dones, place + 6.0 > 5.0)
    assert not any(info.get("TimeLimit.truncated", False) for info in infos)
    np.testing.assert_allclose(rewards, -(place + 6.0), atol=1e-5)


def test_ppo_trains_in_the_dream_and_is_checked_in_the_world() -> None:
    import torch
    from stable_baselines3 import PPO

    from relgym.wrappers.sb3.dreaming import DreamCheckup, DreamVecEnv

    torch.set_num_threads(1)
    model = trainer()
    seen = len(model.stock)
    env = DreamVecEnv(model, world(), num_envs=4, config=QUICK)
    check = DreamCheckup(model, world(), every=60, episodes=2)
    agent = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    agent.learn(256, callback=check)
    assert agent.num_timesteps == 256
    assert [at for at, *_ in check.history] == [4, 64, 124, 184, 244]
    assert check.history[-1][1] == len(model.stock) - seen
    assert model.acceptance.accepted


def test_training_stops_when_the_model_is_accepted_no_more() -> None:
    from stable_baselines3 import PPO

    from relgym.wrappers.sb3.dreaming import DreamCheckup, DreamVecEnv

    model = trainer()
    assert model.acceptance.accepted
    check = DreamCheckup(model, world(), every=32, episodes=3)
    env = DreamVecEnv(model, world(), num_envs=4, config=QUICK)
    model.model.off = 2.0  # type: ignore[attr-defined]  # the world is another now
    agent = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    with pytest.warns(
        UserWarning, match=r"training stops after \d+ imagined steps: .* from 0.2 on it is rejected"
    ):
        agent.learn(1_000, callback=check)
    assert agent.num_timesteps < 100
    assert not model.acceptance.accepted
    with pytest.raises(
        ConfigError, match=r"the model isn't accepted: .*let it learn from more of them \(explore\)"
    ):
        agent.learn(1_000, callback=check)


def test_check_ups_see_what_the_agent_was_trained_on() -> None:
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecNormalize

    from relgym.wrappers.sb3.dreaming import DreamCheckup, DreamVecEnv

    model = trainer()
    dreamed = VecNormalize(DreamVecEnv(model, world(), num_envs=4, config=QUICK))
    agent = PPO("MlpPolicy", dreamed, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    shown: list[Any] = []
    predict = agent.predict
    agent.predict = lambda seen, **more: (shown.append(seen), predict(seen, **more))[1]  # type: ignore[method-assign]
    real = world()
    agent.learn(64, callback=DreamCheckup(model, real, every=1_000, episodes=1, seed=5))
    first, _ = world().reset(seed=5)
    assert not np.allclose(shown[0], first)
    np.testing.assert_allclose(dreamed.unnormalize_obs(shown[0]), first, atol=2.0)


def test_check_ups_are_made_again_in_a_second_training() -> None:
    from stable_baselines3 import PPO

    from relgym.wrappers.sb3.dreaming import DreamCheckup, DreamVecEnv

    model = trainer()
    check = DreamCheckup(model, world(), every=100, episodes=1)
    env = DreamVecEnv(model, world(), num_envs=4, config=QUICK)
    agent = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    counts = []
    for again in (True, False, True):  # 64 steps each
        agent.learn(64, callback=check, reset_num_timesteps=again)
        counts.append(len(check.history))
    assert counts == [1, 2, 3]  # after 4 and 104 steps; and after 4 when counted from 0 again


def test_dreams_are_of_the_model_at_work() -> None:
    class Taught(LineModel):
        """Replacements of its own know the world as it is."""

        def untaught(self) -> LineModel:
            return LineModel()

    from relgym.wrappers.sb3.dreaming import DreamVecEnv, explore

    found = ModelTrainer(Taught(), LineTask(), QUICK)
    explore(found, world(), 40, seed=0)
    env = DreamVecEnv(found, world(), num_envs=4, config=QUICK)
    found.model.off = 3.0  # type: ignore[attr-defined]  # as if the world had changed
    explore(found, world(), 40, seed=1)
    assert found.renewals == 1 and not isinstance(found.model, Taught)
    place = 2.0 * env.reset()[:, 0]
    seen, *_ = env.step(np.full((4, 1), 0.25, dtype=np.float32))
    np.testing.assert_allclose(2.0 * seen[:, 0], place + 0.5, atol=1e-5)


def test_what_was_explored_has_all_been_learned() -> None:
    found = trainer()
    assert len(found.model.learned) == 40  # type: ignore[attr-defined]


def test_a_task_can_be_learned_while_exploring() -> None:
    from relgym.wrappers.dyna.reward_models import LearnedRewardModel
    from relgym.wrappers.sb3.dreaming import explore

    found = ModelTrainer(LineModel(), "learned", QUICK)
    assert isinstance(found.reward_model, LearnedRewardModel)
    explore(found, world(), 40, seed=0)
    assert found.reward_model.model.seen == 40


def test_refusals_name_the_remedy() -> None:
    from relgym.wrappers.sb3.dreaming import DreamCheckup, DreamVecEnv, explore

    with pytest.raises(ConfigError, match="no scenes to begin roll-outs in"):
        DreamVecEnv(ModelTrainer(LineModel(), LineTask(), QUICK), world())
    with pytest.raises(ConfigError, match="num_envs=0: expected at least 1"):
        DreamVecEnv(trainer(), world(), num_envs=0)
    with pytest.raises(ConfigError, match="steps=0: expected at least 1"):
        explore(trainer(), world(), 0, seed=0)
    with pytest.raises(ConfigError, match="every=0: expected at least 1"):
        DreamCheckup(trainer(), world(), every=0)
    with pytest.raises(ConfigError, match="has no TransitionRecorder: put one directly round the bare env"):
        explore(trainer(), Flat(LineEnv()), 5, seed=0)
    with pytest.raises(ConfigError, match="has no TransitionRecorder: put one directly round the bare env"):
        DreamCheckup(trainer(), Flat(LineEnv()))
    blank = ModelTrainer(WorldModel(LineEnv().schema), LineTask(), QUICK)
    blank.stock.add(
        LineEnv().schema.scene({"cart": [0.0, 1.0], "other": [1.0, 2.0], "mark": [0.5]}), first=True
    )
    with pytest.raises(QueryError, match="the model knows none of its targets"):
        DreamVecEnv(blank, world())
