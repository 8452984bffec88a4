"""Can an agent swing a pendulum up whose law it has read off 1,000 random steps? It plans; nothing is trained.

Run: python examples/plan_pendulum.py --steps 1000 --episodes 10
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from relgym.planning import CrossEntropy, ModelSimulator, Objective, Planner
from relgym.scene.objects import SceneLayout
from relgym.wrappers import ModelLearner


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    steps: int = 1000
    """random steps to learn from"""
    episodes: int = 10
    """episodes to solve"""
    seed: int = 0
    """seed of everything random"""


class SwingUp:
    """The reward of Pendulum-v1 as a function of arrays: it is quadratic, and relgym learns what is linear."""

    def rewards(
        self, layout: SceneLayout, before: NDArray[Any], actions: Any, after: NDArray[Any]
    ) -> NDArray[np.float64]:
        """Minus the squares of angle, speed and torque, as in the env's source."""
        angle, speed = (before[:, layout.column(0, prop)] for prop in ("angle_x0", "x2"))
        upright = (angle + np.pi) % (2.0 * np.pi) - np.pi
        torque = np.asarray(actions, dtype=np.float64).reshape(len(before))
        total: NDArray[np.float64] = -(upright**2 + 0.1 * speed**2 + 0.001 * torque**2)
        return total

    def terminations(
        self, layout: SceneLayout, before: NDArray[Any], actions: Any, after: NDArray[Any]
    ) -> NDArray[np.bool_]:
        """Never."""
        return np.zeros(len(before), dtype=np.bool_)

    def reward(self, before: Any, action: Any, after: Any) -> float:
        """Of one step."""
        return float(
            self.rewards(before.layout, before.vector[None], np.asarray(action)[None], after.vector[None])[0]
        )

    def terminated(self, before: Any, action: Any, after: Any) -> bool:
        """Never."""
        return False


def main(args: Args) -> None:
    """Learn, print the law, plan."""
    env = ModelLearner(gym.make("Pendulum-v1"), config={"features": ("trig",)})
    env.action_space.seed(args.seed)
    env.reset(seed=args.seed)
    for _ in range(args.steps):
        *_, truncated, _ = env.step(env.action_space.sample())
        if truncated:
            env.reset()
    print(env.model.describe())
    real = gym.make("Pendulum-v1")
    simulator = ModelSimulator(env.model, real, view=env.view, task=SwingUp())
    search = CrossEntropy(horizon=25, candidates=128, rounds=3)
    planner = Planner(simulator, search, Objective(), commit=4, tolerance=1e-4)
    upright = 0
    for k in range(args.episodes):
        seen, _ = real.reset(seed=10_000 + k)
        total, state, over = 0.0, None, False
        while not over:
            action, state = planner.predict(seen, state)
            seen, reward, _, over, _ = real.step(action)
            total += float(reward)
        upright += seen[0] > 0.95
        print(f"episode {k}: return {total:8.1f}, upright at the end: {seen[0] > 0.95}")
    print(f"{upright} of {args.episodes} end upright")


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
