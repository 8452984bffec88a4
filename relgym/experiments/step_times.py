"""What a step of learning costs in worlds of relgym's own and of others: median, mean and worst step.

``python -m relgym.experiments.step_times Reacher-v5 --steps 2000 --seeds 0 1``. The time is that of the process, the
env's own step taken off; the env's own is told beside it, measured in the same run. MuJoCo's worlds need the extra
``bench-envs``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import gymnasium as gym
import numpy as np

import relgym  # noqa: F401 - registers the envs
from relgym.wrappers import ModelLearner

__all__ = ["HOME", "STRANGERS", "StepTimes", "main", "step_times"]

STRANGERS: Final = (
    "InvertedPendulum-v5",
    "Reacher-v5",
    "HalfCheetah-v5",
    "Ant-v5",
    "BipedalWalker-v3",
    "LunarLander-v3",
)
"""Worlds that the learner wasn't made for."""

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

    def __str__(self) -> str:
        late = self.learner[-len(self.learner) // 4 :]
        numbers = (
            float(np.median(late)),
            float(self.learner.mean()),
            float(np.percentile(self.learner, 99)),
            float(self.learner.max()),
            self.env,
            self.coverage,
            self.nrmse,
        )
        return f"{self.env_id:<22} {self.seed:>4}" + "".join(f" {number:>10.3g}" for number in numbers)


HEAD: Final = f"{'world':<22} {'seed':>4}" + "".join(
    f" {name:>10}" for name in ("late", "mean", "p99", "worst", "env", "coverage", "nrmse")
)


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


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each world and seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=[*HOME, *STRANGERS])
    parser.add_argument("--steps", type=int, default=2_000)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    given = parser.parse_args(arguments)
    print(HEAD, flush=True)
    for env_id in given.worlds:
        for seed in given.seeds:
            print(step_times(env_id, given.steps, seed=seed), flush=True)


if __name__ == "__main__":
    main()
