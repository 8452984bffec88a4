from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import relgym  # noqa: F401  (registers the ids)
from relgym.envs.actions import acting
from relgym.envs.ball_course import rest_places
from relgym.envs.ball_goal import HOLD, BallGoalEnv, GoalTask
from relgym.envs.physics import GRAVITY, TIME_STEP
from relgym.envs.scripted import ball_home
from relgym.errors import ConfigError
from relgym.scene.objects import Scene
from relgym.wrappers.action_repeat import ActionRepeat

G = GRAVITY * TIME_STEP**2
K = 8.0 * TIME_STEP**2
"""Displacement per step^2 of full thrust."""


def goal_env(**options: Any) -> BallGoalEnv:
    env = BallGoalEnv()
    env.reset(seed=0, options=options)
    return env


def velocity(scene: Scene) -> np.ndarray:
    return np.array([scene["ball"]["vx"], scene["ball"]["vy"]])


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_in_flight_thrust_adds_to_gravity(seed: int) -> None:
    env, rng = goal_env(drop=0.3), np.random.default_rng(seed)
    flights = 0
    for _ in range(40):
        before, flying = velocity(env.scene), not env.contacts
        action = rng.uniform(-1.0, 1.0, 2)
        env.step(action)
        if flying:
            flights += 1
            expected = before + K * action - [0.0, G]
            np.testing.assert_allclose(velocity(env.scene), expected, rtol=0, atol=1e-13)
    assert flights > 20


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_a_contact_follows_the_law_with_thrust_in_it(seed: int) -> None:
    env, rng = goal_env(drop=0.1), np.random.default_rng(seed)
    bounces = 0
    for _ in range(120):
        before, touching = velocity(env.scene), env.contacts
        action = rng.uniform(-1.0, 1.0, 2)
        env.step(action)
        if len(touching) == 1:
            bounces += 1
            n, pull = np.array(touching[0].normal), K * action - [0.0, G]
            impulse = max(0.0, -(1.9 * before @ n + pull @ n))
            expected = before + pull + impulse * n
            np.testing.assert_allclose(velocity(env.scene), expected, rtol=0, atol=1e-12)
    assert bounces > 0


def test_without_thrust_it_is_the_passive_world() -> None:
    env = goal_env()
    passive = gym.make("relgym/BallBoxRamp-v0").unwrapped
    passive.reset(seed=0)
    passive.set_state(
        passive.scene.schema.scene({n: v for n, v in env.scene.values().items() if n != "goal"})
    )  # type: ignore[attr-defined]
    for _ in range(200):
        env.step(np.zeros(2))
        passive.step(0)
        ours, theirs = env.scene["ball"].values, passive.scene["ball"].values  # type: ignore[attr-defined]
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


def test_thrusters_are_weaker_than_gravity() -> None:
    env = goal_env()
    up = np.array([0.0, 1.0])
    for _ in range(5):
        env.step(up)
    assert env.scene["ball"]["vy"] < 0.0


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_courses_are_as_said(seed: int) -> None:
    env = BallGoalEnv()
    _, info = env.reset(seed=seed)
    scene, drawn = info["scene"], info["configuration"]
    assert drawn["start"] != drawn["goal"]
    assert {drawn["start"], drawn["goal"]} <= {"gap1", "gap2", "gap3", "box"}
    assert abs(scene["goal"]["dx"]) >= 1.0 and scene["goal"]["held"] == 0.0
    assert velocity(scene).tolist() == [0.0, 0.0] and not info["contacts"]
    assert set(drawn) == set(env.reset_options)
    assert env.reset(options=drawn)[1]["scene"] == scene


def test_every_place_is_start_and_goal_in_turn() -> None:
    env = BallGoalEnv(objects={"box": 2, "ramp": 1})
    drawn = [env.reset(seed=seed)[1]["configuration"] for seed in range(200)]
    places = {"gap1", "gap2", "gap3", "gap4", "box", "box2"}
    assert {d["start"] for d in drawn} == {d["goal"] for d in drawn} == places
    assert rest_places({"ramp": "ramp"}) == ("gap1", "gap2")


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_the_goal_keeps_its_place(seed: int) -> None:
    env, rng = BallGoalEnv(), np.random.default_rng(seed)
    env.reset(seed=seed)
    (first,) = env.task.regions(env.scene) if env.task else ()
    for _ in range(100):
        env.step(rng.uniform(-1.0, 1.0, 2))
    (last,) = env.task.regions(env.scene) if env.task else ()
    assert (last.left, last.bottom) == pytest.approx((first.left, first.bottom), abs=1e-10)


