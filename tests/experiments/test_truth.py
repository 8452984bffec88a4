"""Which envs have test scenes that know what happened."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import pytest

import relgym  # noqa: F401 - registers the envs
from relgym.experiments.truth import true_episodes


def schema_of(env_id: str, **arguments: Any) -> Any:
    return gym.make(env_id, **arguments).get_wrapper_attr("schema")


@pytest.mark.parametrize(
    ("env_id", "arguments", "steps"),
    [
        ("relgym/BallBoxRamp-v0", {}, 200),
        ("relgym/BallBoxRamp-v0", {"incline": 50, "friction": 0.2, "objects": ["ramp"]}, 200),
        ("relgym/TruckPush-v0", {"task": None, "n_boxes": 2}, 40),
        ("relgym/TruckPush-v0", {"resample": "step"}, 40),
    ],
)
def test_the_home_worlds_tell_the_truth_about_their_scenes(
    env_id: str, arguments: dict[str, Any], steps: int
) -> None:
    schema = schema_of(env_id, **arguments)
    found = true_episodes(env_id, arguments, schema, seed=5)
    assert found is not None
    (one,) = found.episodes(1)
    assert len(one) == steps == found.steps
    assert {name for name, _ in one.schema.objects} == {name for name, _ in schema.objects}


@pytest.mark.parametrize(
    ("env_id", "arguments"),
    [
        ("CartPole-v1", {}),
        ("relgym/TruckPush-v0", {}),  # with a task there is a goal, which the test scenes lack
        ("relgym/TruckPush-v0", {"task": None, "gravity": 5.0}),
        ("relgym/BallBoxRamp-v0", {"balls": 2}),
        ("relgym/BallBoxRamp-v0", {"elasticity": {"box": 0.5}}),
    ],
)
def test_others_do_not(env_id: str, arguments: dict[str, Any]) -> None:
    home = schema_of("relgym/BallBoxRamp-v0")
    assert true_episodes(env_id, arguments, home, seed=5) is None


def test_a_model_of_another_world_is_not_tested_there() -> None:
    assert true_episodes("relgym/BallBoxRamp-v0", {}, schema_of("relgym/TruckPush-v0"), seed=5) is None
