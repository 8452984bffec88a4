"""Taxi observes one number out of 500. A function of ten lines finds the taxi in it, and its moves become laws.

Run: python examples/view_function.py --steps 1500
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym

from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema
from relgym.wrappers import FunctionView, ModelLearner

MOVES = ("south", "north", "east", "west", "pickup", "dropoff")


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    steps: int = 3000
    """transitions to learn from"""
    seed: int = 0
    """seed of episodes and actions"""


def taxi_in(cell: Any, info: Mapping[str, Any]) -> dict[str, Any]:
    """Objects in an observation: Taxi numbers its states by row, column, passenger and destination."""
    rest, destination = divmod(int(cell), 4)
    rest, passenger = divmod(rest, 5)
    row, column = divmod(rest, 5)
    return {"taxi": {"row": row, "column": column, "passenger": passenger}, "goal": {"place": destination}}


def main(args: Args) -> None:
    """Learn how the taxi moves, and print its laws beside those of the bare number."""
    types = ObjectType("taxi", ("row", "column", "passenger")), ObjectType("goal", ("place",))
    schema = SceneSchema(types, (("taxi", "taxi"), ("goal", "goal")))
    env = gym.make("Taxi-v4")
    view = FunctionView(schema, taxi_in, env.action_space, actions=MOVES)
    learner = ModelLearner(env, view=view, targets=["taxi.row", "taxi.column"])
    learner.action_space.seed(args.seed)
    learner.reset(seed=args.seed)
    for _ in range(args.steps):
        *_, terminated, truncated, _ = learner.step(learner.action_space.sample())
        if terminated or truncated:
            learner.reset()
    learner.model.finish()
    for target in learner.model.targets:
        for mode in learner.model.modes(target.type, target.property):
            print(f"{target}: {mode.formula(4)}   ({mode.examples} transitions)")
    print(f"wrong in the latest steps: {learner.prequential.recent:.1%}")


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
