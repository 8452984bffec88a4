"""What a step of learning costs in worlds of relgym's own and of others: median, mean and worst step.

The time is that of the process, the env's own step taken off; the env's own is told beside it, measured in the same
run. MuJoCo's worlds need the extra ``bench-envs`` (`relgym benchmark speed steps --worlds Reacher-v5`).
"""

from __future__ import annotations

import time
from typing import Any, Final

import gymnasium as gym
import numpy as np

import relgym  # noqa: F401 - registers the envs
from relgym.scene.objects import Float1D
from relgym.wrappers import ModelLearner

__all__ = ["HOME", "step_times", "trial"]

HOME: Final = ("relgym/BallBoxRamp-v0", "relgym/TruckPush-v0", "CartPole-v1")


class _Clock(gym.Wrapper[Any, Any, Any, Any]):
    """Adds up the processor time of an env's own steps."""

    spent = 0.0

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        begin = time.thread_time()
        found = self.env.step(action)
        self.spent += time.thread_time() - begin
        return found


def step_times(env_id: str, steps: int, *, seed: int = 0) -> tuple[Float1D, float]:
    """Learn from so many random steps of a world.

    Parameters
    ----------
    env_id
        Of a registered env.
    steps
        How many, >= 1.
    seed
        Of the env and its actions.

    Returns
    -------
    Milliseconds of processor time: the learner's part of each step, shape ``(steps,)``, and the env's in the mean.
    """
    clock = _Clock(gym.make(env_id))
    learner = ModelLearner(clock)
    learner.action_space.seed(seed)
    learner.reset(seed=seed)
    found = np.empty(steps)
    for k in range(steps):
        action, before, begin = learner.action_space.sample(), clock.spent, time.thread_time()
        _, _, terminated, truncated, _ = learner.step(action)
        found[k] = 1e3 * (time.thread_time() - begin - (clock.spent - before))
        if terminated or truncated:
            learner.reset()
    learner.close()
    return found, 1e3 * clock.spent / steps


def trial(*, world: str, steps: int, seed: int) -> dict[str, float]:
    """Milliseconds of a step: the median of the last quarter, mean, 99th percentile, longest; and the env's own."""
    learner, own = step_times(world, steps, seed=seed)
    return {
        "late": float(np.median(learner[-(len(learner) // 4 or 1) :])),
        "mean": float(learner.mean()),
        "p99": float(np.percentile(learner, 99)),
        "longest": float(learner.max()),
        "env": own,
    }
