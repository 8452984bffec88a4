"""Agents that train in their dreams alone, of a model that watched a few random real steps."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import Any, Final, cast

import gymnasium as gym
from gymnasium.vector import AutoresetMode

import relgym
from relgym.experiments.dyna.arms import AGENT, COURSES, make_env
from relgym.experiments.dyna.course import Examination
from relgym.wrappers.dyna.config import DynaConfig
from relgym.wrappers.dyna.trainer import ModelTrainer
from relgym.wrappers.flat import VectorFlatView

__all__ = ["among", "asleep"]

DREAMS: Final = 32
"""At once; one decision in all of them is followed by `UPDATES` gradient steps."""

UPDATES: Final = 16

_AGENT: Final = {**AGENT, "learning_starts": 20 * DREAMS, "buffer_size": 100_000, "gradient_steps": UPDATES}


def asleep(*, course: str, seed: int, real: int, updates: int) -> dict[str, Any]:
    """SAC that never acted in the world, in the real one: only its model watched that, under random actions.

    Parameters
    ----------
    course, seed
        Name in `COURSES`, and of everything random; reward and termination are given.
    real
        Random real decisions that the model learned from.
    updates
        Gradient steps in the dream.
    """
    from relgym.wrappers.sb3.dreaming import DreamVecEnv

    place, started = COURSES[course], perf_counter()
    env = make_env(place)
    config = DynaConfig(horizon=place.horizon, seed=seed)
    trainer = _watched(env, config, real=real, seed=seed)
    agent = _agent(DreamVecEnv(trainer, env, num_envs=DREAMS, config=config), seed)
    agent.learn(DREAMS * (updates // UPDATES))
    seconds = perf_counter() - started
    return {"successes": Examination(place).successes(agent), "seconds": seconds}


def among(*, seed: int, real: int, updates: int, bystanders: list[int]) -> dict[str, Any]:
    """SAC that dreamed of more boxes beside the track than its model ever saw; in the real world.

    One bystander was there while the model learned: without any, nothing would tell that boxes exist that aren't
    pushed.

    Parameters
    ----------
    seed, real, updates
        As for `asleep`.
    bystanders
        How many there are in one scene or the other, in the dreams by turns. First scenes are those of real resets; no
        step is real.

    Returns
    -------
    Successes of 100 real episodes by number of bystanders, and the seconds of training.
    """
    from relgym.wrappers.sb3.vec_env import VectorAsVecEnv

    course, started = COURSES["truck"], perf_counter()
    env = make_env(course, bystanders=1)
    model = cast(relgym.WorldModel, _watched(env, DynaConfig(seed=seed), real=real, seed=seed).model)
    kind = env.get_wrapper_attr("schema").type_of("box1").name
    # The flat view has room for the most bystanders.
    spec = replace(env.get_wrapper_attr("flat_spec"), slots={kind: 3 + max(bystanders)})
    dreams = []
    for count in bystanders:
        like = gym.make(course.env_id, disable_env_checker=True, **course.arguments, bystanders=count)
        many = relgym.envs.LearnedModelVectorEnv(
            model, DREAMS, like, horizon=course.horizon, autoreset_mode=AutoresetMode.SAME_STEP
        )
        dreams.append(VectorAsVecEnv(VectorFlatView(many, spec)))
        dreams[-1].seed(1_000 * seed + count)
    agent = _agent(dreams[0], seed)
    for turn in range(updates // (UPDATES * course.horizon)):
        agent.set_env(dreams[turn % len(dreams)])
        agent.learn(DREAMS * course.horizon, reset_num_timesteps=False)
    seconds = perf_counter() - started
    found = {
        str(count): Examination(course, spec=spec, bystanders=count).successes(agent) for count in bystanders
    }
    return {"successes": found, "seconds": seconds}


def _watched(env: gym.Env[Any, Any], config: DynaConfig, *, real: int, seed: int) -> ModelTrainer:
    """A model that has watched random actions."""
    from relgym.wrappers.sb3.dreaming import explore

    model = relgym.WorldModel(env.get_wrapper_attr("schema"))
    trainer = ModelTrainer(model, env.get_wrapper_attr("task"), config)
    explore(trainer, env, real, seed=seed)
    return trainer


def _agent(dreams: Any, seed: int) -> Any:
    import torch
    from stable_baselines3 import SAC
    from stable_baselines3.common.logger import Logger

    torch.set_num_threads(1)
    agent = SAC("MlpPolicy", dreams, seed=seed, **_AGENT)
    agent.set_logger(Logger(None, []))  # one of Stable-Baselines3's own leaves an empty folder behind
    return agent