def resting_in_goal() -> BallGoalEnv:
    """The ball lies on the floor, in the goal."""
    env = goal_env(goal="gap1", start="gap3", ramp="right")
    scene, floor = env.scene, env.scene["floor"]
    down = scene["ball"]["py"] - scene["ball"]["sy"] / 2 - floor["py"] - floor["sy"] / 2 + 0.005
    lying = {("ball", "py"): scene["ball"]["py"] - down, ("goal", "dx"): 0.05, ("goal", "dy"): 0.02}
    env.set_state(scene.replace(lying))
    return env


def test_who_stays_long_enough_succeeds() -> None:
    env = resting_in_goal()
    for k in range(1, HOLD + 1):
        _, reward, terminated, _, info = env.step(np.zeros(2))
        assert env.scene["goal"]["held"] == k
        assert terminated == info["is_success"] == (k == HOLD)
        assert reward == pytest.approx(-0.004 + 2.0 * (k == HOLD), abs=1e-12)


def test_who_leaves_begins_anew() -> None:
    env = resting_in_goal()
    for _ in range(30):
        _, reward, terminated, *_ = env.step(np.array([-1.0, 0.0]))
        assert not terminated
        if abs(env.scene["goal"]["dx"]) > 0.2:
            break
    assert reward == pytest.approx(env.scene["ball"]["vx"] - 0.004, abs=1e-12)  # away: vx < 0
    env.step(np.array([-1.0, 0.0]))
    assert env.scene["goal"]["held"] == 0.0


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_arrays_of_scenes_are_evaluated_as_single_ones(seed: int) -> None:
    env, rng, task = goal_env(), np.random.default_rng(seed), GoalTask()
    scenes, after, said = [], [], []
    actions = rng.uniform(-1.0, 1.0, (6, 2))
    for action in actions:
        env.reset(seed=int(rng.integers(100)))
        near = {("goal", "dx"): rng.uniform(-0.4, 0.4), ("goal", "dy"): rng.uniform(-0.2, 0.2)}
        env.set_state(env.scene.replace({**near, ("goal", "held"): float(HOLD - 1)}))
        scenes.append(env.scene)
        _, reward, terminated, _, info = env.step(action)
        after.append(env.scene)
        said.append((reward, terminated, info["is_success"]))
        assert task.reward(acting(scenes[-1], action), action, env.scene) == reward
    before_vectors, after_vectors = (np.stack([s.vector for s in some]) for some in (scenes, after))
    verdict = task.evaluate(scenes[0].layout, before_vectors, actions, after_vectors)
    whole = zip(
        verdict.rewards.tolist(), verdict.terminated.tolist(), verdict.succeeded.tolist(), strict=True
    )
    assert list(whole) == said


def test_a_scene_alone_determines_what_follows() -> None:
    env, twin, rng = goal_env(drop=0.1), goal_env(), np.random.default_rng(0)
    for _ in range(150):
        env.step(rng.uniform(-1.0, 1.0, 2))
        twin.set_state(env.scene)
        np.testing.assert_array_equal(twin.vector, env.vector)
        assert [c.other for c in twin.contacts] == [c.other for c in env.contacts]
        action = rng.uniform(-1.0, 1.0, 2)
        twin.step(action)
        env.step(action)
        np.testing.assert_allclose(twin.vector, env.vector, rtol=0, atol=1e-12)


def successes(policy: Any, seeds: range) -> float:
    env = ActionRepeat(gym.make("relgym/BallGoal-v0"), 5)
    done = 0
    for seed in seeds:
        env.reset(seed=seed)
        ended = truncated = False
        while not (ended or truncated):
            _, _, ended, truncated, info = env.step(policy(env.unwrapped.scene))  # type: ignore[attr-defined]
        done += info["is_success"]
    return done / len(seeds)


def test_it_can_be_done_in_a_hundred_decisions() -> None:
    assert successes(ball_home, range(40)) >= 0.9


def test_chance_hardly_ever_succeeds() -> None:
    rng = np.random.default_rng(0)
    assert successes(lambda scene: rng.uniform(-1.0, 1.0, 2), range(34)) < 0.03


def test_bad_arguments_are_named() -> None:
    with pytest.raises(ConfigError, match="objects is empty"):
        BallGoalEnv(objects=())
    with pytest.raises(ConfigError, match="different places"):
        goal_env(start="gap1", goal="gap1")
    with pytest.raises(ConfigError, match="'goal'"):
        goal_env(goal="ramp")
