"""How fast dreams are: 1,024 of them stepped at once by arrays, and as many envs of the engine one after another.

Both are timed through whole episodes of the same length, the step that begins the next ones included.
"""

from __future__ import annotations

from functools import cache
from time import process_time
from typing import Any, Final

import gymnasium as gym
import numpy as np
from gymnasium.vector import SyncVectorEnv

from relgym.config import ModelConfig
from relgym.envs import LearnedModelVectorEnv, drawn_from
from relgym.experiments.data import ball_episodes
from relgym.experiments.seeds import TUNING_SEEDS, TUNING_TEST_SEED
from relgym.experiments.worlds.online import learned
from relgym.model.running.compiled import KERNEL
from relgym.model.world_model import WorldModel
from relgym.wrappers import ModelLearner

__all__ = ["COUNT", "HORIZONS", "WORLDS", "dreams", "engine", "rate", "speed"]

COUNT: Final = 1024
"""Scenes at once."""

WORLDS: Final = ("truck", "ball by laws", "ball by modes")
"""A truck with three boxes; a ball among six bodies."""

HORIZONS: Final = {"truck": 20, "ball by laws": 200, "ball by modes": 200}
"""Steps that an episode lasts."""

_FRAMES: Final = {"ball by laws": "auto", "ball by modes": "world"}
_TRUCK: Final = ("relgym/TruckPush-v0", {"task": None})
_BALL: Final = ("relgym/BallBoxRamp-v0", dict[str, Any]())


def dreams(world: str) -> LearnedModelVectorEnv:
    """Dreams of one of `WORLDS`, at every point of an episode; model and first scenes are learned and drawn."""
    return _truck_dreams() if world == "truck" else _ball_dreams(_FRAMES[world])


def engine(world: str) -> SyncVectorEnv:
    """As many real envs."""
    env_id, arguments = _TRUCK if world == "truck" else _BALL
    limit = HORIZONS[world]
    return SyncVectorEnv([lambda: gym.make(env_id, limit, **arguments) for _ in range(COUNT)])


def rate(envs: Any, *, rounds: int, steps: int) -> float:
    """Env-steps per second of processor time, the median of some rounds of steps.

    Rounds of a step more than an episode has are each of one episode: the first step of the next one resets.
    """
    KERNEL.load()
    envs.reset(seed=0)
    envs.action_space.seed(0)
    actions = envs.action_space.sample()
    envs.step(actions)
    seconds = []
    for _ in range(rounds):
        start = process_time()
        for _ in range(steps):
            envs.step(actions)
        seconds.append(process_time() - start)
    return float(COUNT * steps / np.median(seconds))


def speed(*, world: str) -> dict[str, float]:
    """Env-steps per second of dreams and of the engine, as a task for the store of results."""
    return {
        "dreams": rate(dreams(world), rounds=15, steps=HORIZONS[world] + 1),
        "engine": rate(engine(world), rounds=3, steps=HORIZONS[world] + 1),
    }


@cache
def _truck_model() -> WorldModel:
    """A truck with three boxes, pushed 1,200 times."""
    env = ModelLearner(gym.make(_TRUCK[0], resample="step"))
    env.action_space.seed(TUNING_SEEDS[0])
    for episode in range(60):
        env.reset(seed=TUNING_SEEDS[0] + episode)
        for _ in range(20):
            env.step(env.action_space.sample())
    model: WorldModel = env.model
    model.finish()
    return model


@cache
def _ball_model(frames: str) -> WorldModel:
    """A ball among six bodies, watched for 12,000 steps."""
    episodes = ball_episodes(1, seed=TUNING_SEEDS[0], episodes=60)
    return learned(episodes, config=ModelConfig(frames=frames))  # type: ignore[arg-type]


def _truck_dreams() -> LearnedModelVectorEnv:
    """Trucks in every layout."""
    like = gym.make(_TRUCK[0], **_TRUCK[1])
    vectors: list[Any] = []
    like.action_space.seed(TUNING_TEST_SEED)
    while len(vectors) < COUNT:
        like.reset(seed=TUNING_TEST_SEED + len(vectors))
        for _ in range(20):
            vectors.append(like.get_wrapper_attr("scene").vector)
            like.step(like.action_space.sample())
    start = drawn_from(np.array(vectors))
    return LearnedModelVectorEnv(_truck_model(), COUNT, like=like, start=start, horizon=HORIZONS["truck"])


def _ball_dreams(frames: str) -> LearnedModelVectorEnv:
    """Balls anywhere on their ways through 40 rooms."""
    episodes = ball_episodes(1, seed=TUNING_TEST_SEED, episodes=40, test=True)
    start = drawn_from(np.concatenate([episode.vectors[:-1] for episode in episodes]))
    like = gym.make(_BALL[0])
    return LearnedModelVectorEnv(
        _ball_model(frames), COUNT, like=like, start=start, horizon=HORIZONS["ball by laws"]
    )
