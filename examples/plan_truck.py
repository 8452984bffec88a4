"""Can an agent find out in 300 real steps what its world and its task are like? It plans; nothing is trained.

Run: python examples/plan_truck.py --steps 300 --episodes 20
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields

import gymnasium as gym

from relgym.planning import PlanningAgent, TreeSearch


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    steps: int = 300
    """real steps to explore and learn in"""
    random_steps: int = 100
    """at random at first"""
    episodes: int = 20
    """episodes to plan"""
    seed: int = 0
    """seed of everything random"""


def main(args: Args) -> None:
    """Explore, print what was learned, plan."""
    search = TreeSearch(horizon=20, batch=512)
    agent = PlanningAgent(
        gym.make("relgym/TruckPush-v0"), search=search, random_steps=args.random_steps, seed=args.seed
    )
    agent.learn(args.steps)
    print(agent.model.describe())
    print(agent.trainer.reward_model.model.describe())  # nobody told it what is paid
    env = gym.make("relgym/TruckPush-v0")
    solved = 0
    for k in range(args.episodes):
        seen, info = env.reset(seed=10_000 + k)
        state, over = None, False
        while not over:
            action, state = agent.predict(seen, state)
            seen, _, terminated, truncated, info = env.step(action)
            over = terminated or truncated
        solved += info["is_success"]
        ahead = seen["goal"][0]
        print(f"episode {k}: stops {ahead:6.2f} from the goal after {state[0].searches} searches")
    print(f"{solved} of {args.episodes} episodes end on the goal after {args.steps} real steps")


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
