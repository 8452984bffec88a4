from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import relgym  # noqa: F401  (registers the ids)
from relgym.errors import ConfigError
from relgym.wrappers.action_repeat import ActionRepeat
from relgym.wrappers.truncated_episodes import TruncatedEpisodes

WAIT, RUSH = np.array([-1.0], dtype=np.float32), np.array([1.0], dtype=np.float32)


def pushing() -> gym.Env[Any, Any]:
    return gym.make("relgym/TruckPush-v0", task="push", disable_env_checker=True)  # 20 steps


def lasted(env: gym.Env[Any, Any], action: Any = WAIT, **options: Any) -> tuple[int, bool, bool]:
    env.reset(seed=0, options=options)
    steps = 0
    while True:
        *_, terminated, truncated, _ = env.step(action)
        steps += 1
        if terminated or truncated:
            return steps, bool(terminated), bool(truncated)


def test_one_of_so_many_episodes_is_whole() -> None:
    env = TruncatedEpisodes(pushing(), 4, whole=3)
    assert [lasted(env)[0] for _ in range(7)] == [20, 4, 4, 20, 4, 4, 20]
    assert [lasted(whole := TruncatedEpisodes(pushing(), 4, whole=1))[0], lasted(whole)[0]] == [20, 20]


def test_a_truncated_episode_is_truncated_and_a_true_end_stays_one() -> None:
    env = TruncatedEpisodes(pushing(), 1)
    env.reset(seed=0)
    assert lasted(env) == (1, False, True)
    assert lasted(env, RUSH, goal_distance=1.0) == (1, True, False)  # beyond the goal at its last step


def test_nothing_else_changes() -> None:
    plain, env = pushing(), TruncatedEpisodes(pushing(), 3)
    (seen, said), (shown, told) = (e.reset(seed=1) for e in (plain, env))
    for _ in range(5):
        for name in seen:
            np.testing.assert_array_equal(seen[name], shown[name])
        assert said.keys() == told.keys()
        (seen, *before, said), (shown, *now, told) = (e.step(RUSH) for e in (plain, env))
        assert before == now


def test_steps_of_the_env_inside_and_decisions_outside() -> None:
    inside, outside = (
        ActionRepeat(TruncatedEpisodes(pushing(), 6), 3),
        TruncatedEpisodes(ActionRepeat(pushing(), 3), 6),
    )
    for env, decisions in ((inside, 2), (outside, 6)):
        env.reset(seed=0)
        assert lasted(env)[0] == decisions


def test_a_failed_reset_is_no_episode() -> None:
    env = TruncatedEpisodes(pushing(), 4, whole=2)
    with pytest.raises(ConfigError):
        env.reset(options={"no such option": 1})
    assert [lasted(env)[0] for _ in range(3)] == [20, 4, 20]


@pytest.mark.parametrize("wrong", [{"steps": 0}, {"steps": 2.5}, {"steps": 2, "whole": 0}])
def test_wrong_counts_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"steps|whole"):
        TruncatedEpisodes(pushing(), **wrong)


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_gymnasium_has_nothing_to_say() -> None:
    check_env(TruncatedEpisodes(pushing(), 5), skip_render_check=True)
    spec = TruncatedEpisodes(pushing(), 5).spec
    assert spec is not None
    assert spec.additional_wrappers[-1].kwargs == {"steps": 5, "whole": 5}
