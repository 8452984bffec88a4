"""Does dreaming pay where things bounce? Fly a ball with weak thrusters from place to place, and stay there.

The ball acts once in five steps: the laws that the model learns are those of single steps. Needs the extra sb3.
Run: python examples/dyna_ball.py --decisions 3000
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym

import relgym
from relgym.wrappers.action_repeat import ActionRepeat
from relgym.wrappers.flat import FlatView
from relgym.wrappers.sb3 import Dyna, DynaConfig, TransitionRecorder, replay_options
from relgym.wrappers.truncated_episodes import TruncatedEpisodes


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    decisions: int = 3000
    """real decisions, of five steps each"""
    warm_up: int = 250
    """of them random, at first"""
    updates: int = 40
    """gradient steps per decision, once the model is accepted"""
    episodes: int = 20
    """test episodes"""
    seed: int = 0
    """seed of everything random"""


def make_env(*, short: bool = False) -> gym.Env[Any, Any]:
    """Scenes for the model, decisions and short vectors for the agent."""
    env: gym.Env[Any, Any] = gym.make("relgym/BallGoal-v0")
    if short:  # four episodes of five last 10 decisions: what follows can be dreamed, other rooms can't
        env = TruncatedEpisodes(env, 50)
    return FlatView(ActionRepeat(TransitionRecorder(env), 5))


def main(args: Args) -> None:
    """Train SAC with Dyna, test it, and print the laws it dreamed by."""
    from stable_baselines3 import SAC
    from stable_baselines3.common.logger import Logger

    env = make_env(short=True)
    env.action_space.seed(args.seed)
    model = relgym.WorldModel(env.get_wrapper_attr("schema"))
    # Episodes are long: dreams branch off anywhere and look some decisions ahead. Goals and walls stay where they are;
    # but half of the dreams begin with another speed, and so get over what stands in the way.
    config = DynaConfig(
        horizon=30,
        capacity=40_000,
        from_start=0.3,
        perturb_velocity=0.5,
        resample=False,
        permute=False,
        updates=args.updates,
        seed=args.seed,
    )
    dyna = Dyna(model, config)
    agent = SAC(
        "MlpPolicy",
        env,
        learning_rate=1e-3,
        tau=0.01,
        ent_coef="auto_0.01",  # decisions pay a few hundredths: begun at 1, entropy would outweigh them for long
        learning_starts=args.warm_up,
        policy_kwargs={"net_arch": [64, 64]},
        seed=args.seed,
        device="cpu",
        **replay_options(env.observation_space),
    )
    agent.set_logger(Logger(None, []))  # nothing is logged, and no folder left behind
    agent.learn(args.decisions, callback=dyna)
    acceptance = dyna.trainer.acceptance
    print(
        f"prequential error {acceptance.error:.3f}, accepted: {acceptance.accepted}, "
        f"imagined: {dyna.imagined:,} decisions"
    )

    tests = make_env()
    good = sum(play(agent, tests, seed=10_000 + k) for k in range(args.episodes))
    print(f"{good} of {args.episodes} test episodes reach the goal after {args.decisions:,} real decisions\n")
    print(model.describe())


def play(agent: Any, env: gym.Env[Any, Any], *, seed: int) -> bool:
    """One real episode; whether it ends well."""
    seen, _ = env.reset(seed=seed)
    while True:
        seen, _, terminated, truncated, info = env.step(agent.predict(seen, deterministic=True)[0])
        if terminated or truncated:
            return bool(info["is_success"])


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
