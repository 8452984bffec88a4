from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from relgym.errors import ConfigError
from relgym.planning import PlanningAgent, TreeSearch

SEARCH = TreeSearch(horizon=8, expansions=64, batch=32)


def agent(**options: Any) -> PlanningAgent:
    env = gym.make("relgym/TruckPush-v0", n_boxes=1)
    return PlanningAgent(env, **{"search": SEARCH, "random_steps": 40, "seed": 3} | options)


def test_it_learns_and_covers_each_real_step() -> None:
    made = agent().learn(60)
    assert made.steps == 60 == made.model.seen
    assert made.coverage is not None and len(made.coverage) == 60
    assert made.learn(60).steps == 60  # of all calls together


def test_same_seed_same_model() -> None:
    first, second = (agent().learn(60).model.to_json() for _ in range(2))
    assert first == second


def test_it_acts_as_policies_do() -> None:
    made = agent(task="given").learn(60)
    env = gym.make("relgym/TruckPush-v0", n_boxes=1)
    seen, _ = env.reset(seed=0)
    action, state = made.predict(seen)
    assert env.action_space.contains(action) and len(state) == 1
    stacked = {name: np.stack([part, part]) for name, part in seen.items()}
    actions, state = made.predict(stacked, None, np.array([True, True]))
    assert actions.shape == (2, 1) and len(state) == 2


def test_decisions_may_last_several_steps() -> None:
    made = agent(repeat=2).learn(41)
    assert 41 <= made.steps <= 42


def test_a_callback_ends_learning() -> None:
    assert agent().learn(60, callback=lambda each: each.steps < 5).steps == 5


@pytest.mark.parametrize(
    "options", [{"exploration": -1.0}, {"random_steps": -1}, {"task": "known"}, {"repeat": 0}]
)
def test_settings_out_of_range_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="expected"):
        agent(**options)


def test_a_task_that_is_given_must_be_there() -> None:
    with pytest.raises(ConfigError, match="no task"):
        PlanningAgent(gym.make("CartPole-v1"), task="given")
