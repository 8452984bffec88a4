"""The stream as it comes: every transition is predicted before it is learned, beside learners that are shown the same.

All learn changes of values, from the scene's numbers and the action's. Online learners go along; batch learners are
fitted to the first half. Only errors of the second half count.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.baselines.changes import ONLINE, predicted_changes, titles
from relgym.config import ModelConfig
from relgym.experiments.any_env.data import STUDIES, Lesson, collect, recommended, size
from relgym.experiments.criterion import Figure
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.reports.text import Cell, table
from relgym.model.world_model import WorldModel

__all__ = ["ahead", "prequential"]

STEPS: Final = 5_000
"""Transitions of a stream."""

ENVS: Final = ("mountain", "mountain-continuous", "cart", "pendulum", "lander")
"""The envs."""


def prequential(seeds: Sequence[tuple[int, int]], *, quick: bool = False) -> Iterator[Figure]:
    """Prints a table per env, of the first seed; how the model compares with the best online baseline."""
    for name in ENVS[:1] if quick else ENVS:
        for number, (training, _) in enumerate(seeds):
            lesson = collect(STUDIES[name], 200 if quick else STEPS, training)
            sizes = _sizes(lesson, quick=quick)
            if not number:
                print(_table(name, lesson, sizes), "\n", flush=True)
            mine, *others = (sizes[key] for key in ("relgym", *ONLINE[1:]) if key in sizes)
            for prop, ratio in zip(_names(lesson), mine / np.min(others, axis=0), strict=True):
                yield f"{name}.{prop}, over the best online baseline", 1.0, float(ratio), "<="


def _sizes(lesson: Lesson, *, quick: bool) -> dict[str, NDArray[np.float64]]:
    """nRMSE-d of every learner on the second half, shape ``(d,)`` each."""
    change, x = lesson.change, lesson.before
    late = np.arange(len(x)) >= len(x) // 2
    plain, model = ahead(lesson)
    features = recommended(model)
    advised = ahead(lesson, features)[0] if features else plain
    print(f"{len(x):,} transitions; recommended: {features or 'nothing'}")
    told = {"default": plain, "relgym": advised} | predicted_changes(x, change, once=not quick)
    return {name: size(guess - change, change, late) for name, guess in told.items()}


def ahead(lesson: Lesson, features: tuple[str, ...] = ()) -> tuple[NDArray[np.float64], WorldModel]:
    """Changes that the model predicted, each before it was compared and learned from, ``(n, d)``, and the model."""
    model = WorldModel(lesson.view.schema, ModelConfig(features=features))
    found = np.zeros_like(lesson.change)
    kind = lesson.view.schema.type_of("self")
    turning = np.array([name in kind.angles for name in kind.properties])
    for k, transition in enumerate(lesson.transitions):
        said = model.predict_one(transition.before)
        change = said.scene.vector[lesson.own] - transition.before["self"].values
        found[k] = np.where(turning, np.remainder(change + np.pi, 2.0 * np.pi) - np.pi, change)
        compare_and_learn(model, transition, said, precision=lesson.view.precision)
    return found, model


def _names(lesson: Lesson) -> tuple[str, ...]:
    return lesson.view.schema.type_of("self").properties


def _table(name: str, lesson: Lesson, sizes: dict[str, NDArray[np.float64]]) -> str:
    rows: list[list[Cell]] = [
        [prop, *(f"{float(size[k]):.3g}" for size in sizes.values())] for k, prop in enumerate(_names(lesson))
    ]
    return table([f"{name}, nRMSE-d", *titles(sizes)], rows)
