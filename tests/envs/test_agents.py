"""Envs of several agents: as one env, looked at, learned from, and dreamt of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from runners import Runners

import relgym
from relgym.data import Dataset
from relgym.envs import AgentsEnv, AgentsSpace
from relgym.envs.spaces_json import space_from_json, space_to_json
from relgym.errors import ActionError, ConfigError
from relgym.wrappers import ModelLearner


def still(env: AgentsEnv) -> dict[str, Any]:
    return {a: 0 if a == "door" else np.zeros(1) for a in env.agents_env.agents}


def lived(env: gym.Env[Any, Any], steps: int, **options: Any) -> ModelLearner:
    learner = ModelLearner(env, **options)
    learner.action_space.seed(0)
    learner.reset(seed=0)
    for _ in range(steps):
        *_, terminated, truncated, _ = learner.step(learner.action_space.sample())
        if terminated or truncated:
            learner.reset()
    return learner


def test_elements_may_lack_agents() -> None:
    space = AgentsEnv(Runners(2)).action_space
    assert space.contains({"door": 1}) and space.contains({})
    assert space.contains(space.sample())
    assert not space.contains({"door": 5})
    assert not space.contains({"cow": 1})
    assert not space.contains([1])
    again = space_from_json(json.loads(json.dumps(space_to_json(space))))
    assert isinstance(again, AgentsSpace) and again == space


def test_one_env_of_all_agents() -> None:
    env = AgentsEnv(Runners(2, length=3))
    observation, info = env.reset(seed=1)
    assert set(observation) == {"runner_0", "runner_1", "door"}
    assert env.observation_space.contains(observation)
    assert info == {"agents": {"runner_0": {}, "runner_1": {}, "door": {}}}
    for last in (False, False, True):
        _, reward, terminated, truncated, info = env.step(still(env))
        assert (reward, terminated, truncated) == (0.0, False, last)
    assert info["truncations"] == {"runner_0": True, "runner_1": True, "door": True}
    assert env.render() == "runners"
    env.close()
    assert env.agents_env.closed


def test_agents_leave_and_are_paid() -> None:
    env = AgentsEnv(Runners(2, goal=5.0))
    env.reset(seed=1)
    env.agents_env.state["runner_0"] = np.array([4.9, 1.0])
    seen, reward, terminated, truncated, info = env.step(still(env))
    assert (reward, terminated, truncated) == (1.0, False, False)
    assert set(seen) == {"runner_0", "runner_1", "door"}
    assert info["terminations"]["runner_0"]
    seen, *_ = env.step({**still(env), "runner_0": np.ones(1)})  # it isn't there any more
    assert set(seen) == {"runner_1", "door"}


def test_it_ends_when_nobody_is_left() -> None:
    env = AgentsEnv(Runners(1, goal=5.0))
    env.agents_env.possible_agents.remove("door")
    env.reset(seed=1)
    env.agents_env.state["runner_0"] = np.array([4.9, 1.0])
    _, reward, terminated, truncated, _ = env.step(still(env))
    assert (reward, terminated, truncated) == (1.0, True, False)


def test_everybody_there_has_to_act() -> None:
    env = AgentsEnv(Runners(2))
    env.reset(seed=1)
    with pytest.raises(ActionError, match=r"without \['runner_1', 'door'\]"):
        env.step({"runner_0": np.zeros(1)})
    with pytest.raises(ActionError, match="expected an action for each of"):
        env.step(3)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", [None, gym.make("CartPole-v1"), object()])
def test_what_is_no_env_of_agents(wrong: Any) -> None:
    with pytest.raises(ConfigError, match=r"PettingZoo ParallelEnv .*aec_to_parallel"):
        AgentsEnv(wrong)
    env = Runners(1)
    env.possible_agents = [0, 1]  # type: ignore[list-item]
    with pytest.raises(ConfigError, match="expected agents with names"):
        AgentsEnv(env)


def test_what_is_learned_of_one_holds_for_all() -> None:
    learner = lived(AgentsEnv(Runners(3)), 120)
    texts = [learner.model.modes("runner", prop)[0].formula() for prop in ("x0", "x1")]
    assert texts == ["x0' = x0 + x1'", "x1' = 0.5 x1 + a"]
    others = AgentsEnv(Runners(5))  # more than were ever seen
    fresh = Dataset.collect(others, 40, seed=9)
    score = relgym.score(learner.model, fresh, view=learner_view(others))
    assert (score.right, score.abstained) == (1.0, 0.0)


def learner_view(env: AgentsEnv) -> Any:
    return relgym.wrappers.AgentsView(env.observation_space, env.action_space)


def test_reward_and_a_file_to_dream_from(tmp_path: Path) -> None:
    learner = lived(AgentsEnv(Runners(2, goal=1e6, length=20)), 90, learn_reward=True)
    learner.save(tmp_path / "runners.relgym")
    dream = gym.make("relgym/LearnedModel-v0", model=str(tmp_path / "runners.relgym"))
    env = AgentsEnv(Runners(2, goal=1e6))
    assert dream.action_space == env.action_space
    observation, _ = dream.reset(seed=0)
    env.reset(seed=0)
    for agent, seen in observation.items():
        env.agents_env.state[agent] = np.array(seen)
    env.action_space.seed(3)
    for _ in range(10):
        action = env.action_space.sample()
        imagined, *_ = dream.step(action)
        real, *_ = env.step(action)
        assert imagined.keys() == real.keys()
        for agent in real:
            np.testing.assert_allclose(imagined[agent], real[agent], atol=1e-9)


def test_many_dreams_at_once_are_refused(tmp_path: Path) -> None:
    learner = lived(AgentsEnv(Runners(2)), 40)
    learner.save(tmp_path / "runners.relgym")
    with pytest.raises(ConfigError, match="one at a time"):
        dreams = gym.make_vec("relgym/LearnedModel-v0", num_envs=2, model=str(tmp_path / "runners.relgym"))
        dreams.reset(seed=0)
        dreams.step(dreams.action_space.sample())


def test_from_data_as_online(tmp_path: Path) -> None:
    online = lived(AgentsEnv(Runners(2, goal=6.0)), 70)
    model = relgym.fit(Dataset.collect(AgentsEnv(Runners(2, goal=6.0)), 70, seed=0))
    for what in (online, model):
        what.save(tmp_path / f"{type(what).__name__}.relgym", history=True)
    assert (tmp_path / "ModelLearner.relgym").read_bytes() == (tmp_path / "WorldModel.relgym").read_bytes()


def test_an_env_of_pettingzoo() -> None:
    """Rock, paper, scissors: what a player sees is what the other one did, whoever of them it is."""
    pettingzoo = pytest.importorskip("pettingzoo")
    learner = lived(AgentsEnv(pettingzoo.make("parallel", "classic/rps-v2", max_cycles=40)), 120)
    (mode,) = learner.model.modes("player", "x")
    assert mode.formula() == "x' = player_a.a"
    with pytest.raises(ConfigError, match="aec_to_parallel"):
        AgentsEnv(pettingzoo.make("aec", "classic/rps-v2"))


def test_pettingzoo_accepts_the_env_of_these_tests() -> None:
    api = pytest.importorskip("pettingzoo")

    class Checked(Runners, api.ParallelEnv):  # type: ignore[misc, name-defined]
        pass

    learner = lived(AgentsEnv(Checked(2)), 5)
    assert learner.model.seen == 5
    assert isinstance(learner.observation_space, spaces.Dict)
