"""Can an agent fly a ball over obstacles by laws that it has just found out? It plans; nothing is trained.

Run: python examples/plan_ball.py --decisions 200 --episodes 10
     python examples/plan_ball.py --decisions 600 --task learned
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields

import gymnasium as gym

from relgym.planning import PlanningAgent, TreeSearch
from relgym.wrappers import ActionRepeat

REPEAT = 5
"""Env steps that a decision lasts."""


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    decisions: int = 200
    """real decisions to explore and learn in"""
    task: str = "given"
    """whether reward and end are given or learned"""
    episodes: int = 10
    """episodes to plan"""
    expansions: int = 8192
    """branches of a search tree"""
    seed: int = 0
    """seed of everything random"""


def main(args: Args) -> None:
    """Explore, print what was learned, plan."""
    # The way round an obstacle pays less at first: a tree goes there, too.
    search = TreeSearch(horizon=100, batch=256, expansions=args.expansions)
    agent = PlanningAgent(
        gym.make("relgym/BallGoal-v0"),
        task=args.task,
        search=search,
        repeat=REPEAT,
        commit=10,
        seed=args.seed,
    )
    agent.learn(args.decisions * REPEAT)
    print(agent.model.describe())
    if args.task == "learned":
        print(agent.trainer.reward_model.model.describe())
    env = ActionRepeat(gym.make("relgym/BallGoal-v0"), REPEAT)
    solved = 0
    for k in range(args.episodes):
        seen, info = env.reset(seed=10_000 + k)
        state, over = None, False
        while not over:
            action, state = agent.predict(seen, state)
            seen, _, terminated, truncated, info = env.step(action)
            over = terminated or truncated
        solved += info["is_success"]
        print(
            f"episode {k}: {state[0].decisions} decisions, {state[0].searches} searches, {info['is_success']}"
        )
    print(f"{solved} of {args.episodes} balls stay at the goal after {args.decisions} real decisions")


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
