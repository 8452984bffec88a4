"""Learning curves with intervals, after Agarwal et al. 2021 (*Deep RL at the Edge of the Statistical Precipice*)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.dyna.arms import ARMS
from relgym.experiments.plots import require_matplotlib
from relgym.model.reports.text import Cell, table

if TYPE_CHECKING:
    from relgym.experiments.dyna.course import Run

__all__ = [
    "curves",
    "draw_runs",
    "draw_successes",
    "interquartile_mean",
    "interval",
    "reached",
    "summary",
]

Curve: TypeAlias = Sequence[Sequence[int]]
"""Pairs of real steps and successes of 100."""

RESAMPLES: Final = 2_000
"""Bootstrap samples of the seeds."""


def interquartile_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of the middle half along the last axis; what the outer quarters hold in part counts in part.

    Examples
    --------
    >>> float(interquartile_mean(np.array([0.0, 1.0, 2.0, 100.0])))
    1.5
    """
    ordered = np.sort(values, axis=-1)
    n = ordered.shape[-1]
    edges = np.arange(n + 1, dtype=np.float64)
    low, high = 0.25 * n, 0.75 * n
    weights = np.clip(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0.0, None)
    mean: NDArray[np.float64] = (ordered * weights).sum(axis=-1) / weights.sum()
    return mean


def interval(
    values: NDArray[np.float64], *, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Interquartile mean over seeds and its percentile bootstrap interval, which holds 95 %.

    Parameters
    ----------
    values
        Shape ``(points, seeds)``.
    rng
        Draws the bootstrap samples.

    Returns
    -------
    Mean, lower and upper end, each of shape ``(points,)``.
    """
    seeds = values.shape[1]
    drawn = values[:, rng.integers(seeds, size=(RESAMPLES, seeds))]
    means = interquartile_mean(drawn)
    low, high = np.quantile(means, [0.025, 0.975], axis=1)
    return interquartile_mean(values), low, high


def curves(runs: Sequence[Curve]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Real steps, shape ``(points,)``, and successes, shape ``(points, runs)``; a run keeps its last value."""
    steps = sorted({int(point) for run in runs for point, _ in run})
    values = np.zeros((len(steps), len(runs)))
    for column, run in enumerate(runs):
        known: dict[int, int] = dict(map(tuple, run))  # type: ignore[arg-type]
        latest = 0
        for row, point in enumerate(steps):
            latest = known.get(point, latest)
            values[row, column] = latest
    return np.array(steps, dtype=np.int64), values


def reached(run: Run) -> int:
    """Real steps to success; one more than it had where it didn't succeed."""
    return run.steps + 1 if run.solved_at is None else run.solved_at


def summary(runs: Sequence[Run]) -> str:
    """A table: real steps to success by arm; runs that didn't succeed count as more than they had."""
    rows: list[list[Cell]] = []
    for arm, own in _by_arm(runs):
        ordered = sorted(own, key=reached)
        low, high = ordered[(len(own) - 1) // 2], ordered[len(own) // 2]  # the same one of an odd number
        middle = f"{median(map(reached, own)):,.0f}" if high.solved_at is not None else f"> {low.steps:,}"
        rows.append(
            [
                ARMS[arm].title,
                f"{sum(r.solved_at is not None for r in own)} of {len(own)}",
                middle,
                ", ".join(f"> {r.steps:,}" if r.solved_at is None else f"{r.solved_at:,}" for r in ordered),
                f"{median(r.last for r in own):.0f}",
                *(f"{median(values):.0f} s" for values in _times(own)),
            ]
        )
    heading = ["arm", "solved", "median steps", "each", "last, %", "time", "learning", "dreaming"]
    return table(heading, rows)


def _times(runs: Sequence[Run]) -> tuple[list[float], ...]:
    return tuple(
        [getattr(r, name) for r in runs] for name in ("seconds", "learning_seconds", "dreaming_seconds")
    )


def draw_runs(path: Path, runs: Sequence[Run], title: str) -> Path:
    """Draw successes over real steps (`draw_successes`)."""
    shown = {ARMS[arm].title: [run.curve for run in own] for arm, own in _by_arm(runs)}
    return draw_successes(path, shown, title, "real steps")


def draw_successes(path: Path, shown: Mapping[str, Sequence[Curve] | int], title: str, unit: str) -> Path:
    """Draw successes of 100 over what they cost: interquartile mean and 95 % interval of each arm.

    Parameters
    ----------
    path
        Of the picture.
    shown
        Curves of each arm by its title; a number of successes, which costs nothing, is a level.
    title, unit
        Of the picture, and of the costs.

    Raises
    ------
    ConfigError
        matplotlib isn't installed.
    """
    require_matplotlib()
    from matplotlib.figure import Figure  # no pyplot: it would choose a window system

    rng = np.random.default_rng(0)
    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.subplots()
    for arm, own in shown.items():
        if isinstance(own, int):
            axes.axhline(own, color="0.3", linestyle=":", label=arm)
            continue
        steps, values = curves(own)
        mean, low, high = interval(values, rng=rng)
        label = f"{arm} ({len(own)} {'seed' if len(own) == 1 else 'seeds'})"
        (line,) = axes.plot(steps, mean, marker="o", markersize=3, label=label)
        axes.fill_between(steps, low, high, alpha=0.2, color=line.get_color())
    axes.axhline(90, color="0.6", linewidth=0.8, linestyle="--")
    axes.set(title=title, xlabel=unit, ylabel="successes of 100", ylim=(-2, 102))
    axes.legend(loc="best", fontsize="small")
    figure.savefig(path, dpi=120)
    return path


def _by_arm(runs: Sequence[Run]) -> list[tuple[str, list[Run]]]:
    order = list(ARMS)
    ordered = sorted(runs, key=lambda r: (order.index(r.arm), r.seed))
    return [(arm, list(group)) for arm, group in groupby(ordered, key=lambda r: r.arm)]
