"""Traffic and Pong through tables, as benchmarks (``python -m relgym.experiments.any_env_tables FOLDER``).

The envs' pins clash with ours, so they are recorded in environments of their own (``examples/adapters``, option
``--record FOLDER``, for every seed) and learned from here, where what they are compared with can be installed.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.experiments.any_env_data import recommended
from relgym.experiments.any_env_pong import pong
from relgym.experiments.any_env_recorded import Rows, live, size, stream
from relgym.experiments.criterion import Measure, measured, report
from relgym.experiments.recording import Recording
from relgym.experiments.seeds import TRAINING_SEEDS, TUNING_SEEDS
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Target

__all__ = ["highway", "main"]

LIMITS: Final = {"car": 0.07, "ego": 0.15}
"""Largest nRMSE-d of x."""

STEP: Final = 0.2
"""Seconds between two decisions: the weight of vx."""

_Columns = dict[str, NDArray[np.float64]]


def highway(folder: Path, seeds: Sequence[int], *, batch: bool = True) -> list[Measure]:
    """Where cars will be; and the stream as it comes, beside other learners.

    Steps that end an episode are crashes, which push the cars apart; they are counted apart, and in the stream too.
    """
    targets = [Target(name, "x") for name in LIMITS]
    found: dict[tuple[str, float], list[float]] = {}
    for number, seed in enumerate(seeds):
        lesson, fresh = (Recording.load(folder / f"highway{k}-{seed}.npz") for k in ("", "-test"))
        model, rows = _advised(lesson, targets, verbose=not number)
        _, tested = live(fresh, (), model=model, learn=False)
        for name, limit in LIMITS.items():
            columns = tested[name].columns()
            ended = columns["ended"].astype(bool)
            for what, keep in (("the episode goes on", ~ended), ("all steps", ended | True)):
                error = float(size(columns["said"], columns["change"], keep)[0])
                found.setdefault((f"{name}.x, {what}", limit), []).append(error)
            if name == "car":
                found.setdefault((f"{name}: {STEP} vx, off by", 0.01), []).append(_off(model, name))
            for what, ratio in stream(name, rows[name], verbose=not number, batch=batch):
                found.setdefault((what, 1.0), []).append(ratio)
    return [measured(what, limit, values) for (what, limit), values in found.items()]


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


BENCHMARKS: Final[dict[str, Callable[..., list[Measure]]]] = {"highway": highway, "pong": pong}
"""By name."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line: a folder of recordings, ``--only NAMES``, ``--seeds N``, ``--tuning`` for the tuning seeds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=list(BENCHMARKS), choices=list(BENCHMARKS))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--online", action="store_true", help="leave out the baselines that are fitted once")
    given = parser.parse_args(arguments)
    seeds = (TUNING_SEEDS if given.tuning else TRAINING_SEEDS)[: given.seeds]
    for name in given.only:
        print(report(name, BENCHMARKS[name](given.folder, seeds, batch=not given.online)), "\n", flush=True)


if __name__ == "__main__":
    main()
