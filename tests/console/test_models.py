"""A model file and its env, found again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest
from plain_envs import Slider

from relgym.console.models import opened
from relgym.errors import ConfigError
from relgym.wrappers import ModelLearner


def saved(env: gym.Env[Any, Any], path: Path) -> Path:
    learner = ModelLearner(env)
    learner.action_space.seed(0)
    learner.reset(seed=0)
    for _ in range(30):
        *_, terminated, truncated, _ = learner.step(learner.action_space.sample())
        if terminated or truncated:
            learner.reset()
    learner.save(path)
    return path


def test_an_env_without_an_id_is_to_be_named(tmp_path: Path) -> None:
    file = saved(Slider(), tmp_path / "s.json")
    with pytest.raises(ConfigError, match="doesn't say which env it was learned in: name it with --env ID"):
        opened(file)


def test_the_env_is_made_as_it_was_unless_something_else_is_asked(tmp_path: Path) -> None:
    made = gym.make("relgym/TruckPush-v0", n_boxes=2, max_episode_steps=31)
    file = saved(made, tmp_path / "t.json")
    found = opened(file)
    assert (found.env_id, found.arguments) == ("relgym/TruckPush-v0", {"n_boxes": 2, "max_episode_steps": 31})
    assert found.env.spec is not None and found.env.spec.max_episode_steps == 31
    assert opened(file, arguments={"n_boxes": 4}).arguments["n_boxes"] == 4
    assert "box3" in opened(file, arguments={"n_boxes": 4}).view.schema.order
    assert opened(file, "relgym/TruckPush-v0").arguments["n_boxes"] == 2


def test_what_a_file_could_not_hold_is_asked_for(tmp_path: Path) -> None:
    gym.register("test/Told-v0", lambda length, start: Slider(length=length), disable_env_checker=True)
    try:
        file = saved(gym.make("test/Told-v0", length=40, start=print), tmp_path / "s.json")
        with pytest.raises(ConfigError, match="made with start, which a file can't hold"):
            opened(file)
        assert opened(file, arguments={"start": 0}).arguments == {"length": 40, "start": 0}
    finally:
        del gym.registry["test/Told-v0"]


def test_wrappers_that_changed_what_was_seen_are_named(tmp_path: Path) -> None:
    wrapped = gym.wrappers.TransformObservation(
        gym.make("CartPole-v1"), lambda seen: seen[:2], gym.spaces.Box(-9.0, 9.0, (2,))
    )
    file = saved(wrapped, tmp_path / "c.json")
    with pytest.raises(
        ConfigError, match="in the wrappers TransformObservation, and can't speak of CartPole-v1"
    ):
        opened(file)
