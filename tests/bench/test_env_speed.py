"""Steps per second through `gym.make` (at least: 10,000 with the ball), beside the engine alone."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import relgym  # noqa: F401  (registers the ids)
from relgym.envs.ball_box_ramp import BallBoxRampEnv
from relgym.experiments.data import ball_episodes

STEPS = 1000


def roll(env: gym.Env[object, object], action: object) -> None:
    env.reset(seed=0)
    for _ in range(STEPS):
        *_, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()


@pytest.mark.parametrize(
    ("env_id", "action"),
    [
        ("relgym/BallBoxRamp-v0", 0),
        ("relgym/BallGoal-v0", np.zeros(2, np.float32)),
        ("relgym/TruckPush-v0", np.zeros(1, np.float32)),
    ],
)
def test_a_thousand_steps(benchmark: BenchmarkFixture, env_id: str, action: object) -> None:
    benchmark(roll, gym.make(env_id), action)


def test_a_thousand_engine_steps(benchmark: BenchmarkFixture) -> None:
    env = BallBoxRampEnv()
    env.reset(seed=0)
    world = env._engine

    def steps() -> None:
        for _ in range(STEPS):
            world.step()

    benchmark(steps)


def test_experiment_1_data(benchmark: BenchmarkFixture) -> None:
    """16,000 transitions with ground truth."""
    benchmark.pedantic(lambda: list(ball_episodes(1, seed=0)), rounds=3)


def test_rendering(benchmark: BenchmarkFixture) -> None:
    env = BallBoxRampEnv(render_mode="rgb_array")
    env.reset(seed=0)
    benchmark(env.render)
