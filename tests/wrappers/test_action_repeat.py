from __future__ import annotations

import copy
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import relgym  # noqa: F401  (registers the ids)
from relgym.errors import ConfigError
from relgym.wrappers.action_repeat import ActionRepeat
from relgym.wrappers.model_learner import ModelLearner

PUSH = np.array([0.3], dtype=np.float32)


def pushing(**arguments: Any) -> gym.Env[Any, Any]:
    return gym.make("relgym/TruckPush-v0", task="push", **arguments)


def test_rewards_add_up_and_the_last_observation_counts() -> None:
    single, env = pushing(), ActionRepeat(pushing(), 3)
    single.reset(seed=0)
    env.reset(seed=0)
    steps = [single.step(PUSH) for _ in range(3)]
    observation, reward, terminated, truncated, info = env.step(PUSH)
    assert reward == sum(float(step[1]) for step in steps)
    assert (terminated, truncated, info["steps"]) == (False, False, 3)
    for name, values in steps[-1][0].items():
        np.testing.assert_array_equal(observation[name], values)


def test_an_episodes_end_cuts_a_decision_short() -> None:
    env = ActionRepeat(pushing(), 5)
    env.reset(seed=0, options={"goal_distance": 1.0})
    *_, terminated, truncated, info = env.step(np.array([1.0], dtype=np.float32))
    assert terminated and not truncated
    assert info["steps"] == 1 and info["is_success"] is False
    env = ActionRepeat(pushing(), 15)  # of 20 steps
    env.reset(seed=0)
    stay = np.array([-1.0], dtype=np.float32)
    assert env.step(stay)[4]["steps"] == 15
    *_, truncated, info = env.step(stay)
    assert truncated and info["steps"] == 5


def test_a_learner_inside_sees_every_step() -> None:
    learner = ModelLearner(pushing(), targets=["truck.vx"])
    env = ActionRepeat(learner, 4)
    env.reset(seed=0)
    env.step(PUSH)
    assert learner.model.seen == 4


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_checker_copies_and_specs() -> None:
    check_env(ActionRepeat(pushing(), 5), skip_render_check=True)  # warnings are errors
    env = ActionRepeat(pushing(), 2)
    env.reset(seed=1)
    twin = copy.deepcopy(env)
    assert twin.step(PUSH)[1] == env.step(PUSH)[1]
    remade = gym.make(env.spec)  # type: ignore[arg-type]
    assert remade.get_wrapper_attr("repeat") == 2


@pytest.mark.parametrize("repeat", [0, -1, 2.5])
def test_bad_numbers_are_named(repeat: Any) -> None:
    with pytest.raises(ConfigError, match="repeat="):
        ActionRepeat(pushing(), repeat)


def test_vector_envs_are_refused() -> None:
    made = gym.make_vec("relgym/TruckPush-v0", 2, "sync")
    with pytest.raises(ConfigError, match="make_vec"):
        ActionRepeat(made, 2)  # type: ignore[arg-type]
    made.close()
