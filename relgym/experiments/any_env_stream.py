"""The stream as it comes: every transition is predicted before it is learned, beside learners that are shown the same.

All learn changes of values, from the scene's numbers and the action's. Online learners go along; batch learners are
fitted to the first half. Only errors of the second half count.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.baselines.base import Float1D, Float2D, Regressor
from relgym.baselines.catalogue import make_regressor
from relgym.baselines.fitted import FittedRegressor
from relgym.baselines.kinds import Columns
from relgym.config import ModelConfig
from relgym.experiments.any_env_data import STUDIES, Lesson, collect, recommended
from relgym.experiments.bar import Measure, measured
from relgym.model.text import Cell, table
from relgym.model.world_model import WorldModel

__all__ = ["LastChange", "ahead", "prequential"]

STEPS: Final = 5_000
"""Transitions of a stream."""

ENVS: Final = ("mountain", "mountain-continuous", "cart", "pendulum", "lander")
"""The envs of rows 1 to 3 and 5."""

ONLINE: Final = ("rls", "hoeffding", "amrules")
"""Online baselines by name, beside constant velocity."""


class LastChange:
    """Constant velocity: what changed by so much in the last step does so again."""

    def __init__(self) -> None:
        self._last: Float1D = np.zeros(1)

    def learn_one(self, x: Float1D, y: Float1D) -> None:
        """Remember the change."""
        self._last = y

    def predict_one(self, x: Float1D) -> Float1D:
        """The last change."""
        return self._last

    def predict_batch(self, x: Float2D) -> Float2D:
        """The last change, for every row."""
        return np.tile(self._last, (len(x), 1))


def prequential(seeds: Sequence[tuple[int, int]], *, quick: bool = False) -> list[Measure]:
    """Row 8: prints a table per env, of the first seed; how the model compares with the best online baseline."""
    found = []
    for name in ENVS[:1] if quick else ENVS:
        ratios: dict[str, list[float]] = {}
        for number, (training, _) in enumerate(seeds):
            lesson = collect(STUDIES[name], 400 if quick else STEPS, training)
            sizes = _sizes(lesson, quick=quick)
            if not number:
                print(_table(name, lesson, sizes), "\n", flush=True)
            mine, *others = (sizes[key] for key in ("relgym", "constant velocity", *ONLINE) if key in sizes)
            for prop, ratio in zip(_names(lesson), mine / np.min(others, axis=0), strict=True):
                ratios.setdefault(prop, []).append(float(ratio))
        found += [measured(f"{name}.{p}, over the best online baseline", 1.0, v) for p, v in ratios.items()]
    return found


def _sizes(lesson: Lesson, *, quick: bool) -> dict[str, NDArray[np.float64]]:
    """nRMSE-d of every learner on the second half, shape ``(d,)`` each."""
    half = len(lesson.transitions) // 2
    change = lesson.change
    x, width = lesson.before, change.shape[1]
    spread = np.maximum(change[half:].std(axis=0), 1e-12)

    def size(guess: NDArray[np.float64]) -> NDArray[np.float64]:
        found: NDArray[np.float64] = np.sqrt(np.square(guess[-half:] - change[-half:]).mean(axis=0)) / spread
        return found

    plain, model = ahead(lesson)
    found = {"default": size(plain)}
    features = recommended(model)
    found["relgym"] = size(ahead(lesson, features)[0]) if features else found["default"]
    print(f"{len(x):,} transitions; recommended: {features or 'nothing'}")
    found["constant velocity"] = size(_along(LastChange(), x, change))
    for name in ONLINE if find_spec("river") else ONLINE[:1]:
        learner = make_regressor(name, columns=Columns(tuple(range(width))), rng=np.random.default_rng(0))
        found[name] = size(_along(learner, x, change))
    for name, learner in _batch(quick=quick).items():
        for row, y in zip(x[:half], change[:half], strict=True):
            learner.learn_one(row, y)
        found[name] = size(learner.predict_batch(x[half:]))
    return found


def ahead(lesson: Lesson, features: tuple[str, ...] = ()) -> tuple[NDArray[np.float64], WorldModel]:
    """Changes that the model foretold, shape ``(n, d)``, and the model."""
    model = WorldModel(lesson.view.schema, ModelConfig(features=features))
    found = np.zeros_like(lesson.change)
    kind = lesson.view.schema.type_of("self")
    turning = np.array([name in kind.angles for name in kind.properties])
    for k, transition in enumerate(lesson.transitions):
        change = (
            model.predict_one(transition.before).scene.vector[lesson.own]
            - lesson.transitions[k].before["self"].values
        )
        found[k] = np.where(turning, np.remainder(change + np.pi, 2.0 * np.pi) - np.pi, change)
        model.learn_one(transition)
    return found, model


def _along(learner: Regressor, x: Float2D, change: Float2D) -> NDArray[np.float64]:
    """What an online learner foretold; the first row teaches only."""
    found = np.zeros_like(change)
    learner.learn_one(x[0], change[0])
    for k in range(1, len(x)):
        found[k] = learner.predict_one(x[k])
        learner.learn_one(x[k], change[k])
    return found


def _batch(*, quick: bool) -> dict[str, Regressor]:
    """Learners that are fitted once."""
    found: dict[str, Regressor] = {}
    columns, rng = Columns(()), np.random.default_rng(0)
    if find_spec("sklearn") is not None:

        def tree() -> object:
            from sklearn.tree import DecisionTreeRegressor

            return DecisionTreeRegressor(min_samples_leaf=3, random_state=0)

        found["tree"] = FittedRegressor(tree, rng=rng, scale=False)
        found["forest"] = make_regressor("forest", columns=columns, rng=rng)
    if find_spec("torch") is not None and not quick:
        from relgym.baselines.ensemble import MLPEnsemble

        found["MLP ensemble"] = MLPEnsemble(hidden=128, train_every=STEPS // 2, train_steps=3_000, seed=0)
    return found


def _names(lesson: Lesson) -> tuple[str, ...]:
    return lesson.view.schema.type_of("self").properties


def _table(name: str, lesson: Lesson, sizes: dict[str, NDArray[np.float64]]) -> str:
    rows: list[list[Cell]] = [
        [prop, *(f"{float(size[k]):.3g}" for size in sizes.values())] for k, prop in enumerate(_names(lesson))
    ]
    return table([f"{name}, nRMSE-d", *sizes], rows)
