"""How long does a learned model stay true when it feeds on its own predictions? Dream beside the real env.

Run: python examples/live_in_a_dream.py --episodes 24
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields

import gymnasium as gym
import numpy as np

import relgym


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    episodes: int = 24
    """episodes of 40 steps to learn from"""
    trials: int = 5
    """episodes to dream"""
    seed: int = 0
    """seed of scenes and actions"""


def main(args: Args) -> None:
    """Learn truck-push with random pushes, then push real and dreamed trucks alike."""
    env = relgym.wrappers.ModelLearner(gym.make("relgym/TruckPush-v0", n_boxes=2, resample="step"))
    env.action_space.seed(args.seed)
    for episode in range(args.episodes):
        env.reset(seed=args.seed + episode)
        truncated = False
        while not truncated:
            _, _, _, truncated, _ = env.step(np.clip(env.action_space.sample(), 0.2, 1.0))
    model = env.get_wrapper_attr("model")
    for mode in model.modes("truck", "vx"):
        print(mode.examples, mode.formula())

    real = gym.make("relgym/TruckPush-v0", n_boxes=2, task=None)
    dream = relgym.envs.LearnedModelEnv(model, like=real)
    rng = np.random.default_rng(args.seed)
    for trial in range(args.trials):
        real.reset(seed=10_000 + trial)
        dream.reset(options={"scene": real.get_wrapper_attr("scene")})
        furthest, reason = 0.0, "the episode's end"
        for _ in range(40):
            push = rng.uniform(0.2, 1.0, 1).astype(np.float32)
            seen = real.step(push)[0]
            imagined, _, _, truncated, info = dream.step(push)
            if truncated:
                reason = info["reason"]
                break
            furthest = max(furthest, abs(float(seen["truck"][0] - imagined["truck"][0])))
        print(f"trial {trial}: the trucks were never more than {furthest:.0e} apart, until {reason}")


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
