"""How few real steps does an agent need that dreams in what it has learned? Push a truck to its goal, and stop.

Needs the extra sb3. Run: python examples/dyna_truck.py --steps 1000
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym
import numpy as np

import relgym
from relgym.wrappers.flat import FlatView
from relgym.wrappers.sb3 import Dyna, DynaConfig, TransitionRecorder, replay_options


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    steps: int = 1000
    """real steps"""
    warm_up: int = 250
    """of them random, at first"""
    updates: int = 40
    """gradient steps per real step, once the model is accepted"""
    catch_up: int = 10_000
    """gradient steps at once, when the model is first accepted"""
    episodes: int = 50
    """test episodes"""
    seed: int = 0
    """seed of everything random"""


def make_env() -> gym.Env[Any, Any]:
    """The recorder sees scenes; the agent sees short vectors."""
    return FlatView(TransitionRecorder(gym.make("relgym/TruckPush-v0")))


def main(args: Args) -> None:
    """Train SAC with Dyna, test it, and lay a dreamed episode beside the real one."""
    import torch
    from stable_baselines3 import SAC
    from stable_baselines3.common.logger import Logger

    torch.set_num_threads(1)  # nets this small lose by more
    env = make_env()
    env.action_space.seed(args.seed)
    model = relgym.WorldModel(env.get_wrapper_attr("schema"))
    dyna = Dyna(model, DynaConfig(updates=args.updates, catch_up=args.catch_up, seed=args.seed))
    agent = SAC(
        "MlpPolicy",
        env,
        learning_rate=1e-3,
        tau=0.01,
        learning_starts=args.warm_up,
        policy_kwargs={"net_arch": [64, 64]},
        seed=args.seed,
        device="cpu",
        **replay_options(env.observation_space),
    )
    agent.set_logger(Logger(None, []))  # nothing is logged, and no folder left behind
    agent.learn(args.steps, callback=dyna)
    acceptance = dyna.trainer.acceptance
    print(
        f"prequential error {acceptance.error:.3f}, accepted: {acceptance.accepted}, "
        f"imagined: {dyna.imagined:,} transitions"
    )

    tests = make_env()
    good = sum(play(agent, tests, seed=10_000 + k) for k in range(args.episodes))
    print(f"{good} of {args.episodes} test episodes end on the goal after {args.steps:,} real steps")
    side_by_side(agent, model, tests)
    print(model.describe())


def play(agent: Any, env: gym.Env[Any, Any], *, seed: int) -> bool:
    """One real episode; whether it ends well."""
    seen, _ = env.reset(seed=seed)
    while True:
        seen, _, terminated, truncated, info = env.step(agent.predict(seen, deterministic=True)[0])
        if terminated or truncated:
            return bool(info["is_success"])


def side_by_side(agent: Any, model: relgym.WorldModel, env: gym.Env[Any, Any]) -> None:
    """The agent's real episode, and the same actions dreamed from its first scene alone."""
    seen, _ = env.reset(seed=10_000)
    dream = relgym.envs.LearnedModelEnv(model, like=env.unwrapped)
    dream.reset(options={"scene": env.get_wrapper_attr("scene")})
    print("\ndistance to the goal\n  real   dreamed")
    over = lost = False
    while not (over or lost):
        action, _ = agent.predict(seen, deterministic=True)
        seen, _, terminated, truncated, _ = env.step(action)
        imagined, _, _, lost, _ = dream.step(np.asarray(action))
        real = env.get_wrapper_attr("scene")["goal"]["ahead"]
        print(f"{real:7.3f}  {float(imagined['goal'][0]):7.3f}")
        over = terminated or truncated
    print()


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
