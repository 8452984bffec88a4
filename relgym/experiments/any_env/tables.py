"""Traffic and Pong through tables (`relgym benchmark any-env pong highway --recordings FOLDER`).

The envs' pins clash with ours, so they are recorded in environments of their own (``examples/adapters``, option
``--record FOLDER``, for every seed) and learned from here, where what they are compared with can be installed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

from relgym.config import ModelConfig
from relgym.experiments.any_env.data import recommended, size
from relgym.experiments.any_env.pong import pong
from relgym.experiments.any_env.recorded import Rows, live, stream
from relgym.experiments.criterion import Figure
from relgym.experiments.recording import Recording
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Target

__all__ = ["RECORDED", "highway"]

LIMITS: Final = {"car": 0.07, "ego": 0.15}
"""Largest nRMSE-d of x."""

STEP: Final = 0.2
"""Seconds between two decisions: the weight of vx."""


def highway(folder: Path, seeds: Sequence[int], *, batch: bool = True) -> Iterator[Figure]:
    """Where cars will be; and the stream as it comes, beside other learners.

    Steps that end an episode are crashes, which push the cars apart; they are counted apart, and in the stream too.
    """
    targets = [Target(name, "x") for name in LIMITS]
    for number, seed in enumerate(seeds):
        lesson, fresh = (Recording.load(folder / f"highway{k}-{seed}.npz") for k in ("", "-test"))
        model, rows = _advised(lesson, targets, verbose=not number)
        _, tested = live(fresh, (), model=model, learn=False)
        for name, limit in LIMITS.items():
            columns = tested[name].columns()
            ended = columns["ended"].astype(bool)
            for what, keep in (("the episode goes on", ~ended), ("all steps", ended | True)):
                error = size(columns["said"] - columns["change"], columns["change"], keep)
                yield f"{name}.x, {what}", limit, float(error[0]), "<="
            if name == "car":
                yield f"{name}: {STEP} vx, off by", 0.01, _off(model, name), "<="
            yield from stream(name, rows[name], verbose=not number, batch=batch)


def _advised(
    lesson: Recording, targets: Sequence[Target], *, verbose: bool
) -> tuple[WorldModel, dict[str, Rows]]:
    """A model with the features that it recommends, starting from the default, and what it said of the stream."""
    model, rows = live(lesson, targets)
    tried: list[tuple[str, ...]] = [()]
    while (features := recommended(model)) and features not in tried:
        if verbose:
            print(
                f"with {tried[-1] or 'the default'}:",
                *(f"{a.target}: {a}" for a in model.advice()),
                "",
                sep="\n",
            )
        tried.append(features)
        model, rows = live(lesson, targets, ModelConfig(features=features))
    if verbose:
        print(
            f"{len(lesson):,} steps, with {tried[-1] or 'the default'}:",
            model.describe(digits=4),
            "",
            sep="\n",
        )
    return model, rows


def _off(model: WorldModel, name: str) -> float:
    """By what share the weight of vx is off in what predicts x."""
    part = model.property_model(name, "x")
    best = max(part.modes, key=lambda m: m.examples, default=None)
    mode = part.fallback.guess.mode if part.fallback.guess is not None else best
    weight = 0.0 if mode is None else dict(mode.roles[0].terms).get("vx", 0.0)
    return abs(weight / STEP - 1.0)


RECORDED: Final[dict[str, Callable[..., Iterator[Figure]]]] = {"highway": highway, "pong": pong}
"""By name; from a folder of recordings, and of training seeds."""
