"""Issue "Dream", row 2: a policy trained in the dream alone, of a model learned from a few random real steps.

``python -m relgym.experiments.dyna_asleep --seeds 2``
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from time import perf_counter
from typing import Any, Final

import relgym
from relgym.experiments.bar import Measure, measured, report
from relgym.experiments.dyna import ENOUGH, Examination
from relgym.experiments.dyna_arms import AGENT, COURSES, Course, make_env
from relgym.experiments.seeds import TRAINING_SEEDS
from relgym.wrappers.sb3.apprentice import Apprentice
from relgym.wrappers.sb3.settings import DynaConfig

__all__ = ["main", "trained_asleep"]

REAL_STEPS: Final = 1_000
GRADIENT_STEPS: Final = 30_000
DREAMS: Final = 32
"""At once; one decision in all of them is followed by `UPDATES` gradient steps."""

UPDATES: Final = 16


def trained_asleep(
    course: Course, *, seed: int, real: int = REAL_STEPS, updates: int = GRADIENT_STEPS
) -> Any:
    """SAC that never acted in the world: only its model watched that, under random actions.

    Parameters
    ----------
    course
        Where; reward and termination are given.
    seed
        Of everything random.
    real
        Real steps that the model learns from.
    updates
        Gradient steps in the dream.
    """
    import torch
    from stable_baselines3 import SAC

    from relgym.wrappers.sb3.dreaming import DreamVecEnv, explore

    torch.set_num_threads(1)
    env = make_env(course)
    config = DynaConfig(horizon=course.horizon, seed=seed)
    model = relgym.WorldModel(env.get_wrapper_attr("schema"))
    apprentice = Apprentice(model, env.get_wrapper_attr("task"), config)
    explore(apprentice, env, real, seed=seed)
    dreams = DreamVecEnv(apprentice, env, num_envs=DREAMS, config=config)
    settings = {**AGENT, "learning_starts": 20 * DREAMS, "buffer_size": 100_000}
    agent = SAC("MlpPolicy", dreams, seed=seed, gradient_steps=UPDATES, **settings)
    agent.learn(DREAMS * (updates // UPDATES))
    return agent


def main(arguments: Sequence[str] | None = None) -> None:
    """Train with the number of seeds on the command line, test in the world, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--course", choices=sorted(COURSES), default="truck")
    parser.add_argument("--seeds", type=int, default=len(TRAINING_SEEDS))
    parser.add_argument("--updates", type=int, default=GRADIENT_STEPS)
    chosen = parser.parse_args(arguments)
    course, successes, seconds = COURSES[chosen.course], [], []
    tests = Examination(course)
    for seed in TRAINING_SEEDS[: chosen.seeds]:
        started = perf_counter()
        agent = trained_asleep(course, seed=seed, updates=chosen.updates)
        seconds.append(perf_counter() - started)
        successes.append(tests.successes(agent))
    measures: list[Measure] = [
        measured("successes of 100 real episodes", ENOUGH, successes, ">="),
        measured("seconds", 600, seconds),
    ]
    print(report(f"trained in the dream alone: {course.title}", measures))


if __name__ == "__main__":
    main()
