"""How good a model is one step ahead, in any env: wrong predictions, RMSE and R² of every target."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.reports.text import Cell, table
from relgym.model.target.hindsight import WRONG
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition

__all__ = ["Score", "TargetScore", "score", "short"]

_CHUNK = 2000
"""Scenes predicted at once: their relations need some 10 kB each."""

_PREDICTED = OUTCOMES.index(Outcome.PREDICTED)


@dataclass(frozen=True, slots=True)
class TargetScore:
    """Errors of one target.

    Attributes
    ----------
    target
        Such as ``ball.vx``.
    predictions
        How often it was asked for: once per step and object.
    wrong
        How many were off by more than rounding, or not made at all.
    missing
        How many were not made: no mode predicts them.
    rmse
        Root mean square error of those that were made, in units of the property; NaN if none was.
    r2
        Share of the variance of the *change* of those that were made that is predicted; NaN if nothing changes.
    largest
        Largest error of those that were made, in units of the property; NaN if none was.
    """

    target: str
    predictions: int
    wrong: int
    missing: int
    rmse: float
    r2: float
    largest: float


@dataclass(frozen=True, slots=True)
class Score:
    """Errors of a model one step ahead.

    Attributes
    ----------
    steps
        How many transitions.
    right
        At how many of them every prediction was right.
    targets
        Errors by target, in causal order.
    """

    steps: int
    right: int
    targets: tuple[TargetScore, ...]

    def __getitem__(self, target: str) -> TargetScore:
        """Return the errors of the target of that name (``ball.vx``)."""
        return next(t for t in self.targets if t.target == target)

    def __str__(self) -> str:
        if not self.targets:
            return f"{self.steps:,} fresh steps, and nothing to predict: nothing has been learned yet"
        rows: list[list[Cell]] = [
            [t.target, t.predictions, t.wrong, t.missing, *map(short, (t.rmse, t.largest)), _share(t.r2)]
            for t in self.targets
        ]
        heading = ["target", "predictions", "wrong", "none", "RMSE", "largest", "R²"]
        return (
            f"Right on {self.right:,} of {self.steps:,} fresh steps.\n\n{table(heading, rows)}\n\n"
            "wrong: off by more than rounding, or no prediction (none). RMSE and the largest error are in\n"
            "the property's units; R² is the share of its change that is predicted, 1 at best."
        )


def score(model: WorldModel, found: Iterable[Transition], precision: float = 0.0) -> Score:
    """Predict transitions one step ahead, as batches.

    Parameters
    ----------
    model
        The model; unchanged.
    found
        Transitions that it hasn't learned from.
    precision
        Relative precision of what was observed (`relgym.envs.views.View.precision`); of numbers below 1 it is absolute.

    Notes
    -----
    Cost: some 20 µs per transition and target.
    """
    results: dict[str, list[NDArray[np.float64]]] = {}
    steps = right = 0
    for part in _alike(found):
        ok = np.ones(len(part), dtype=np.bool_)
        for target, rows in _results(model, part, precision):
            results.setdefault(target, []).append(rows)
            ok &= rows[:, 1] == 0.0
        steps, right = steps + len(part), right + int(ok.sum())
    order = [str(target) for target in model.targets]
    names = sorted(results, key=lambda name: order.index(name) if name in order else len(order))
    return Score(steps, right, tuple(_target_score(name, np.concatenate(results[name])) for name in names))


def _alike(found: Iterable[Transition]) -> Iterable[list[Transition]]:
    """Consecutive transitions with the same objects, some thousand at a time."""
    for _, group in groupby(found, key=lambda t: (t.before.layout.names, t.after.layout.names)):
        part: list[Transition] = []
        for transition in group:
            part.append(transition)
            if len(part) == _CHUNK:
                yield part
                part = []
        if part:
            yield part


def _results(
    model: WorldModel, part: list[Transition], precision: float
) -> Iterable[tuple[str, NDArray[np.float64]]]:
    """Per target and object, shape ``(n, 4)``: residual, was it wrong, was it made, change."""
    now, then = part[0].before.layout, part[0].after.layout
    before = np.stack([t.before.vector for t in part])
    after = np.stack([t.after.vector for t in part])
    prediction = model.predict_batch(now, before)
    for k, (name, prop) in enumerate(prediction.parts):
        if name not in then.names:  # it has gone
            continue
        index = now.index(name)
        kind, own = now.types[index], now.column(index, prop)
        came = after[:, then.column(then.index(name), prop)]
        residual, change = came - prediction.vectors[:, own], came - before[:, own]
        if prop in kind.angles:  # π and -π are the same place
            residual, change = (np.remainder(x + np.pi, 2.0 * np.pi) - np.pi for x in (residual, change))
        was_made = prediction.outcomes[:, k] == _PREDICTED
        limit = np.maximum(WRONG, precision * np.maximum(1.0, np.abs(came)))
        wrong = ~was_made | ~(np.abs(residual) <= limit)
        yield f"{kind.name}.{prop}", np.column_stack([residual, wrong, was_made, change])


def _target_score(target: str, rows: NDArray[np.float64]) -> TargetScore:
    was_made = rows[:, 2] > 0
    residual, change = rows[was_made, 0], rows[was_made, 3]
    squares = float(np.square(residual).sum())
    variance = float(np.square(change - change.mean()).sum()) if len(change) else 0.0
    # What only rounding changes has no variance to speak of.
    steady = variance <= len(change) * WRONG**2
    return TargetScore(
        target,
        predictions=len(rows),
        wrong=int(rows[:, 1].sum()),
        missing=int((~was_made).sum()),
        rmse=math.sqrt(squares / len(residual)) if len(residual) else math.nan,
        r2=math.nan if steady else 1.0 - squares / variance,
        largest=float(np.abs(residual).max()) if len(residual) else math.nan,
    )


def short(value: float) -> Cell:
    """Two digits; nothing of NaN."""
    return "" if math.isnan(value) else float(f"{value:.2g}")


def _share(value: float) -> Cell:
    return "" if math.isnan(value) else round(value, 6)
