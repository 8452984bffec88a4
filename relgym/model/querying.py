"""Asking a world model: what follows one scene, or many with the same objects (Figure 1.5, §3.6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relgym.model.parts import Parts
from relgym.model.perception import Percept
from relgym.model.prediction import OUTCOMES, BatchPrediction, Outcome, Prediction, ScenePrediction
from relgym.model.property_model import PropertyModel, Verdict
from relgym.model.scenes import wrap
from relgym.scene.objects import Scene, SceneLayout, Target
from relgym.scene.schema import SceneSchema

__all__ = ["derive", "predict", "predict_many"]

_PREDICTED, _OUTSIDE, _DEPENDS, _UNEXPLAINED = (
    OUTCOMES.index(o) for o in (Outcome.PREDICTED, Outcome.OUTSIDE, Outcome.DEPENDS, Outcome.UNEXPLAINED)
)


def predict(parts: Parts, percept: Percept, scene: Scene) -> ScenePrediction:
    """Predict the scene that follows one whose numbers are finite."""
    layout, following = scene.layout, scene.vector.copy()
    found: list[Prediction] = []
    lost: set[tuple[str, str]] = set()
    motion = None if parts.laws is None else parts.laws.speak(percept)
    for target in parts.targets:
        for index in layout.of_type(target.type):
            if motion is not None and parts.laws is not None and parts.laws.governs(target):
                one = parts.laws.prediction(motion, percept, index, target)
            else:
                one = parts.models[target].predict_one(percept, index, following)
            if not lost.isdisjoint(target.given) and not lost.isdisjoint(parts.models[target].needs):
                one = Prediction("", "", one.value, Outcome.DEPENDS, spread=one.spread)
            column = layout.column(index, target.property)
            if not np.isfinite(one.value):
                # A mode whose value overflows has left its experience; other outcomes say why they are empty.
                outcome = Outcome.OUTSIDE if one.ok else one.outcome
                one = replace(one, outcome=outcome, mode=0, spread=np.nan)
                one = _fallback(parts.models[target], percept, index, following, one)
            following[column] = one.value
            if not one.ok:
                lost.add((target.type, target.property))
            found.append(replace(one, object=layout.names[index], property=target.property))
    derive(parts.schema, layout, scene.vector[None], following[None])
    wrap(layout, following)
    return ScenePrediction(Scene(scene.schema, layout, following), tuple(found))


def _fallback(
    model: PropertyModel,
    percept: Percept,
    index: int,
    following: NDArray[np.float64],
    one: Prediction,
) -> Prediction:
    """A prediction that no mode makes, with the best guess as its value, or else the present one."""
    guessed = model.guessed(percept, index, following[None])
    if guessed is None or not np.isfinite(guessed[0]):
        column = percept.layout.column(index, model.target.property)
        return replace(one, value=float(following[column]))
    best = model.guess_at(percept, index, following)
    return replace(one, value=float(guessed[0]), spread=one.spread if best is None else best.mode.sigma)


def predict_many(
    parts: Parts, percept: Percept, layout: SceneLayout, vectors: NDArray[np.float64]
) -> BatchPrediction:
    """Predict what follows n scenes with the same objects; bit for bit what `predict` gives."""
    following = vectors.copy()
    keys: list[tuple[str, str]] = []
    verdicts: list[Verdict] = []
    lost: dict[tuple[str, str], NDArray[np.bool_]] = {}
    nowhere = np.zeros(len(vectors), dtype=bool)
    motion = None if parts.laws is None else parts.laws.speak(percept)
    for target in parts.targets:
        for index in layout.of_type(target.type):
            if motion is not None and parts.laws is not None and parts.laws.governs(target):
                verdict = parts.laws.verdict(motion, percept, index, target)
            else:
                verdict = parts.models[target].predict_batch(percept, index, following)
            for pair in parts.models[target].needs if lost else ():
                rows = lost.get(pair, nowhere)
                verdict.outcomes[rows], verdict.margins[rows] = _DEPENDS, 0.0
            told = np.isfinite(verdict.values)
            known = told & (verdict.outcomes == _PREDICTED)
            column = layout.column(index, target.property)
            guessed = None if told.all() else parts.models[target].guessed(percept, index, following)
            if guessed is not None:
                rest = ~told & np.isfinite(guessed)
                following[rest, column] = guessed[rest]
            following[told, column] = verdict.values[told]
            verdict.outcomes[~told & (verdict.outcomes == _PREDICTED)] = _OUTSIDE
            # What is unexplained has a value only if a mode gave it, one that is too often the wrong one.
            verdict.modes[~(known | told & (verdict.outcomes == _UNEXPLAINED))] = 0
            key = (target.type, target.property)
            lost[key] = lost.get(key, nowhere) | ~known
            keys.append((layout.names[index], target.property))
            verdicts.append(verdict)
    derive(parts.schema, layout, vectors, following)
    wrap(layout, following)
    frames = tuple(_frame(parts, target) for target in parts.targets for _ in layout.of_type(target.type))
    return _stacked(layout, following, tuple(keys), verdicts, frames)


def _stacked(
    layout: SceneLayout,
    following: NDArray[np.float64],
    keys: tuple[tuple[str, str], ...],
    verdicts: Sequence[Verdict],
    frames: tuple[str, ...],
) -> BatchPrediction:
    n = len(following)
    if not verdicts:
        modes, outcomes = np.zeros((n, 0), dtype=np.int64), np.zeros((n, 0), dtype=np.int8)
        return BatchPrediction(layout, following, keys, modes, outcomes, np.zeros((n, 0)), frames)
    modes = np.stack([v.modes for v in verdicts], axis=1)
    outcomes = np.stack([v.outcomes for v in verdicts], axis=1)
    margins = np.stack([v.margins for v in verdicts], axis=1)
    return BatchPrediction(layout, following, keys, modes, outcomes, margins, frames)


def _frame(parts: Parts, target: Target) -> str:
    """Axes in which a target's contacts are described."""
    pair = None if parts.laws is None else parts.laws.learner.book.pair
    return pair.frame if pair is not None and parts.governs(target) else "world"


def derive(
    schema: SceneSchema, layout: SceneLayout, now: NDArray[np.float64], following: NDArray[np.float64]
) -> None:
    """Declared kinematics, in place: simulate, then derive (§4.8)."""
    for law in schema.derivations:
        for index in layout.of_type(law.type):
            place, rate = layout.column(index, law.property), layout.column(index, law.rate)
            source = following if law.uses_next else now
            following[:, place] = now[:, place] + law.step * source[:, rate]
