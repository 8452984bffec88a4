"""LunarLander: flight, of which engines that fire as they like leave a good part open, and the legs' contacts.

Flight are the transitions that touch nothing before and after, and don't end the episode. Errors there are compared
with least squares on the features of the law itself (sines and cosines of the tilt, for each engine), fitted to flight
alone, which no learner that doesn't know what flight is can beat; and with an ensemble of nets trained on the same
transitions.

A leg that was pushed in swings back when it has left the ground, and turns the lander by twenty to sixty standard
deviations in a step in which no leg touches: its hinge isn't observed, so that no function of the observation
predicts it. A handful of such steps in ten thousand decides the error of w. Hence two more figures: what least
squares leave that were fitted, in hindsight, to the very transitions evaluated on; and w in *settled* flight, from the
second step after the last touch on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.baselines.base import Regressor
from relgym.config import ModelConfig
from relgym.experiments.any_env.data import STUDIES, Lesson, collect, errors, learned, recommended, size
from relgym.experiments.criterion import Figure
from relgym.model.world_model import WorldModel

__all__ = ["agreement", "flight", "flying", "settled"]

TRAIN, TEST = 5_000, 10_000
"""Transitions learned from and evaluated on."""

FLOOR: Final = {"vx": 0.37, "vy": 0.32}
"""What least squares leaves of vx and vy (one seed), of which the limit is 10 % more."""

SPIN: Final = 0.3
"""Largest nRMSE-d of w."""


def flying(lesson: Lesson) -> NDArray[np.bool_]:
    """Transitions in which neither leg touches anything and the episode doesn't end, shape ``(n,)``."""
    before, after = lesson.before[:, lesson.own], lesson.after
    touching = (before[:, 6:8] != 0.0).any(axis=1) | (after[:, 6:8] != 0.0).any(axis=1)
    found: NDArray[np.bool_] = ~touching & ~lesson.terminated
    return found


def settled(lesson: Lesson) -> NDArray[np.bool_]:
    """Flight in the step before which nothing was touched either, shape ``(n,)``; episodes begin settled."""
    flies, before, after = flying(lesson), lesson.before[:, lesson.own], lesson.after
    goes_on = np.append(False, (before[1:] == after[:-1]).all(axis=1))
    touched = (before[:, 6:8] != 0.0).any(axis=1) | (after[:, 6:8] != 0.0).any(axis=1)
    found: NDArray[np.bool_] = flies & ~(goes_on & np.append(False, touched[:-1]))
    return found


def flight(seeds: Sequence[tuple[int, int]], *, quick: bool = False) -> Iterator[Figure]:
    """Errors in flight by property, of the model, of least squares and of nets; modes against leg flags."""
    for number, (training, test) in enumerate(seeds):
        lesson = collect(STUDIES["lander"], 600 if quick else TRAIN, training)
        fresh = collect(STUDIES["lander"], 500 if quick else TEST, 2_000 + test)
        model = _model(lesson, verbose=not number, quick=quick)
        yield from _compared(model, lesson, fresh, nets=not quick)


def _model(lesson: Lesson, *, verbose: bool, quick: bool) -> WorldModel:
    features = ("trig", "products") if quick else recommended(plain := learned(lesson))
    model = learned(lesson, ModelConfig(features=features))
    if verbose and not quick:
        print(
            f"recommended: {features or 'nothing'}",
            *[f"default, {a.target}: {a}" for a in plain.advice()],
            sep="\n",
        )
        print(model.describe(digits=4))
    return model


def _compared(model: WorldModel, lesson: Lesson, fresh: Lesson, *, nets: bool) -> Iterator[Figure]:
    names = lesson.view.schema.type_of("self").properties
    flies, calm, change = flying(fresh), settled(fresh), fresh.change

    def sizes(error: NDArray[np.float64], rows: NDArray[np.bool_] = flies) -> dict[str, float]:
        return dict(zip(names, size(error, change, rows), strict=True))

    missed = errors(model, fresh)
    own, floor = sizes(missed), sizes(_least_squares(lesson, fresh) - change)
    for p, limit in FLOOR.items():
        yield f"{p}, flight", 1.1 * limit, own[p], "<="
    yield "w, flight", SPIN, own["w"], "<="
    hindsight = sizes(_least_squares(fresh, fresh) - change)["w"]
    yield "w, what least squares fitted in hindsight leave in flight", SPIN, hindsight, "<="
    yield "w, settled flight", SPIN, sizes(missed, calm)["w"], "<="
    for p in (*FLOOR, "w"):
        yield f"{p}, over least squares on the law's features", 1.1, own[p] / floor[p], "<="
    if nets and find_spec("torch") is not None:
        baseline = sizes(_nets(lesson, fresh) - change)
        for p in ("px", "py", "vx", "vy", "th", "w"):
            yield f"{p}, over an MLP ensemble", 1.0, own[p] / baseline[p], "<="
    yield "vx: law or not, agreement with the leg flags", 0.95, agreement(model, lesson), ">="


def agreement(model: WorldModel, lesson: Lesson) -> float:
    """Share of the training transitions of which vx's largest mode holds in flight, and no other time."""
    part = model.property_model("self", "vx")
    largest = max(part.modes, key=lambda m: m.examples).id
    return float(((part.clusterer.labels == largest) == flying(lesson)[-len(part.clusterer.labels) :]).mean())


def _least_squares(lesson: Lesson, fresh: Lesson) -> NDArray[np.float64]:
    """Changes by least squares on the law's own features, fitted to flight alone, shape ``(n, d)``."""
    rows = flying(lesson)
    weights = np.linalg.lstsq(_features(lesson)[rows], lesson.change[rows], rcond=None)[0]
    found: NDArray[np.float64] = _features(fresh) @ weights
    return found


def _features(lesson: Lesson) -> NDArray[np.float64]:
    state, engines = lesson.before[:, lesson.own][:, :6], lesson.before[:, lesson.action][:, 1:]
    tilt = state[:, 4:5]
    return np.hstack([state, engines, np.cos(tilt) * engines, np.sin(tilt) * engines])


def _nets(lesson: Lesson, fresh: Lesson) -> NDArray[np.float64]:
    """Changes by an ensemble of nets trained on all transitions, shape ``(n, d)``."""
    from relgym.baselines.ensemble import MLPEnsemble

    nets: Regressor = MLPEnsemble(hidden=128, train_every=len(lesson.transitions), train_steps=4_000, seed=0)
    for x, y in zip(lesson.before, lesson.change, strict=True):
        nets.learn_one(x, y)
    return nets.predict_batch(fresh.before)
