"""Agents that train in their dreams alone, of a model that watched a few random real steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any, Final, cast

import gymnasium as gym
from gymnasium.vector import AutoresetMode

import relgym
from relgym.envs.flat import FlatSpec
from relgym.experiments.dyna.arms import AGENT, COURSES, Course, make_env
from relgym.experiments.dyna.course import Examination
from relgym.wrappers.dyna.config import DynaConfig
from relgym.wrappers.dyna.trainer import ModelTrainer
from relgym.wrappers.flat import VectorFlatView

__all__ = ["among", "asleep", "trained_among", "trained_asleep"]

DREAMS: Final = 32
"""At once; one decision in all of them is followed by `UPDATES` gradient steps."""

UPDATES: Final = 16

_AGENT: Final = {**AGENT, "learning_starts": 20 * DREAMS, "buffer_size": 100_000, "gradient_steps": UPDATES}


def asleep(*, course: str, seed: int, real: int, updates: int) -> dict[str, Any]:
    """An agent that trained in its dream alone, in the real world.

    Parameters
    ----------
    course, seed
        Name in `COURSES`, and of everything random; reward and termination are given.
    real
        Random real decisions that the model learned from.
    updates
        Gradient steps.
    """
    started = perf_counter()
    agent = trained_asleep(COURSES[course], seed=seed, real=real, updates=updates)
    seconds = perf_counter() - started
    return {"successes": Examination(COURSES[course]).successes(agent), "seconds": seconds}


def among(*, seed: int, real: int, updates: int, bystanders: list[int]) -> dict[str, Any]:
    """An agent that dreamed of more boxes beside the track than its model ever saw; in the real world.

    Parameters
    ----------
    seed, real, updates
        As for `asleep`.
    bystanders
        How many there are in one scene or the other.

    Returns
    -------
    Successes of 100 real episodes by number of bystanders, and the seconds of training.
    """
    course, started = COURSES["truck"], perf_counter()
    agent, spec = trained_among(course, bystanders, seed=seed, real=real, updates=updates)
    seconds = perf_counter() - started
    found = {
        str(count): Examination(course, spec=spec, bystanders=count).successes(agent) for count in bystanders
    }
    return {"successes": found, "seconds": seconds}


def trained_asleep(course: Course, *, seed: int, real: int, updates: int) -> Any:
    """SAC that never acted in the world: only its model watched that, under random actions.

    Parameters
    ----------
    course
        Where; reward and termination are given.
    seed
        Of everything random.
    real
        Real decisions that the model learns from.
    updates
        Gradient steps in the dream.
    """
    from relgym.wrappers.sb3.dreaming import DreamVecEnv

    env = make_env(course)
    config = DynaConfig(horizon=course.horizon, seed=seed)
    trainer = _watched(env, config, real=real, seed=seed)
    dreams = DreamVecEnv(trainer, env, num_envs=DREAMS, config=config)
    agent = _agent(dreams, seed)
    agent.learn(DREAMS * (updates // UPDATES))
    return agent


def trained_among(
    course: Course, bystanders: Sequence[int], *, seed: int, real: int, updates: int
) -> tuple[Any, FlatSpec]:
    """SAC that trained in dreams of more objects than there were while its model learned.

    One bystander was there then: without any, nothing would tell that boxes exist that aren't pushed.

    Parameters
    ----------
    course
        Where the model learns; reward and termination are given.
    bystanders
        How many there are in the dreams, by turns. First scenes are those of real resets; no step is real.
    seed, real, updates
        As for `trained_asleep`.

    Returns
    -------
    The agent, and how it sees: a flat view with room for the most bystanders.
    """
    from relgym.wrappers.sb3.vec_env import VectorAsVecEnv

    env = make_env(course, bystanders=1)
    model = cast(relgym.WorldModel, _watched(env, DynaConfig(seed=seed), real=real, seed=seed).model)
    kind = env.get_wrapper_attr("schema").type_of("box1").name
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
    return agent, spec


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
