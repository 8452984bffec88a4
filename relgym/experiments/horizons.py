"""Roll-outs in any env: episodes predicted from their first scenes alone, and how the error grows (§4.8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.fresh import FreshEpisode
from relgym.experiments.rollouts import STRAY, outside, positions
from relgym.experiments.scores import short
from relgym.model.predicting.prediction import OUTCOMES, BatchPrediction, Outcome
from relgym.model.reports.text import Cell, amount, table
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, TASK, SceneLayout

__all__ = ["HORIZONS", "TOLERANCE", "Horizons", "PropertyErrors", "horizons"]

HORIZONS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
"""After so many steps errors are shown."""

TOLERANCE = 0.01
"""Share of a property's spread by which a roll-out may be off; positions of bodies may be off by `STRAY`."""

_PREDICTED = OUTCOMES.index(Outcome.PREDICTED)


@dataclass(frozen=True, slots=True)
class PropertyErrors:
    """Errors of a property along roll-outs.

    Attributes
    ----------
    name
        Such as ``ball.px``; all objects of a type together.
    spread
        Standard deviation of what really came, in units of the property.
    rmse
        Root mean square error after the steps in `Horizons.after`, in units of the property; NaN where no roll-out
        came so far.
    """

    name: str
    spread: float
    rmse: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Horizons:
    """How far ahead a model holds.

    Attributes
    ----------
    trials, longest
        How many roll-outs, and how many steps the longest one has.
    kept
        How many stayed with the real episode to its end: never off by more than `TOLERANCE` of a property's spread,
        or, where bodies have positions, by more than `STRAY` in one of them.
    stopped
        How many ended early, without a prediction.
    lacking
        Targets whose missing predictions ended them.
    bodies
        Whether positions decide.
    after
        Numbers of steps after which errors are given.
    reached
        How many roll-outs came so far.
    properties
        Their errors.
    """

    trials: int
    longest: int
    kept: int
    stopped: int
    lacking: tuple[str, ...]
    bodies: bool
    after: tuple[int, ...]
    reached: tuple[int, ...]
    properties: tuple[PropertyErrors, ...]

    def __str__(self) -> str:
        limit = (
            f"a position is off by more than {STRAY:g}"
            if self.bodies
            else "a property is off by more than 1 % of its spread"
        )
        lacking = f", without a prediction of {', '.join(self.lacking)}" if self.lacking else ""
        head = (
            f"{self.kept} of {amount(self.trials, 'roll-out')} of up to {amount(self.longest, 'step')} stay with the "
            f"real episode to its end."
        )
        rows: list[list[Cell]] = [[p.name, short(p.spread), *map(short, p.rmse)] for p in self.properties]
        rows.append(["roll-outs", "", *self.reached])
        heading = ["RMSE after", "spread", *(amount(n, "step") for n in self.after)]
        notes = [
            "A roll-out predicts an episode from its first scene and the actions alone. It strays when",
            f"{limit}, or when no mode predicts what comes:",
            f"{self.stopped} of {self.trials}{lacking}. Spread: the standard deviation of the real values.",
        ]
        return "\n".join([head, "", *([table(heading, rows), ""] if self.after else []), *notes])


def horizons(model: WorldModel, found: Sequence[FreshEpisode]) -> Horizons:
    """Predict episodes from their first scenes alone, and compare with what happened.

    Actions and exogenous properties come from the episode; everything else from the model's own predictions. Where
    objects come or go the comparison ends, since models don't learn that.

    Parameters
    ----------
    model
        The model; unchanged.
    found
        Episodes that it hasn't learned from.
    """
    rolls = []
    ordered = sorted(found, key=lambda e: e.before[0].layout.names)
    for _, group in groupby(ordered, key=lambda e: e.before[0].layout.names):
        rolls += _roll(model, list(group))
    spread = _spreads(rolls)
    bodies = any(roll.positions for roll in rolls)
    longest = max(roll.length for roll in rolls)
    farthest = max(len(roll.errors) for roll in rolls)
    after = tuple(sorted({n for n in (*HORIZONS, farthest) if 0 < n <= farthest}))
    return Horizons(
        trials=len(rolls),
        longest=longest,
        kept=sum(_stays(roll, spread, bodies=bodies) for roll in rolls),
        stopped=sum(len(roll.errors) < roll.length for roll in rolls),
        lacking=tuple(dict.fromkeys(name for roll in rolls for name in roll.lacking)),
        bodies=bodies,
        after=after,
        reached=tuple(sum(len(roll.errors) >= n for roll in rolls) for n in after),
        properties=tuple(
            PropertyErrors(name, spread[name], tuple(_rmse(rolls, name, n) for n in after)) for name in spread
        ),
    )


@dataclass(frozen=True, slots=True)
class _Roll:
    """One roll-out: what was compared, shape ``(steps, columns)``, by how much each was off, and what ended it."""

    names: tuple[str, ...]
    positions: tuple[int, ...]
    real: NDArray[np.float64]
    errors: NDArray[np.float64]
    length: int
    lacking: tuple[str, ...]


