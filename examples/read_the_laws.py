"""Which laws does a small world obey? Watch it, one transition at a time, and print what was learned.

Run: python examples/read_the_laws.py --steps 16000
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields

import gymnasium as gym

import relgym


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    env: str = "relgym/BallBoxRamp-v0"
    """id of an env whose observations are scenes"""
    steps: int = 16_000
    """transitions to watch"""
    seed: int = 0
    """seed of scenes and actions"""
    file: str = ""
    """where to save the model; empty: nowhere"""


def main(args: Args) -> None:
    """Learn online while acting at random, then print the model."""
    env = relgym.wrappers.ModelLearner(gym.make(args.env))
    env.action_space.seed(args.seed)
    env.reset(seed=args.seed)
    for _ in range(args.steps):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    model = env.get_wrapper_attr("model")
    print(model.describe())
    print(f"\nWrong or abstained, before learning from the step:\n{env.prequential}")
    if args.file:
        env.save(args.file)
        print(f"Saved as {args.file}; read it again with: relgym rules {args.file}")


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
