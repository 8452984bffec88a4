"""Can a car that is too weak for its hill be driven up by the law that 1,000 random steps teach? Nothing is trained.

Run: python examples/plan_mountain_car.py --steps 1000 --episodes 10
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from relgym.planning import ModelSimulator, Planner, TreeSearch
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


class Uphill:
    """The task of MountainCar-v0 as functions of arrays: -1 a step, until the flag at 0.5 is reached.

    It is given, for random steps never see the flag.
    """

    def rewards(
        self, layout: SceneLayout, before: NDArray[Any], actions: Any, after: NDArray[Any]
    ) -> NDArray[np.float64]:
        """-1 for every step."""
        return np.full(len(after), -1.0)

    def terminations(
        self, layout: SceneLayout, before: NDArray[Any], actions: Any, after: NDArray[Any]
    ) -> NDArray[np.bool_]:
        """At the flag."""
        place = layout.column(0, "x0")
        return np.asarray(after[:, place] >= 0.5, dtype=np.bool_)

    def reward(self, before: Any, action: Any, after: Any) -> float:
        """Of one step."""
        return -1.0

    def terminated(self, before: Any, action: Any, after: Any) -> bool:
        """At the flag."""
        return bool(self.terminations(before.layout, before.vector[None], None, after.vector[None])[0])


def main(args: Args) -> None:
    """Learn, print the law, plan."""
    env = ModelLearner(gym.make("MountainCar-v0"), config={"features": ("trig",)})
    env.action_space.seed(args.seed)
    env.reset(seed=args.seed)
    for _ in range(args.steps):
        *_, truncated, _ = env.step(env.action_space.sample())
        if truncated:
            env.reset()
    print(env.model.describe())
    real = gym.make("MountainCar-v0")
    simulator = ModelSimulator(env.model, real, view=env.view, task=Uphill())
    # The way up leads back down first, again and again: a tree spreads over places and speeds.
    search = TreeSearch(horizon=200, expansions=2048, batch=256, hold=32, patience=1)
    planner = Planner(simulator, search, tolerance=1e-4)
    up = 0
    for k in range(args.episodes):
        seen, _ = real.reset(seed=10_000 + k)
        state, over, terminated = None, False, False
        while not over:
            action, state = planner.predict(seen, state)
            seen, _, terminated, truncated, _ = real.step(action)
            over = terminated or truncated
        up += terminated
        print(
            f"episode {k}: {state[0].decisions} steps, {state[0].searches} searches, at the flag: {terminated}"
        )
    print(f"{up} of {args.episodes} reach the flag")


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