def _roll(model: WorldModel, found: Sequence[FreshEpisode]) -> list[_Roll]:
    """Roll-outs of episodes that begin with the same objects, stepped together."""
    layout = found[0].before[0].layout
    lengths = [_steady(e) for e in found]
    now = np.stack([e.before[0].vector for e in found])
    given = outside(layout)
    own = _compared(model, layout)
    task = [
        layout.column(i, prop) for i, t in enumerate(layout.types) if t.name == TASK for prop in t.properties
    ]
    errors: list[list[NDArray[np.float64]]] = [[] for _ in found]
    lacking: dict[int, tuple[str, ...]] = {}
    going = np.array([k for k, n in enumerate(lengths) if n], dtype=np.intp)
    angles = np.array([prop in layout.types[i].angles for i, prop, _ in own], dtype=np.bool_)
    real = [
        np.stack([_values(e, k, layout, own) for k in range(n)]) if n else np.zeros((0, len(own)))
        for e, n in zip(found, lengths, strict=True)
    ]
    columns = [c for _, _, c in own]
    step = 0
    while len(going):
        told = model.predict_batch(layout, now[going])
        for row in np.flatnonzero(~told.ok).tolist():
            lacking[int(going[row])] = _lacking(told, row)
        going, vectors = going[told.ok], told.vectors[told.ok]
        for k, vector in zip(going.tolist(), vectors, strict=True):
            off = vector[columns] - real[k][step]
            errors[k].append(np.where(angles, np.remainder(off + np.pi, 2.0 * np.pi) - np.pi, off))
        step += 1
        last = np.array([lengths[k] <= step for k in going.tolist()], dtype=np.bool_)
        going, vectors = going[~last], vectors[~last]
        now[going] = vectors
        for k in going.tolist():
            now[k, given] = found[k].before[step].vector[given]
            now[k, task] = 0.0
    names = tuple(f"{layout.types[i].name}.{prop}" for i, prop, _ in own)
    places = tuple(k for k, column in enumerate(columns) if column in positions(layout))
    return [
        _Roll(names, places, r, np.reshape(e, (len(e), len(own))), n, lacking.get(k, ()))
        for k, (r, e, n) in enumerate(zip(real, errors, lengths, strict=True))
    ]


def _lacking(told: BatchPrediction, row: int) -> tuple[str, ...]:
    """Targets that no mode predicted in one scene of a batch."""
    layout = told.layout
    parts = zip(told.parts, told.outcomes[row].tolist(), strict=True)
    return tuple(
        f"{layout.types[layout.index(name)].name}.{prop}" for (name, prop), o in parts if o != _PREDICTED
    )


def _steady(episode: FreshEpisode) -> int:
    """After how many steps objects come or go, or the episode ends."""
    names = episode.before[0].layout.names
    changed = (k for k, scene in enumerate(episode.before) if scene.layout.names != names)
    whole = next(changed, len(episode))
    last = episode.after[whole - 1].layout.names
    shown = {name for name in names if name != ACTION}
    return whole if shown <= set(last) else whole - 1


def _compared(model: WorldModel, layout: SceneLayout) -> list[tuple[int, str, int]]:
    """What is predicted, learned or derived: object's index, property, column."""
    targets = {(t.type, t.property) for t in model.targets}
    derived = {(k.type, k.property) for k in model.schema.kinematics}
    return [
        (i, prop, layout.column(i, prop))
        for i, t in enumerate(layout.types)
        for prop in t.properties
        if (t.name, prop) in targets | derived
    ]


def _values(
    episode: FreshEpisode, step: int, layout: SceneLayout, own: Sequence[tuple[int, str, int]]
) -> NDArray[np.float64]:
    after = episode.after[step]
    there = after.layout
    return np.array([after.vector[there.column(there.index(layout.names[i]), prop)] for i, prop, _ in own])


def _spreads(rolls: Sequence[_Roll]) -> dict[str, float]:
    values: dict[str, list[NDArray[np.float64]]] = {}
    for roll in rolls:
        for k, name in enumerate(roll.names):
            values.setdefault(name, []).append(roll.real[:, k])
    return {name: float(np.concatenate(found).std()) for name, found in values.items()}


def _stays(roll: _Roll, spread: dict[str, float], *, bodies: bool) -> bool:
    if len(roll.errors) < roll.length:
        return False
    if bodies:
        return bool((np.abs(roll.errors[:, list(roll.positions)]) <= STRAY).all())
    limits = np.array([max(TOLERANCE * spread[name], 1e-9) for name in roll.names])
    return bool((np.abs(roll.errors) <= limits).all())


def _rmse(rolls: Sequence[_Roll], name: str, step: int) -> float:
    found = [
        roll.errors[step - 1, k]
        for roll in rolls
        if len(roll.errors) >= step
        for k, own in enumerate(roll.names)
        if own == name
    ]
    return float(np.sqrt(np.square(found).mean())) if found else math.nan
