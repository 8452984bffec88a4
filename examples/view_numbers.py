"""CartPole with its four numbers as a cart and a pole: what do their positions obey.

Run: python examples/view_numbers.py --steps 2000
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields

import gymnasium as gym

from relgym.wrappers import ModelLearner, NumbersView, Part


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    steps: int = 2000
    """transitions to learn from"""
    seed: int = 0
    """seed of episodes and actions"""


def main(args: Args) -> None:
    """Name the numbers, give them to objects, learn, and print the laws of positions."""
    env = gym.make("CartPole-v1")
    view = NumbersView(
        env.observation_space,
        env.action_space,
        names=("x", "x_dot", "theta", "theta_dot"),
        parts=[Part("cart", ("x", "x_dot")), Part("pole", ("theta", "theta_dot"))],
        actions=("left", "right"),
    )
    learner = ModelLearner(env, view=view, targets=["cart.x", "pole.theta"])
    learner.action_space.seed(args.seed)
    learner.reset(seed=args.seed)
    for _ in range(args.steps):
        *_, terminated, truncated, _ = learner.step(learner.action_space.sample())
        if terminated or truncated:
            learner.reset()
    print(learner.scene.values())
    for target in learner.model.targets:
        for mode in learner.model.modes(target.type, target.property):
            print(f"{target}: {mode.formula(4)}   ({mode.examples} of {args.steps} transitions)")
    print(f"wrong in the latest steps: {learner.prequential.recent:.1%}")


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
