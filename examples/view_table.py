"""A table whose rows are sorted anew at every step: pucks between two walls, with bodies, so that contacts count.

Run: python examples/view_table.py --steps 600
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from relgym.scene.shapes import Box, Sphere
from relgym.wrappers import ModelLearner, Rows, Static, TableView

WALL = 10.5
"""Where the walls' centres are; they are 1 thick, pucks have a diameter of 1."""


class Pucks(gym.Env[Any, Any]):
    """Two pucks on lanes of their own; one that touches a wall turns back. Rows (x, y, vx), the faster one first."""

    def __init__(self) -> None:
        self.observation_space = spaces.Box(-100.0, 100.0, (2, 3), np.float64)
        self.action_space = spaces.Discrete(1)
        self.pucks = np.zeros((2, 3))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Random places and velocities."""
        super().reset(seed=seed)
        x, v = self.np_random.uniform(-8.0, 8.0, 2), self.np_random.uniform(-0.9, 0.9, 2)
        self.pucks = np.column_stack([x, [-3.0, 3.0], v])
        return self._table(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Turn round what touches a wall and moves towards it, then move."""
        x, v = self.pucks[:, 0], self.pucks[:, 2]
        self.pucks[:, 2] = np.where((np.abs(x) >= WALL - 1.0) & (x * v > 0.0), -v, v) * 0.99
        self.pucks[:, 0] += self.pucks[:, 2]
        return self._table(), 0.0, False, False, {}

    def _table(self) -> Any:
        return self.pucks[np.argsort(-np.abs(self.pucks[:, 2]))].copy()


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    steps: int = 600
    """transitions to learn from"""
    seed: int = 0
    """seed of episodes"""


def main(args: Args) -> None:
    """Say what rows and columns are, add the walls that the table doesn't show, learn, print the laws."""
    env = Pucks()
    puck = Rows(
        "puck",
        2,
        shape=Sphere(),
        pose={"px": "x", "py": "y"},
        velocity=("vx", None, None),
        constants={"sx": 1.0, "sy": 1.0, "sz": 1.0},
    )
    walls = [
        Static(side, {"px": x, "sx": 1.0, "sy": 20.0}, type="wall", shape=Box())
        for side, x in (("left", -WALL), ("right", WALL))
    ]
    view = TableView(
        env.observation_space,
        env.action_space,
        columns=("x", "y", "vx"),
        rows=[puck],
        match={"x": 3.0, "y": 1.0},
        static=walls,
    )
    learner = ModelLearner(env, view=view, targets=["puck.vx"], config={"frames": "world"})
    for k in range(args.steps):
        if k % 60 == 0:
            learner.reset(seed=args.seed + k)
        learner.step(0)
    learner.model.finish()
    print(learner.model.describe(digits=4))


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
