"""Benchmarks of time and memory: steps of learning, sizes of worlds, roll-outs (`relgym benchmark speed`).

Results are kept as all others are, and were measured on the machine that kept them: ``--again`` measures anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from relgym.errors import ConfigError
from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.criterion import measured
from relgym.experiments.dyna.speed import WORLDS
from relgym.experiments.seeds import TRAINING_SEEDS
from relgym.experiments.speed import sizes as sizes
from relgym.experiments.speed import steps as step_times
from relgym.experiments.strangers.suite import NAMED
from relgym.model.reports.text import Cell, table

__all__ = ["SUITE"]

_MEAN: Final[Mapping[str, float]] = {"bodies-1000": 2.0, "properties-400": 25.0}
"""Milliseconds that a step may take in the mean, by world."""

_MEMORY: Final[Mapping[str, float]] = {"bodies-1000": 300.0}
"""MB that a process may hold, by world."""

_LONGEST: Final = 40.0
"""Milliseconds that a step of other people's worlds may take at most; of `_WIDE` ones `_LONGEST_WIDE`."""

_LONGEST_WIDE: Final = 100.0
_USUAL: Final = 5.0
"""Milliseconds that it may take in the mean; of `_WIDE` worlds `_USUAL_WIDE`."""

_USUAL_WIDE: Final = 25.0
_WIDE: Final = ("Ant-v5",)


def _chosen(extent: Extent, worlds: Sequence[str]) -> Sequence[str]:
    """Those worlds of a benchmark that are asked for."""
    return [world for world in worlds if not extent["worlds"] or world in extent["worlds"]]


def _sizes(extent: Extent, known: Known) -> Shown:
    asked = [{"world": world} for world in _chosen(extent, list(sizes.WORLDS))]
    pairs = [(one["world"], cost) for one, cost in known.pairs("relgym.experiments.speed.sizes:trial", asked)]
    measures = [
        measured(f"{world}: {what}", limits[world], [cost[key]])
        for world, cost in pairs
        for what, key, limits in (("ms a step", "mean", _MEAN), ("MB", "memory", _MEMORY))
        if world in limits
    ]
    rows: list[list[Cell]] = [
        [
            world,
            cost["steps"],
            f"{cost['mean']:.2f}",
            f"{cost['worst']:.1f}",
            f"{cost['memory']:.0f}",
            cost["refused"],
        ]
        for world, cost in pairs
    ]
    return Shown(measures, [table(["world", "steps", "ms a step", "longest", "MB", ""], rows)])


def _steps(extent: Extent, known: Known) -> Shown:
    worlds = extent["worlds"] or [*step_times.HOME, *NAMED]
    asked = [
        {"world": world, "steps": extent["steps"], "seed": seed}
        for world in worlds
        for seed in extent.first(TRAINING_SEEDS)
    ]
    pairs = known.pairs("relgym.experiments.speed.steps:trial", asked)
    measures = []
    for world in worlds:
        own = [times for one, times in pairs if one["world"] == world]
        if not own or world in step_times.HOME:
            continue
        usual, longest = (_USUAL_WIDE, _LONGEST_WIDE) if world in _WIDE else (_USUAL, _LONGEST)
        measures.append(measured(f"{world}: ms a step", usual, [times["mean"] for times in own]))
        measures.append(measured(f"{world}: ms of the longest", longest, [times["longest"] for times in own]))
    heads = ("late", "mean", "p99", "longest", "env")
    rows: list[list[Cell]] = [
        [one["world"], one["seed"], *(f"{times[name]:.3g}" for name in heads)] for one, times in pairs
    ]
    return Shown(measures, [table(["world", "seed", *heads], rows)])


def _rolls(extent: Extent, known: Known) -> Shown:
    asked = [{"world": world} for world in _chosen(extent, WORLDS)]
    pairs = known.pairs("relgym.experiments.speed.rolls:trial", asked)
    rows: list[list[Cell]] = [
        [
            one["world"],
            *(f"{speed[name] / 1e6:.3g}" for name in ("engine", "core")),
            f"not measured: {speed['why']}" if speed["card"] is None else f"{speed['card'] / 1e6:.3g}",
        ]
        for one, speed in pairs
    ]
    return Shown((), [table(["million steps a second", "engine", "one core", "card"], rows)])


def _of(worlds: Sequence[str], title: str, measure: Callable[[Extent, Known], Shown]) -> Benchmark:
    """A benchmark of some worlds, which refuses others."""

    def checked(extent: Extent, known: Known) -> Shown:
        for world in extent["worlds"]:
            if world not in worlds:
                raise ConfigError(f"world {world!r}: expected one of {', '.join(worlds)}")
        return measure(extent, known)

    return Benchmark(title, checked)


SUITE: Final = Suite(
    "speed",
    "Time and memory",
    {
        "steps": Benchmark("A step of learning, ms of processor time", _steps),
        "sizes": _of(list(sizes.WORLDS), "Sizes of worlds", _sizes),
        "rolls": _of(WORLDS, "Roll-outs, on one core and on a card", _rolls),
    },
    seeds=1,
    options={
        "worlds": Option((), "of a benchmark only these; of steps also other envs' ids"),
        "steps": Option(2_000, "of learning, of each world"),
    },
)
