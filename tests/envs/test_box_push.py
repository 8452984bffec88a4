"""BoxPush: hand-worked rewards, what is drawn, and that its task can be done."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import relgym  # noqa: F401  (registers the ids)
from relgym.envs.box_goal import DeliverTask
from relgym.envs.box_push import HALF, SPEED, BoxPushEnv
from relgym.envs.scripted import deliver
from relgym.errors import ConfigError


def successes(seeds: range, **arguments: object) -> float:
    env = gym.make("relgym/BoxPush-v0", **arguments)
    done = []
    for seed in seeds:
        env.reset(seed=seed)
        action, step, over = np.zeros(2, dtype=np.float32), 0, False
        while not over:
            if step % 10 == 0:
                action = deliver(env.get_wrapper_attr("scene"))
            _, _, terminated, truncated, info = env.step(action)
            step, over = step + 1, terminated or truncated
        done.append(info["is_success"])
    return float(np.mean(done))


@pytest.mark.parametrize("arguments", [{}, {"parcel": "tee"}, {"n_boxes": 4, "friction": 0.6}])
def test_the_task_can_be_done(arguments: dict[str, object]) -> None:
    assert successes(range(100, 106), **arguments) >= 0.83


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [{}, {"parcel": "tee"}, {"n_boxes": 4}])
def test_the_script_does_it_nearly_always(arguments: dict[str, object]) -> None:
    assert successes(range(1_000, 1_100), **arguments) >= 0.95


def test_hand_worked_rewards() -> None:
    env = BoxPushEnv(n_boxes=1)
    env.reset(seed=0)
    before = env.scene
    name = ("goal", "dx")
    after = before.replace({name: before["goal"]["dx"] - 0.01, ("goal", "dy"): before["goal"]["dy"]})
    way = abs(before["goal"]["dx"]) - abs(after["goal"]["dx"])
    assert DeliverTask().reward(before, np.zeros(2), after) == pytest.approx(way - 0.001)
    there = before.replace({name: 0.1, ("goal", "dy"): -0.1})
    far = before.replace({name: 1.1, ("goal", "dy"): -0.1})
    assert DeliverTask().reward(far, np.zeros(2), there) == pytest.approx(1.0 - 0.001 + 2.0)
    assert DeliverTask().terminated(far, np.zeros(2), there)
    assert not DeliverTask().terminated(there, np.zeros(2), far)


def test_the_pusher_has_the_velocity_that_is_asked_for() -> None:
    env = BoxPushEnv(n_boxes=0)
    env.reset(seed=1)
    env.step(np.array([0.5, -0.25], dtype=np.float32))
    scene = env.scene
    assert scene["pusher"]["vx"] == pytest.approx(0.5 * SPEED, abs=1e-12)
    assert scene["pusher"]["vy"] == pytest.approx(-0.25 * SPEED, abs=1e-12)


def test_as_many_boxes_as_are_asked_for_lie_on_the_table() -> None:
    env = BoxPushEnv(n_boxes=3)
    for count in range(4):
        env.reset(seed=count, options={"count": count})
        inside = [abs(env.scene[f"box{k}"]["px"]) < HALF for k in (1, 2, 3)]
        assert sum(inside) == count
    counts = {env.reset(seed=seed)[1]["configuration"]["count"] for seed in range(20)}
    assert counts == {0, 1, 2, 3}


def test_configurations_repeat_scenes() -> None:
    env = BoxPushEnv()
    _, info = env.reset(seed=5)
    again, _ = BoxPushEnv().reset(seed=5, options=info["configuration"])
    assert all(np.array_equal(again[o.name], o.values) for o in info["scene"])


def test_wrong_arguments() -> None:
    with pytest.raises(ConfigError, match=r"parcel='cube': expected one of \['box', 'tee'\]"):
        BoxPushEnv(parcel="cube")
    with pytest.raises(ConfigError, match="no room on the table for 10 boxes"):
        sizes = {f"box{k}_{s}": 0.8 for k in range(1, 11) for s in ("width", "height")}
        BoxPushEnv(n_boxes=10).reset(seed=0, options={"count": 10, **sizes})
