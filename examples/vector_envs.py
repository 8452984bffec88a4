"""Does one model learn faster from eight envs than from one? At equal numbers of transitions: it sees more.

Run: python examples/vector_envs.py --transitions 4000
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields

import gymnasium as gym

from relgym.wrappers import VectorModelLearner


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    transitions: int = 4000
    """transitions to learn from, in all"""
    seed: int = 0
    """seed of episodes and actions"""


def learned(envs: int, args: Args) -> VectorModelLearner:
    """A learner round so many BallBoxRamp envs, after random steps."""
    learner = VectorModelLearner(gym.make_vec("relgym/BallBoxRamp-v0", envs, incline=30))
    learner.action_space.seed(args.seed)
    learner.reset(seed=args.seed)
    while learner.model.seen < args.transitions:
        learner.step(learner.action_space.sample())
    return learner


def main(args: Args) -> None:
    """Learn with 1 and with 8 envs; print how often either was wrong, and what the eight taught."""
    for envs in (1, 8):
        learner = learned(envs, args)
        wrong = sum(learner.prequential.wrong.values())
        lately = learner.prequential.recent
        print(f"{envs} envs: {wrong} wrong predictions on the way, {lately:.1%} of the latest steps")
    print(learner.model.describe(digits=4))


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
