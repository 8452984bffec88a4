"""Two tanks joined by a pipe: a Dict observation is one object per key, and what flows is learned.

Run: python examples/view_dict.py --steps 300
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from relgym.wrappers import ModelLearner


class Tanks(gym.Env[Any, Any]):
    """A tenth of the difference flows from tank to tank, the inlet fills the upper one, the lower one leaks 5 %."""

    def __init__(self) -> None:
        level = spaces.Box(0.0, 100.0, (1,), np.float64)
        self.observation_space = spaces.Dict({"upper": level, "lower": level})
        self.action_space = spaces.Box(0.0, 2.0, (1,), np.float64)
        self.upper = self.lower = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Two random levels."""
        super().reset(seed=seed)
        self.upper, self.lower = self.np_random.uniform(0.0, 50.0, 2)
        return self._levels(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Let it flow; the reward asks for a level of 20 in the lower tank."""
        flow = 0.1 * (self.upper - self.lower)
        self.upper, self.lower = self.upper - flow + float(action[0]), 0.95 * self.lower + flow
        return self._levels(), self.lower - 20.0, False, False, {}

    def _levels(self) -> dict[str, Any]:
        return {"upper": np.array([self.upper]), "lower": np.array([self.lower])}


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    steps: int = 300
    """transitions to learn from"""
    seed: int = 0
    """seed of episodes and actions"""


def main(args: Args) -> None:
    """Learn the tanks and their reward, and print all laws."""
    env = ModelLearner(Tanks(), learn_reward=True)
    env.action_space.seed(args.seed)
    for k in range(args.steps):
        if k % 20 == 0:
            env.reset(seed=args.seed + k)
        env.step(env.action_space.sample())
    for target in env.model.targets:
        for mode in env.model.modes(target.type, target.property):
            print(f"{target}: {mode.formula(4)}")
    print(f"wrong in all: {sum(env.prequential.wrong.values())} of {3 * args.steps} predictions")


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
