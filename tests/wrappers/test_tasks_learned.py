"""The tasks' worlds are learned exactly, and dreams of them are evaluated as the worlds are."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import relgym  # noqa: F401  (registers the ids)
from relgym.envs.base import SceneEnv
from relgym.envs.dreams.env import LearnedModelEnv
from relgym.envs.scripted import ball_home
from relgym.experiments.seeds import TUNING_SEEDS
from relgym.scene.objects import Scene
from relgym.wrappers.action_repeat import ActionRepeat
from relgym.wrappers.flat import FlatView
from relgym.wrappers.model_learner import ModelLearner


def test_a_dream_of_pushing_is_evaluated_as_the_world() -> None:
    rng = np.random.default_rng(0)
    env = gym.make("relgym/TruckPush-v0", task="push")
    learner = ModelLearner(env, predict=False)
    flat = {"layout": 4, "order": ("box1", "box2", "box3")}
    learner.reset(seed=0, options=flat)
    for _ in range(150):
        *_, terminated, truncated, _ = learner.step(rng.uniform(0.2, 1.0, 1))
        if terminated or truncated:
            learner.reset(options=flat)
    real = env.unwrapped
    assert isinstance(real, SceneEnv) and real.task is not None
    dream = LearnedModelEnv(learner.model, like=env, reward=real.task.reward, terminated=real.task.terminated)
    dream.reset(options={"scene": real.reset(seed=9, options=flat)[1]["scene"]})
    for _ in range(8):
        action = rng.uniform(0.5, 1.0, 1)
        _, reward, terminated, _, _ = real.step(action)
        _, dreamed, ended, failed, _ = dream.step(action)
        assert not failed
        assert (dreamed, ended) == (pytest.approx(reward, abs=1e-9), terminated)
        if terminated:
            break
    assert terminated  # over the goal


def test_dreams_are_seen_as_the_world_is() -> None:
    pytest.importorskip("pygame")
    env = gym.make("relgym/BallGoal-v0")
    learner = ModelLearner(env, predict=False)
    learner.reset(seed=0)
    for _ in range(40):
        learner.step(learner.action_space.sample())
    dream = LearnedModelEnv(learner.model, like=env, render_mode="rgb_array")
    dream.reset(seed=0)
    picture = dream.render().astype(int)
    assert (np.abs(picture - np.array([255, 214, 92])).max(axis=2) < 3).mean() > 0.0005  # the goal
    assert FlatView(dream).flattener.names == FlatView(env).flattener.names


@pytest.mark.slow
@pytest.mark.parametrize("seed", TUNING_SEEDS[:3])
def test_flight_contacts_and_the_goal_are_learned_exactly(seed: int) -> None:
    rng = np.random.default_rng(seed)

    def mixed(scene: Scene) -> Any:
        return ball_home(scene) if rng.random() < 0.7 else rng.uniform(-1.0, 1.0, 2).astype(np.float32)

    learner = ModelLearner(gym.make("relgym/BallGoal-v0"), window=2000)
    env = ActionRepeat(learner, 5)
    env.reset(seed=seed)
    while learner.prequential.steps < 5000:
        *_, terminated, truncated, _ = env.step(mixed(learner.scene))
        if terminated or truncated:
            env.reset()
    assert max(learner.prequential.recent_wrong.values()) <= 20
    text = learner.model.describe(details=True)
    assert "0.0001 action.ax" in text and "0.0001 action.ay - 0.00098" in text
    assert "v'_n = max(u_n, -0.9 v_n)" in text
    assert "held' = held + 1" in text
