"""What a step of learning costs in worlds of relgym's own and of others: median, mean and worst step.

The time is that of the process, the env's own step taken off; the env's own is told beside it, measured in the same
run. MuJoCo's worlds need the extra ``bench-envs`` (`relgym benchmark speed steps --worlds Reacher-v5`).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Final

import gymnasium as gym
import numpy as np

import relgym  # noqa: F401 - registers the envs
from relgym.wrappers import ModelLearner

__all__ = ["HOME", "StepTimes", "step_times", "trial"]

HOME: Final = ("relgym/BallBoxRamp-v0", "relgym/TruckPush-v0", "CartPole-v1")


class _Clock(gym.Wrapper[Any, Any, Any, Any]):
    """Adds up the processor time of an env's own steps."""

    spent = 0.0

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        begin = time.thread_time()
        found = self.env.step(action)
        self.spent += time.thread_time() - begin
        return found


@dataclass(frozen=True, slots=True)
class StepTimes:
    """Times of a run, in ms of processor time.

    Attributes
    ----------
    env_id, seed
        What was run.
    learner
        The learner's part of each step, shape ``(steps,)``.
    env
        The env's own step in the mean.
    coverage, nrmse
        Share of the latest predictions that are claimed, and how large their errors are (`Prequential`).
    """

    env_id: str
    seed: int
    learner: np.ndarray[tuple[int], np.dtype[np.float64]]
    env: float
    coverage: float
    nrmse: float

    def summary(self) -> dict[str, float]:
        """Milliseconds of a step: the median of the last quarter, mean, 99th percentile, longest; and the rest."""
        late = self.learner[-(len(self.learner) // 4 or 1) :]
        return {
            "late": float(np.median(late)),
            "mean": float(self.learner.mean()),
            "p99": float(np.percentile(self.learner, 99)),
            "longest": float(self.learner.max()),
            "env": self.env,
        }


def step_times(env_id: str, steps: int, *, seed: int = 0, **arguments: Any) -> StepTimes:
    """Learn from so many random steps of a world.

    Parameters
    ----------
    env_id
        Of a registered env.
    steps
        How many, >= 1.
    seed
        Of the env and its actions.
    arguments
        Of `ModelLearner`.
    """
    clock = _Clock(gym.make(env_id))
    learner = ModelLearner(clock, **arguments)
    learner.action_space.seed(seed)
    learner.reset(seed=seed)
    found = np.empty(steps)
    for k in range(steps):
        action, before, begin = learner.action_space.sample(), clock.spent, time.thread_time()
        _, _, terminated, truncated, _ = learner.step(action)
        found[k] = 1e3 * (time.thread_time() - begin - (clock.spent - before))
        if terminated or truncated:
            learner.reset()
    latest = learner.prequential
    learner.close()
    return StepTimes(env_id, seed, found, 1e3 * clock.spent / steps, latest.coverage, latest.nrmse)


def trial(*, world: str, steps: int, seed: int) -> dict[str, float]:
    """`step_times` in short, as a task for the store of results."""
    return step_times(world, steps, seed=seed).summary()
