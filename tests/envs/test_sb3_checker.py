"""Stable-Baselines3's checker accepts every registered env without a warning (warnings are errors)."""

from __future__ import annotations

import gymnasium as gym
import pytest

import relgym  # noqa: F401  (registers the ids)
from relgym.wrappers.action_repeat import ActionRepeat
from relgym.wrappers.flat import FlatView

pytestmark = pytest.mark.sb3

NEEDS_A_MODEL = {"relgym/LearnedModel-v0"}
IDS = sorted(name for name in gym.registry if name.startswith("relgym/") and name not in NEEDS_A_MODEL)


def test_ids_are_registered() -> None:
    assert "relgym/BallBoxRamp-v0" in IDS
    assert "relgym/BallGoal-v0" in IDS
    assert "relgym/BoxPush-v0" in IDS
    assert "relgym/TruckPush-v0" in IDS


@pytest.mark.parametrize("name", IDS)
def test_checker_has_nothing_to_say(name: str) -> None:
    from stable_baselines3.common.env_checker import check_env

    env = gym.make(name)
    check_env(env)
    env.close()


@pytest.mark.parametrize(
    ("name", "arguments"),
    [("relgym/TruckPush-v0", {"task": "push"}), ("relgym/BallGoal-v0", {}), ("relgym/BoxPush-v0", {})],
)
def test_checker_has_nothing_to_say_of_flat_views(name: str, arguments: dict[str, str]) -> None:
    from stable_baselines3.common.env_checker import check_env

    env = FlatView(ActionRepeat(gym.make(name, **arguments), 5))
    check_env(env)
    env.close()
