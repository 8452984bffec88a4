"""Tests of a model on fresh episodes: errors by true mode, and which modes are taken for which (§4.3.3, §4.3.4)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.analytic import AnalyticModes
from relgym.experiments.chapter4.learners import Learner, governed, mode_values, modes_of
from relgym.experiments.chapter4.scores import target_score
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import TOLERANCE, explicable, mode_labels
from relgym.model.predicting.prediction import OUTCOMES, Outcome

__all__ = ["TARGETS", "confusions", "scores_of", "true_modes"]

TARGETS: Final = ("ball.vx", "ball.vy")

_SPOKE: Final = OUTCOMES.index(Outcome.PREDICTED)


def scores_of(model: Learner, episodes: Sequence[Episode], laws: AnalyticModes) -> dict[str, Any]:
    """Errors of a model on episodes, by target, as plain data (`relgym.experiments.chapter4.scores`)."""
    names = mode_labels(laws)
    found: dict[str, list[tuple[NDArray[Any], ...]]] = {target: [] for target in TARGETS}
    for part in _alike(episodes):
        for target, columns in _columns(model, part, laws).items():
            found[target].append(columns)
    return {target: target_score(names[target], *_joined(parts)) for target, parts in found.items()}


def _joined(parts: Sequence[tuple[NDArray[Any], ...]]) -> tuple[Any, ...]:
    truth, counted, residual, abstained, best, change = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    return truth, counted, residual, abstained, (None if np.isnan(best).all() else best), change


def _columns(
    model: Learner, part: Sequence[Episode], laws: AnalyticModes
) -> dict[str, tuple[NDArray[Any], ...]]:
    """Per target: truth, counted, residual, abstained, best residual of a mode (NaN if there are laws), change."""
    layout = part[0].layout
    before = np.concatenate([b.vectors[:-1] for b in part])
    after = np.concatenate([b.vectors[1:] for b in part])
    prediction = model.predict_batch(layout, before)
    counted = [explicable(b, laws) for b in part]
    found: dict[str, tuple[NDArray[Any], ...]] = {}
    for k, (name, prop) in enumerate(prediction.parts):
        index = layout.index(name)
        target, column = f"{layout.types[index].name}.{prop}", layout.column(index, prop)
        actual = after[:, column]
        values = mode_values(model, target, layout, before)
        with np.errstate(invalid="ignore"):
            off = np.abs(values - actual[:, None])
        best = np.fmin.reduce(off, axis=1, initial=np.inf)
        if governed(model, target):
            best = np.full(len(actual), np.nan)
        found[target] = (
            np.concatenate([true_modes(b, target, laws) for b in part]),
            np.concatenate([c[target] for c in counted]),
            np.abs(prediction.vectors[:, column] - actual),
            prediction.outcomes[:, k] != _SPOKE,
            best,
            actual - before[:, column],
        )
    return found


def true_modes(episode: Episode, target: str, laws: AnalyticModes) -> NDArray[np.int64]:
    """Number of each transition's analytic mode; where several contacts act at once, of the simplest that explains it.

    A ball that slides into a wall is touched twice, and each coordinate follows one of the two. Shape ``(n,)``; -1
    where no mode explains the step.
    """
    numbers = episode.truth.mode[target].copy()
    v = episode.columns("ball", "vx", "vy")
    explaining = laws.explaining(target[-1], v[:-1], v[1:], TOLERANCE)
    unlabelled = (numbers < 0) & explaining.any(axis=1)
    sizes = [
        sum(w != 0.0 for w in (*m.weights, m.intercept)) for m in (laws.x if target[-1] == "x" else laws.y)
    ]
    simplest = np.argsort(sizes, kind="stable")
    numbers[unlabelled] = simplest[explaining[unlabelled][:, simplest].argmax(axis=1)]
    return numbers


def _alike(episodes: Iterable[Episode]) -> Iterator[list[Episode]]:
    """Episodes with the same objects together, some thousand examples at a time."""
    groups: dict[tuple[str, ...], list[Episode]] = {}
    for episode in episodes:
        groups.setdefault(episode.layout.names, []).append(episode)
    for group in groups.values():
        for k in range(0, len(group), 20):
            yield group[k : k + 20]


def confusions(model: Learner, episodes: Sequence[Episode], laws: AnalyticModes) -> dict[str, Any]:
    """Tables 4.7, 4.8, 4.15 and 4.16: predicted against correct mode, by target that modes predict.

    The correct mode is the one with the least error; whoever is within the tolerance of it is as correct (the thesis
    counted ties as errors at the toss of a coin). Examples that no linear law explains are left out.
    """
    found: dict[str, Any] = {}
    for target in TARGETS:
        modes = modes_of(model, target)
        ids = [mode.id for mode in modes]
        if governed(model, target) or not ids:
            continue
        table = np.zeros((len(ids) + 1, len(ids)), dtype=np.int64)
        for group in _alike(episodes):
            table += _confusion(model, group, target, laws, ids)
        formulas = [mode.formula(3) for mode in modes]
        found[target] = {"modes": ids, "functions": formulas, "table": table.tolist()}
    return found


def _confusion(
    model: Learner, part: Sequence[Episode], target: str, laws: AnalyticModes, ids: Sequence[int]
) -> NDArray[np.int64]:
    """Counts by predicted mode (the last row: none) and correct one, shape ``(modes + 1, modes)``."""
    layout = part[0].layout
    before = np.concatenate([b.vectors[:-1] for b in part])
    after = np.concatenate([b.vectors[1:] for b in part])
    prediction = model.predict_batch(layout, before)
    name, prop = target.split(".")
    (index,) = layout.of_type(name)
    k = prediction.parts.index((layout.names[index], prop))
    off = np.abs(mode_values(model, target, layout, before) - after[:, [layout.column(index, prop)]])
    off = np.where(np.isnan(off), np.inf, off)
    correct = off.argmin(axis=1)
    place = {number: row for row, number in enumerate(ids)}
    chosen = np.array([place.get(m, len(ids)) for m in prediction.modes[:, k].tolist()])
    every = np.arange(len(chosen))
    spoke = chosen < len(ids)
    tied = spoke & (off[every, np.minimum(chosen, len(ids) - 1)] <= off[every, correct] + TOLERANCE)
    counted = np.concatenate([explicable(b, laws)[target] for b in part])
    counts = np.zeros((len(ids) + 1, len(ids)), dtype=np.int64)
    np.add.at(counts, (chosen[counted], np.where(tied, chosen, correct)[counted]), 1)
    return counts
