"""How often each mode of tables 4.2 and 4.9 occurs in our scenes, beside the thesis' counts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from relgym.experiments.analytic import AnalyticMode
from relgym.experiments.chapter4.job import Plan, Shown, Values
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.published import MODES, PublishedMode
from relgym.experiments.data import BALL_EXPERIMENTS, THESIS_EXPERIMENTS, ball_episodes
from relgym.experiments.evaluate import TOLERANCE
from relgym.experiments.jobs.code import LEARNER
from relgym.experiments.jobs.task import Task
from relgym.experiments.scenes import TOLD_APART
from relgym.experiments.seeds import FREQUENCY_SEEDS
from relgym.model.reports.text import Cell, table

__all__ = ["FEW", "count", "counts_shown", "plan"]

FEW: Final = 50
"""Modes of which the thesis counted fewer are shown and not evaluated."""

BAND: Final = 0.25
"""Largest difference from the thesis' count, as a share of it, that is called the same. Ours: it printed no spread."""

_TABLES: Final = {1: "4.2", 2: "4.9"}


def plan(protocol: Protocol) -> Plan:
    """Ten seeds of each experiment, in both kinds of scenes."""
    return {
        f"{experiment}/{scenes}": [
            Task(
                f"{__name__}:count",
                {"experiment": experiment, "seed": seed, "scenes": scenes},
                "scenes",
                LEARNER,
            )
            for seed in FREQUENCY_SEEDS
        ]
        for experiment in (1, 2)
        for scenes in ("thesis", "env")
    }


def count(*, experiment: int, seed: int, scenes: str) -> dict[str, Any]:
    """Count the training transitions of one seed by mode.

    What several functions explain counts for the first of them in the thesis' table.

    Returns
    -------
    Plain data: by axis the counts of the table's rows, noise first.
    """
    setting = (THESIS_EXPERIMENTS if scenes == "thesis" else BALL_EXPERIMENTS)[experiment]
    laws = setting.modes()
    found: dict[str, Any] = {}
    episodes = list(ball_episodes(setting, seed=seed, order=None))
    before = np.concatenate([e.columns("ball", "vx", "vy")[:-1] for e in episodes])
    after = np.concatenate([e.columns("ball", "vx", "vy")[1:] for e in episodes])
    for axis, known in (("x", laws.x), ("y", laws.y)):
        explaining = laws.explaining(axis, before, after, TOLERANCE)
        rows = MODES[_TABLES[experiment], axis][1:]
        # Rows of tables stand for functions to three digits; the analytic ones are exact.
        fits = np.stack([explaining[:, _exact(known, row)].any(axis=1) for row in rows], axis=1)
        first = np.where(fits.any(axis=1), fits.argmax(axis=1) + 1, 0)
        found[axis] = np.bincount(first, minlength=len(rows) + 1).tolist()
    return found


def _exact(known: Sequence[AnalyticMode], row: PublishedMode) -> list[int]:
    """Which analytic modes have the printed function."""
    assert row.weights is not None, "noise has no function"
    printed = np.array([*row.weights, row.intercept])
    off = [np.abs(np.array([*m.weights, m.intercept]) - printed) for m in known]
    close = np.maximum(6e-3 * np.abs(printed), 1e-8)
    return [k for k, each in enumerate(off) if (each <= close).all()]


def counts_shown(_: Protocol, values: Values) -> Shown:
    """Counts by mode, their mean over the seeds, beside the thesis'."""
    heading = [
        "experiment",
        "axis",
        "#",
        "behaviour",
        "printed",
        "alone",
        "ours",
        "least",
        "most",
        "off %",
        "within",
        "env",
    ]
    lines: list[list[Cell]] = []
    counted = inside = 0
    for experiment, number in _TABLES.items():
        for axis in ("x", "y"):
            ours, others = (
                np.array([run[axis] for run in values[f"{experiment}/{scenes}"]])
                for scenes in ("thesis", "env")
            )
            alone = TOLD_APART.get((experiment, axis), {})
            for row in MODES[number, axis]:
                wanted = alone.get(row.number - 1, row.examples)
                column = ours[:, row.number]
                off = column.mean() / wanted - 1.0
                counts = row.number > 0 and row.examples >= FEW
                counted += counts
                inside += counts and abs(off) <= BAND
                verdict = "" if not counts else "yes" if abs(off) <= BAND else "no"
                told: Cell = wanted if wanted != row.examples else ""
                spread = [round(float(column.mean())), int(column.min()), int(column.max())]
                lines.append(
                    [
                        *(experiment, axis, row.number, row.behaviour, row.examples, told, *spread),
                        *(round(100 * off), verdict, round(float(others[:, row.number].mean()))),
                    ]
                )
    note = (
        f"{inside} of {counted} modes with at least {FEW} printed examples are within {BAND:.0%} of the count, a band "
        "of ours.\nMeans of 10 seeds that nothing was fitted to; env: the scenes of relgym/BallBoxRamp-v0.\n"
        "alone: what the thesis' clauses leave where two functions are right: of experiment 1's 334 bounces on level\n"
        "surfaces 151 slide (Table 4.5), of experiment 2's 437 and 359 on upright ones 388 and 308 touch nothing\n"
        "(Table 4.14)."
    )
    return Shown(f"{table(heading, lines)}\n\n{note}", [heading, *lines])
