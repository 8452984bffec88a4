"""Guesses where a model abstains: what its laws say of an object itself and of the action, all others left out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from relgym.clustering.mode import Mode
from relgym.model.predicting.prediction import OUTCOMES, BatchPrediction, Outcome
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Float1D, Float2D, SceneLayout

__all__ = ["Guessing"]

_ABSTAINED: Final = [OUTCOMES.index(each) for each in (Outcome.NO_ROLES, Outcome.OUTSIDE)]
"""Where a law is missing; where laws were wrong too often, what served best instead stays as it is."""


@dataclass(frozen=True, slots=True)
class _BareLaw:
    """The target's column, weights of all columns, and the least and the most that it may be."""

    column: int
    weights: Float1D
    least: float
    most: float


class Guessing:
    """Predicts as a model does, but nowhere that a property keeps its value because nobody plays a law's roles.

    A law says nothing where one of its roles is open: less the friction of the box beneath, and there is none. Most of
    it is known all the same, what the object itself and the action contribute. So that is the guess: the law that most
    examples follow without the terms of other bodies. What they contribute often stays the same for an episode, and
    then so does what the guess is off by, which a planner corrects after one step (`Correctable`); that nothing
    changes would be off by something else after each action.

    Parameters
    ----------
    model
        Who predicts.

    Notes
    -----
    Cost: where it guesses a second prediction, of the scene in which the property already has its next value: what
    depends on it follows from there.
    """

    def __init__(self, model: WorldModel) -> None:
        self._model = model
        self._laws: dict[SceneLayout, dict[int, _BareLaw]] = {}

    def predict_batch(self, layout: SceneLayout, vectors: Float2D) -> BatchPrediction:
        """As `WorldModel.predict_batch`; what is guessed still isn't claimed."""
        told = self._model.predict_batch(layout, vectors)
        if told.ok.all():
            return told
        if layout not in self._laws:
            self._laws[layout] = _bare_laws(self._model, layout, told.parts)
        laws = self._laws[layout]
        abstaining = {k: _kept(told, k, law.column, vectors) for k, law in laws.items()}
        rows = np.flatnonzero(np.any([*abstaining.values(), np.zeros(len(vectors), dtype=np.bool_)], axis=0))
        if not len(rows):
            return told
        moved = vectors[rows].copy()
        for k, law in laws.items():
            here = abstaining[k][rows]
            moved[here, law.column] = np.clip(vectors[rows[here]] @ law.weights, law.least, law.most)
        again = self._model.predict_batch(layout, moved)
        good = np.ones(len(rows), dtype=np.bool_)
        for k, law in laws.items():  # from another value another mode may hold: then that was no next value
            good &= ~abstaining[k][rows] | _kept(again, k, law.column, moved)
        found = told.vectors.copy()
        found[rows[good]] = again.vectors[good]
        return replace(told, vectors=found)


def _kept(
    told: BatchPrediction, part: int, column: int, before: Float2D
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """In which scenes a part keeps its value since no law holds, shape ``(n,)``."""
    same = told.vectors[:, column] == before[:, column]
    found: np.ndarray[tuple[int], np.dtype[np.bool_]] = same & np.isin(told.outcomes[:, part], _ABSTAINED)
    return found


def _bare_laws(
    model: WorldModel, layout: SceneLayout, parts: tuple[tuple[str, str], ...]
) -> dict[int, _BareLaw]:
    """By position among the parts: laws that say that something changes."""
    found: dict[int, _BareLaw] = {}
    for k, (name, prop) in enumerate(parts):
        own = layout.index(name)
        known = model.property_model(layout.types[own].name, prop)
        modes = [mode for mode in known.modes if mode.frame == "world" and mode.id not in known.limits]
        if not modes:
            continue
        column, weights = layout.column(own, prop), np.zeros(layout.width)
        for at, weight in _bare_terms(max(modes, key=lambda mode: (mode.examples, -mode.id)), layout, own):
            weights[at] += weight
        same = np.zeros(layout.width)
        same[column] = 1.0
        if weights.any() and not np.array_equal(weights, same):
            found[k] = _BareLaw(column, weights, known.limits.least, known.limits.most)
    return found


def _bare_terms(mode: Mode, layout: SceneLayout, own: int) -> list[tuple[int, float]]:
    """Columns and weights of the target's terms, and of those of bodiless objects that are alone of their type."""
    found: list[tuple[int, float]] = []
    for place, role in enumerate(mode.roles):
        players = [own] if place == 0 else [k for k, t in enumerate(layout.types) if t.name == role.type]
        if place and (len(players) != 1 or layout.types[players[0]].has_body):
            continue
        properties = layout.types[players[0]].properties
        found += [(layout.column(players[0], prop), w) for prop, w in role.terms if prop in properties]
    return found
