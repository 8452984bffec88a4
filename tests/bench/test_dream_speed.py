"""1,024 dreams stepped at once (bar: 100,000 env-steps a second on one core, three times the engine's).

Everything is recomputed in each step: geometry, relations, votes, players, functions. A round is one step of all
dreams, so 10.24 ms are 100,000 env-steps a second.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from pytest_benchmark.fixture import BenchmarkFixture

from relgym.config import ModelConfig
from relgym.envs import LearnedModelVectorEnv, drawn_from
from relgym.experiments.data import ball_blocks
from relgym.experiments.seeds import TUNING_SEEDS, TUNING_TEST_SEED
from relgym.model.world_model import WorldModel
from relgym.wrappers import ModelLearner

COUNT = 1024
TRUCK, BALL = "relgym/TruckPush-v0", "relgym/BallBoxRamp-v0"


@cache
def truck_model() -> WorldModel:
    """A truck with three boxes, pushed 1,200 times."""
    env = ModelLearner(gym.make(TRUCK, redraw="step"))
    env.action_space.seed(TUNING_SEEDS[0])
    for episode in range(60):
        env.reset(seed=TUNING_SEEDS[0] + episode)
        for _ in range(20):
            env.step(env.action_space.sample())
    env.model.finish()
    return env.model


@cache
def ball_model(frames: str) -> WorldModel:
    """A ball among six bodies, watched for 12,000 steps."""
    blocks = list(ball_blocks(1, seed=TUNING_SEEDS[0], blocks=60))
    model = WorldModel(blocks[0].schema, ModelConfig(frames=frames))  # type: ignore[arg-type]
    for block in blocks:
        for transition in block.transitions():
            model.learn_one(transition)
    model.finish()
    return model


def truck_dreams() -> LearnedModelVectorEnv:
    """Trucks in every layout, at every point of an episode."""
    like = gym.make(TRUCK, task=None)
    real, vectors = like.unwrapped, []
    like.action_space.seed(TUNING_TEST_SEED)
    while len(vectors) < COUNT:
        like.reset(seed=TUNING_TEST_SEED + len(vectors))
        for _ in range(20):
            vectors.append(real.get_wrapper_attr("scene").vector)
            like.step(like.action_space.sample())
    start = drawn_from(np.array(vectors))
    return LearnedModelVectorEnv(truck_model(), COUNT, like=like, start=start, horizon=20)


def ball_dreams(frames: str) -> LearnedModelVectorEnv:
    """Balls anywhere on their ways through 40 rooms."""
    blocks = ball_blocks(1, seed=TUNING_TEST_SEED, blocks=40, test=True)
    start = drawn_from(np.concatenate([block.vectors[:-1] for block in blocks]))
    return LearnedModelVectorEnv(ball_model(frames), COUNT, like=gym.make(BALL), start=start, horizon=200)


@pytest.mark.parametrize("world", ["truck", "ball by laws", "ball by modes"])
def test_dreams(benchmark: BenchmarkFixture, world: str) -> None:
    frames = {"ball by laws": "auto", "ball by modes": "world"}
    envs = truck_dreams() if world == "truck" else ball_dreams(frames[world])
    envs.reset(seed=0)
    envs.action_space.seed(0)
    actions = envs.action_space.sample()
    benchmark.pedantic(envs.step, args=(actions,), rounds=100, warmup_rounds=5)


@pytest.mark.parametrize(("env_id", "arguments"), [(TRUCK, {"task": None}), (BALL, {})])
def test_the_engine_in_a_sync_vector_env(
    benchmark: BenchmarkFixture, env_id: str, arguments: dict[str, Any]
) -> None:
    envs = SyncVectorEnv([lambda: gym.make(env_id, **arguments) for _ in range(COUNT)])
    envs.reset(seed=0)
    envs.action_space.seed(0)
    actions = envs.action_space.sample()
    benchmark.pedantic(envs.step, args=(actions,), rounds=5, warmup_rounds=1)
