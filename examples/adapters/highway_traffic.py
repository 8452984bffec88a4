"""Traffic of highway-env as a table of cars, re-sorted at every step: what moves how, and how well it is foreseen.

Run: make example-highway
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import gymnasium as gym
import highway_env  # noqa: F401 - registers the envs
import numpy as np

from relgym.experiments.recording import record
from relgym.wrappers import ModelLearner, Rows, TableView

COLUMNS = ("presence", "x", "y", "vx", "vy", "heading")
ACTIONS = ("lane_left", "idle", "lane_right", "faster", "slower")
CARS = 6
"""Rows of the table: the agent's own car, and the five nearest."""


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    steps: int = 3000
    """transitions to learn from"""
    test: int = 500
    """transitions of fresh episodes to test on"""
    seed: int = 0
    """seed of episodes and actions; tests begin 10,000 later"""
    features: str = "products"
    """what to switch on beside properties, as the default configuration advises; nothing: the default"""
    record: str = ""
    """a folder: only write what happens to files there, for `relgym benchmark any-env --recordings`"""


def highway() -> gym.Env[Any, Any]:
    """Five decisions a second; positions in metres, of the road and not of the car."""
    table = {
        "type": "Kinematics",
        "vehicles_count": CARS,
        "features": list(COLUMNS),
        "absolute": True,
        "normalize": False,
        "clip": False,
    }
    return gym.make(
        "highway-fast-v0",
        config={"observation": table, "policy_frequency": 5, "simulation_frequency": 15, "duration": 40},
    )


def view_of(env: gym.Env[Any, Any]) -> TableView:
    """The first row is the agent's own car, the others are whoever is near: matched by where they should be.

    What a driver is about to do shows in how speeds and heading have just changed.
    """
    return TableView(
        env.observation_space,
        env.action_space,
        columns=COLUMNS,
        rows=[Rows("ego"), Rows("car", CARS - 1)],
        presence="presence",
        match={"x": 4.0, "y": 2.0, "vx": 5.0},
        changes=("vx", "vy", "heading"),
        actions=ACTIONS,
    )


def learner_of(env: gym.Env[Any, Any], features: str) -> ModelLearner:
    """Two targets: where the agent's own car and the others will be."""
    config = {"features": tuple(features.split(",")) if features else ()}
    return ModelLearner(env, view=view_of(env), targets=["ego.x", "car.x"], config=config)


def live(env: ModelLearner, steps: int, seed: int) -> dict[str, tuple[list[float], list[float]]]:
    """Random actions; per target the errors of all predictions and the changes that came."""
    said: dict[str, tuple[list[float], list[float]]] = {str(t): ([], []) for t in env.model.targets}
    env.action_space.seed(seed)
    env.reset(seed=seed)
    for _ in range(steps):
        before = env.scene
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        report = info["relgym"]
        for (name, prop), residual in report.residuals.items():
            kind = env.view.schema.type_of(name).name
            errors, changes = said[f"{kind}.{prop}"]
            errors.append(residual)
            changes.append(env.scene[name][prop] - before[name][prop])
        if terminated or truncated:
            env.reset()
    return said


def write(folder: Path, args: Args) -> None:
    """Record as many steps under random actions as are learned from and tested on."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, steps, seed in (("", args.steps, args.seed), ("-test", args.test, args.seed + 10_000)):
        env = highway()
        found = record(env, view_of(env), lambda _, rng: int(rng.integers(len(ACTIONS))), steps, seed)
        found.save(folder / f"highway{name}-{args.seed}.npz")


def main(args: Args) -> None:
    """Learn, print the laws, then test on fresh episodes without learning."""
    if args.record:
        return write(Path(args.record), args)
    env = learner_of(highway(), args.features)
    live(env, args.steps, args.seed)
    for target in env.model.targets:
        for mode in env.model.modes(target.type, target.property):
            print(f"{target}: {mode.formula(4)}   ({mode.examples} transitions)")
        if guess := env.model.property_model(target.type, target.property).guess:
            print(f"{target}: {guess.text(4)}")
    for advice in env.model.advice():
        print(f"{advice.target}: {advice}")
    env.pause()
    said = live(env, args.test, args.seed + 10_000)
    for target, (errors, changes) in said.items():
        print(
            f"{target}: one-step error {np.sqrt(np.mean(np.square(errors))) / np.std(changes):.3f} of the change's"
        )


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
