from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import relgym  # noqa: F401  (registers the ids)
from relgym.envs.actions import acting
from relgym.envs.scripted import push_as_if_unstacked, push_knowing
from relgym.envs.truck_goal import STEPS, PushTask
from relgym.envs.truck_push import TruckPushEnv
from relgym.errors import ConfigError
from relgym.scene.objects import Scene

ORDER = ("box1", "box2", "box3")
EVEN = {"layout": 4, "order": ORDER, "box1_friction": 0.1, "box2_friction": 0.2, "box3_friction": 0.45}
"""All three on the ground: friction takes 75 / 40 = 1.875 from the velocity in a step."""


def pushing(**options: Any) -> TruckPushEnv:
    env = TruckPushEnv(task="push")
    env.reset(seed=0, options=options)
    return env


def force(newton: float) -> np.ndarray:
    return np.array([newton / 125.0 - 1.0])


def test_hand_worked_rewards() -> None:
    env = pushing(**EVEN, goal_distance=30.0)
    _, reward, terminated, truncated, info = env.step(force(115.0))  # v' = 40 / 40 = 1
    assert env.scene["goal"]["ahead"] == pytest.approx(29.0, abs=1e-12)
    assert reward == pytest.approx(0.1 * 1.0 - 0.02, abs=1e-12)
    assert (terminated, truncated, info["is_success"]) == (False, False, False)
    _, reward, terminated, *_ = env.step(force(0.0))  # comes to rest too early: the first stop counts
    assert (reward, terminated) == (pytest.approx(-0.02, abs=1e-12), True)


@pytest.mark.parametrize(
    ("distance", "speed", "reward", "terminated", "success"),
    [
        (1.0, 1.0, 1.98, True, True),  # stops at the pad's far edge
        (-1.0, 1.0, 1.98, True, True),
        (1.001, 1.0, -0.02, True, False),  # stops short of it
        (0.5, 3.875, 0.1 * (0.5 - 1.5) - 0.02, True, False),  # moves 2 and is 1.5 over
        (0.5, 3.0, 0.1 * (0.5 - 0.625) - 0.02, False, False),  # moves 1.125: over, but still on the pad
    ],
)
def test_hand_worked_ends(
    distance: float, speed: float, reward: float, terminated: bool, success: bool
) -> None:
    env = pushing(**EVEN, goal_distance=distance, speed=speed)
    _, given_reward, ended, _, info = env.step(force(0.0))
    assert given_reward == pytest.approx(reward, abs=1e-12)
    assert (ended, info["is_success"]) == (terminated, success)


def test_waiting_at_the_start_is_no_stop_and_costs() -> None:
    env = pushing(**EVEN, goal_distance=30.0)
    _, reward, terminated, *_ = env.step(force(0.0))
    assert (reward, terminated) == (-0.02, False)


def test_time_is_up_after_twenty_steps() -> None:
    env = gym.make("relgym/TruckPush-v0", task="push")
    env.reset(seed=0)
    ends = [env.step(force(0.0))[2:4] for _ in range(STEPS)]
    assert ends == [(False, False)] * (STEPS - 1) + [(False, True)]
    env.reset()
    assert not env.step(force(0.0))[3]


def test_a_restored_state_keeps_its_time() -> None:
    env, twin = pushing(), TruckPushEnv(task="push")
    for _ in range(12):
        env.step(force(0.0))
    twin.set_state(env.get_state())
    assert [twin.step(force(0.0))[3] for _ in range(8)] == [False] * 7 + [True]
    twin.set_state(env.scene)  # a scene alone knows no time
    assert not any(twin.step(force(0.0))[3] for _ in range(STEPS - 1))


def test_one_box_is_slippery_one_middling_one_rough() -> None:
    env = TruckPushEnv(task="push", bystanders=2)
    firsts, distances = set(), []
    for seed in range(60):
        _, info = env.reset(seed=seed)
        drawn = info["configuration"]
        first, second, third = (drawn[f"{name}_friction"] for name in drawn["friction_order"])
        assert 0.05 <= first <= 0.12 and 0.2 <= second <= 0.3 and 0.4 <= third <= 0.5
        assert 20 <= drawn["goal_distance"] <= 40
        assert env.scene["truck"]["vx"] == 0.0
        assert env.reset(options=drawn)[1]["scene"] == info["scene"]
        firsts.add(drawn["friction_order"][0])
        distances.append(drawn["goal_distance"])
    assert firsts == set(ORDER)
    assert min(distances) < 22 and max(distances) > 38


@given(st.integers(1, 5), st.integers(0, 10**6))
def test_the_goal_keeps_its_place(n_boxes: int, seed: int) -> None:
    env = TruckPushEnv(n_boxes=n_boxes, task="push")
    env.reset(seed=seed)
    (first,) = env.task.regions(env.scene) if env.task else ()
    rng = np.random.default_rng(seed)
    for _ in range(STEPS):
        env.step(rng.uniform(-1.0, 1.0, 1))
    (last,) = env.task.regions(env.scene) if env.task else ()
    assert last.left == pytest.approx(first.left, abs=1e-9)
    assert (last.bottom, last.width) == (first.bottom, 2.0)


