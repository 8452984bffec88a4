"""Roll-outs: whole episodes predicted from their first scenes alone, compared with what happened (§4.8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.episodes import Episode
from relgym.model.protocol import SceneLearner
from relgym.model.reports.text import Cell, table
from relgym.scene.objects import ACTION, Float2D, SceneLayout

__all__ = ["STRAY", "RolloutErrors", "imagined", "largest_errors", "outside", "positions", "rollouts"]

STRAY = 1e-2
"""A roll-out has failed when a position is off by more than this at some step, in units."""


@dataclass(frozen=True, slots=True)
class RolloutErrors:
    """What became of roll-outs.

    Attributes
    ----------
    trials, steps
        How many roll-outs, and how long.
    failed
        How many were off by more than `STRAY` somewhere, or stopped early; all, and those during whose truth
        no corner was hit.
    stopped
        How many of those stopped early, where there was no prediction.
    corner
        Trials during whose truth a corner was hit.
    median
        Median over the trials that didn't fail of their largest position error, in units; NaN if all failed.
    """

    trials: int
    steps: int
    failed: int
    failed_without_corner: int
    stopped: int
    corner: int
    median: float

    def __str__(self) -> str:
        rows: list[list[Cell]] = [["all", self.trials, self.failed]]
        if self.corner:
            rows.insert(0, ["with a corner hit", self.corner, self.failed - self.failed_without_corner])
            rows.insert(1, ["without", self.trials - self.corner, self.failed_without_corner])
        return (
            table([f"roll-outs of {self.steps} steps", "trials", "failed"], rows)
            + f"\n\nfailed: a position is off by more than {STRAY:g} at some step, or the roll-out stopped "
            + f"early ({self.stopped})\nlargest error of the others, median: {self.median:.1e}"
        )


def rollouts(model: SceneLearner, episodes: Sequence[Episode]) -> RolloutErrors:
    """Predict every episode from its first scene alone and compare with what happened (§4.8).

    Actions and exogenous properties come from the episode; everything else from the model's own predictions.

    Parameters
    ----------
    model
        The model; unchanged.
    episodes
        Episodes of equal length, which the model hasn't learned from.
    """
    largest, early = _rolled(model, episodes)
    corner = np.array([bool(b.truth.corner.any()) for b in episodes])
    failed = early | (largest > STRAY)
    median = float(np.median(largest[~failed])) if (~failed).any() else float("nan")
    return RolloutErrors(
        trials=len(episodes),
        steps=len(episodes[0]),
        failed=int(failed.sum()),
        failed_without_corner=int((failed & ~corner).sum()),
        stopped=int(early.sum()),
        corner=int(corner.sum()),
        median=median,
    )


def largest_errors(model: SceneLearner, episodes: Sequence[Episode]) -> NDArray[np.float64]:
    """Largest position error of each episode's roll-out, in units; infinite where it stopped early."""
    largest, early = _rolled(model, episodes)
    return np.where(early, np.inf, largest)


def imagined(model: SceneLearner, vectors: Float2D, layout: SceneLayout) -> tuple[Float2D, int]:
    """A roll-out from the first of some state vectors, of the same shape, and how many steps were predicted.

    What comes from outside the world (actions, exogenous properties) is taken from `vectors`; rows beyond the
    last prediction repeat it.
    """
    given = outside(layout)
    result = np.repeat(vectors[:1], len(vectors), axis=0)
    for k in range(1, len(vectors)):
        step = model.predict_batch(layout, result[k - 1 : k])
        if not step.ok[0]:
            return result, k - 1
        result[k:] = step.vectors[0]
        result[k, given] = vectors[k, given]
    return result, len(vectors) - 1


def _rolled(
    model: SceneLearner, episodes: Sequence[Episode]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Largest position error of each episode's roll-out, and whether it stopped early."""
    found = []
    for _, group in groupby(episodes, key=lambda episode: episode.layout.names):
        part = list(group)
        found.append(_roll(model, np.stack([b.vectors for b in part]), part[0].layout))
    largest, early = (np.concatenate(each) for each in zip(*found, strict=True))
    return largest, early


def _roll(
    model: SceneLearner, truth: NDArray[np.float64], layout: SceneLayout
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Largest position error of each trial, and whether it stopped early.

    `truth` has shape ``(trials, steps + 1, width)``.
    """
    given, places = outside(layout), positions(layout)
    now = truth[:, 0].copy()
    largest, stopped = np.zeros(len(truth)), np.zeros(len(truth), dtype=np.bool_)
    for k in range(1, truth.shape[1]):
        going = np.flatnonzero(~stopped)
        if not len(going):
            break
        step = model.predict_batch(layout, now[going])
        stopped[going[~step.ok]] = True
        now[going] = step.vectors
        now[:, given] = truth[:, k][:, given]
        off = np.abs(now[:, places] - truth[:, k][:, places]).max(axis=1)
        largest = np.where(stopped, largest, np.maximum(largest, off))
    return largest, stopped


def outside(layout: SceneLayout) -> list[int]:
    """Columns that no model predicts: actions and exogenous properties."""
    return [
        layout.column(i, prop)
        for i, t in enumerate(layout.types)
        for prop in t.properties
        if t.name == ACTION or prop in t.exogenous
    ]


def positions(layout: SceneLayout) -> list[int]:
    """Columns of all bodies' positions."""
    return [
        layout.offsets[i] + k for i in layout.bodies for k in layout.types[i].pose_columns()[:3] if k >= 0
    ]
