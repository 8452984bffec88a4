"""Pong as OCAtari's object list: ball, paddles and walls as bodies, and the laws by which the ball turns.

Run: make example-ocatari
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from ocatari.core import OCAtari

from relgym.experiments.recording import record
from relgym.scene.shapes import Box
from relgym.wrappers import ModelLearner, Rows, Static, TableView

KINDS = ("Player", "Ball", "Enemy")
COLUMNS = ("here", "x", "y", "w", "h", "dx", "dy")
HEIGHT, TOP, BOTTOM = 210.0, 31.0, 196.0
"""The picture's height, and the rows at which the ball touches the walls, counted from above."""


@dataclass(frozen=True)
class Args:
    """Settings; each is a command-line option."""

    steps: int = 16000
    """transitions to learn from, frameskip 1"""
    test: int = 8000
    """transitions of fresh games to record for testing"""
    seed: int = 0
    """seed of episodes and actions; games to test on begin 10,000 later"""
    record: str = ""
    """a folder: only write what happens to files there, for `relgym benchmark any-env --recordings`"""


class PongTable(gym.Env[Any, Any]):
    """OCAtari's Pong: one row per kind of object, centres and sizes in pixels, y upwards, last displacements.

    OCAtari 2.2 returns truncated before terminated; here they come in Gymnasium's order.
    """

    def __init__(self) -> None:
        self._game = OCAtari(
            "ALE/Pong-v5",
            mode="ram",
            hud=False,
            obs_mode="obj",
            frameskip=1,
            repeat_action_probability=0.0,
            create_buffer_stacks=[],
        )
        self.observation_space = spaces.Box(-300.0, 300.0, (len(KINDS), len(COLUMNS)), np.float64)
        self.action_space = self._game.action_space
        self._places: dict[str, tuple[float, float]] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """A new game."""
        super().reset(seed=seed)
        self._game.reset(seed=seed)
        self._places = {}
        return self._table(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One frame."""
        _, reward, truncated, terminated, _ = self._game.step(action)
        return self._table(), float(reward), bool(terminated), bool(truncated), {}

    def _table(self) -> Any:
        table = np.zeros(self.observation_space.shape or ())
        places: dict[str, tuple[float, float]] = {}
        for thing in self._game.objects:
            kind = type(thing).__name__
            if kind not in KINDS:
                continue
            (x, y), (w, h) = thing.xy, thing.wh
            places[kind] = (x + w / 2, HEIGHT - y - h / 2)
            # Without a last place there is no displacement; the object is shown from its second frame on.
            if kind in self._places:
                moved = np.subtract(places[kind], self._places[kind])
                table[KINDS.index(kind)] = 1.0, *places[kind], w, h, *moved
        self._places = places
        return table


def view_of(env: PongTable) -> TableView:
    """Rows are bodies; the walls, which the list doesn't show, are added."""
    body: dict[str, Any] = {
        "shape": Box(),
        "pose": {"px": "x", "py": "y", "sx": "w", "sy": "h"},
        "velocity": ("dx", "dy", None),
    }
    walls = [
        Static(name, {"px": 80.0, "py": HEIGHT - y, "sx": 400.0, "sy": 20.0}, type="wall", shape=Box())
        for name, y in (("ceiling", TOP - 10.0), ("floor", BOTTOM + 10.0))
    ]
    return TableView(
        env.observation_space,
        env.action_space,
        columns=COLUMNS,
        rows=[Rows(kind.lower(), type="ball" if kind == "Ball" else "paddle", **body) for kind in KINDS],
        presence="here",
        static=walls,
        offsets=True,  # a paddle turns the ball by where it is hit
    )


def learner_of(env: PongTable) -> ModelLearner:
    """Predicted are the ball's displacements per frame."""
    return ModelLearner(env, view=view_of(env), targets=["ball.dx", "ball.dy"])


def tracking(table: Any, rng: np.random.Generator) -> int:
    """Follow the ball, with 15 % random actions: 2 is up, 3 is down."""
    player, ball = table[0], table[1]
    if rng.random() < 0.15 or not (player[0] and ball[0]):
        return int(rng.integers(6))
    return 2 if ball[2] > player[2] else 3


def kind_of(before: Any, after: Any) -> str:
    """What happened to the ball, by its displacements; evaluated after the fact, for the table of errors only."""
    if before["dx"] * after["dx"] < 0:
        return "paddle"
    if before["dy"] * after["dy"] < 0:
        return "wall"
    return "flight" if (before["dx"], before["dy"]) == (after["dx"], after["dy"]) else "other change"


def write(folder: Path, args: Args) -> None:
    """Record as many steps of the tracking policy as are learned from and tested on."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, steps, seed in (("", args.steps, args.seed), ("-test", args.test, args.seed + 10_000)):
        env = PongTable()
        record(env, view_of(env), tracking, steps, seed).save(folder / f"pong{name}-{args.seed}.npz")


def main(args: Args) -> None:
    """Learn while playing; print how often predictions were exact, by what happened, and the laws."""
    if args.record:
        return write(Path(args.record), args)
    env = learner_of(PongTable())
    rng = np.random.default_rng(args.seed)
    seen: Counter[str] = Counter()
    right: Counter[str] = Counter()
    table, _ = env.reset(seed=args.seed)
    for step in range(args.steps):
        before = env.scene
        table, _, terminated, truncated, info = env.step(tracking(table, rng))
        if "ball" in before and "ball" in env.scene and step >= args.steps // 2:
            kind = kind_of(before["ball"], env.scene["ball"])
            seen[kind] += 1
            right[kind] += not info["relgym"].wrong
        if terminated or truncated:
            table, _ = env.reset()
    env.model.finish()
    print(env.model.describe(digits=4))
    print("second half, predicted before it was learned:")
    for kind, count in seen.most_common():
        print(f"  {kind}: {right[kind] / count:.1%} of {count} exact")


def parse() -> Args:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    for f in fields(Args):
        parser.add_argument(f"--{f.name}", type=type(f.default), default=f.default)
    return Args(**vars(parser.parse_args()))


if __name__ == "__main__":
    main(parse())