@given(st.integers(0, 10**6))
def test_arrays_of_scenes_are_evaluated_as_single_ones(seed: int) -> None:
    env, rng = pushing(), np.random.default_rng(seed)
    task = PushTask()
    scenes: list[Scene] = []
    for _ in range(8):
        env.reset(seed=int(rng.integers(1000)), options={"goal_distance": float(rng.uniform(-3, 3))})
        env.set_state(env.scene.replace({("truck", "vx"): float(rng.uniform(0, 4))}))
        scenes.append(env.scene)
    actions = rng.uniform(-1.0, 1.0, (8, 1))
    after, rewards, ends, wins = [], [], [], []
    for scene, action in zip(scenes, actions, strict=True):
        env.set_state(scene)
        _, reward, ended, _, info = env.step(action)
        after.append(env.scene)
        rewards.append(reward)
        ends.append(ended)
        wins.append(info["is_success"])
        # With the action in the scene or without it.
        assert task.reward(acting(scene, action), action, env.scene) == reward
        assert task.terminated(scene, action, env.scene) == ended
        assert task.succeeded(scene, action, env.scene) == info["is_success"]
    before_vectors, after_vectors = (np.stack([s.vector for s in some]) for some in (scenes, after))
    batch = (scenes[0].layout, before_vectors, actions, after_vectors)
    assert task.rewards(*batch).tolist() == rewards
    assert task.terminations(*batch).tolist() == ends
    assert task.successes(*batch).tolist() == wins


def successes(policy: Any, episodes: int, **arguments: Any) -> float:
    env = TruckPushEnv(task="push", **arguments)
    done = 0
    for seed in range(episodes):
        env.reset(seed=seed)
        ended = truncated = False
        while not (ended or truncated):
            _, _, ended, truncated, info = env.step(policy(env.scene))
        done += info["is_success"]
    return done / episodes


def test_who_knows_the_friction_succeeds() -> None:
    assert successes(push_knowing, 300) >= 0.99
    assert successes(push_knowing, 50, bystanders=7) >= 0.99
    assert successes(push_knowing, 50, n_boxes=5) >= 0.99


def test_who_ignores_stacks_often_fails() -> None:
    assert successes(push_as_if_unstacked, 300) <= 0.76


def test_chance_hardly_ever_succeeds() -> None:
    rng = np.random.default_rng(0)
    assert successes(lambda scene: rng.uniform(-1.0, 1.0, 1), 1000) < 0.01


def test_the_goal_is_no_body_and_the_action_is_not_seen() -> None:
    env = gym.make("relgym/TruckPush-v0", task="push")
    observation, info = env.reset(seed=0)
    assert sorted(observation) == ["box1", "box2", "box3", "goal", "truck"]
    assert info["scene"].layout.names[-1] == "goal" and len(info["scene"].layout.bodies) == 4
    assert [str(target) for target in env.get_wrapper_attr("schema").targets] == [
        "truck.vx",
        "box.px",
        "goal.ahead",
    ]


def test_to_push_is_the_task_unless_nobody_could_plan() -> None:
    assert gym.make("relgym/TruckPush-v0").get_wrapper_attr("task") == PushTask()
    assert gym.make("relgym/TruckPush-v0", resample="step").get_wrapper_attr("task") is None
    assert TruckPushEnv(task=None).task is None


def test_a_given_range_of_frictions_holds_for_all_boxes() -> None:
    env = TruckPushEnv(friction_range=(0.2, 0.21), bystanders=1)
    for seed in range(20):
        env.reset(seed=seed)
        assert all(0.2 <= o["friction"] <= 0.21 for o in env.scene if o.type.name == "box")
    with pytest.raises(ConfigError, match="friction_order"):
        env.reset(options={"friction_order": ORDER})


def test_half_the_gravity_is_half_the_friction() -> None:
    speeds = []
    for gravity in (10.0, 5.0):
        env = TruckPushEnv(gravity=gravity)
        env.reset(seed=0, options={"layout": 1, "order": ORDER, "box1_friction": 0.1})
        env.step(force(250.0))
        speeds.append(env.scene["truck"]["vx"])
    assert speeds == pytest.approx([0.025 * 250.0 - 7.5 * 0.1, 0.025 * 250.0 - 3.75 * 0.1], abs=1e-12)


def test_bad_combinations_are_named() -> None:
    with pytest.raises(ConfigError, match=r"resample='step'.*task=None"):
        TruckPushEnv(task="push", resample="step")
    with pytest.raises(ConfigError, match="goal_distance"):
        TruckPushEnv(task=None).reset(options={"goal_distance": 3.0})
