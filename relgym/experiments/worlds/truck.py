"""The box pushing domain beyond Table 3.1: constants per episode, bystanders, other numbers of boxes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any, Final

import numpy as np

from relgym.experiments.analytic import truck_modes
from relgym.experiments.benchmark import Shown
from relgym.experiments.criterion import measured
from relgym.experiments.data import truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import ModeErrors, evaluate
from relgym.experiments.truck_check import truck_mode_of
from relgym.experiments.worlds.online import learned
from relgym.model.world_model import WorldModel
from relgym.scene.schema import SceneSchema

__all__ = ["bystanders", "counts", "per_episode"]

LARGEST: Final = 5
"""Among so many of the largest modes the true ones must be."""

BYSTANDERS: Final = (2, 3, 4, 5, 6, 7)
COUNTS: Final = (2, 3, 4)

_REPEATS: Final = {2: 12, 3: 2, 4: 1}  # so that every law has some hundred examples
_EVERY: Final = 40  # of 1,920 episodes with five boxes


def per_episode(training: Sequence[int], tests: Sequence[int]) -> Shown:
    """Learn episodes whose force and frictions are constant within each; test on fresh ones. One figure per seed."""
    laws = truck_modes(3)
    found, wrong, notes, exact = [], [], list[str](), 0
    for seed in training:
        model = learned(truck_episodes("episode", seed=seed))
        part = model.property_model("truck", "vx")
        largest = sorted(part.modes, key=lambda mode: -mode.examples)[:LARGEST]
        found.append(len({truck_mode_of(mode, laws) for mode in largest} - {None}))
        spurious = tuple(mode.formula() for mode in part.modes if truck_mode_of(mode, laws) is None)
        exact += found[-1] == 3 and not spurious
        if spurious:
            notes.append(f"other modes: {spurious}; noise: {part.clusterer.noise_examples}")
        wrong.append(_errors(model, truck_episodes("episode", seed=tests[0], test=True)).rate)
    measures = [
        measured("rows of Table 3.1 among the five largest modes", 3, found, ">="),
        measured("wrong on fresh episodes", 0.01, wrong),
    ]
    return Shown(measures, [f"exactly three modes: {exact} of {len(training)} seeds", *notes])


def bystanders(training: Sequence[int], tests: Sequence[int]) -> Shown:
    """Boxes that stand beside the track, and other numbers of boxes in the row; one figure per training seed."""
    beside = [_beside_the_track(seed, tests[0]) for seed in training]
    counted = [counts(seed=seed, test=tests[0]) for seed in training]
    return Shown(
        [
            measured("wrong with 2-7 bystanders", 0.001, [wrong for wrong, _ in beside]),
            measured("guessed wrongly where bystanders are new", 0.0, [guessed for _, guessed in beside]),
            measured("wrong with 2, 3 and 4 boxes", 0.001, [wrong for wrong, _ in counted]),
            measured("guessed where a layout is new", 0.0, [guessed for _, guessed in counted]),
        ]
    )


def _beside_the_track(seed: int, test: int) -> tuple[float, float]:
    """Learn scenes in which 2 to 7 boxes stand beside the track, shuffled; test on fresh ones.

    Without any bystander in the lessons nothing teaches that a box has to be in the row to count: a second model,
    which saw none, should abstain where it can't tell.

    Returns
    -------
    Largest share of wrong predictions, of any number of bystanders; and of scenes of which the model that never saw any
    says something wrong.
    """
    rng = np.random.default_rng(seed)
    taught = [b for n in BYSTANDERS for b in _beside(islice(_rows(n, seed), n % 2, None, 2))]
    model = learned([taught[k] for k in rng.permutation(len(taught))])
    alone = learned(_beside(_rows(0, seed)))
    fresh = [_beside(_rows(n, test, fresh=True)) for n in BYSTANDERS]
    said = [_errors(alone, episodes) for episodes in fresh]
    guessed = max((each.wrong - each.abstained) / each.examples for each in said)
    return max(_errors(model, episodes).rate for episodes in fresh), guessed


def _rows(n: int, seed: int, *, fresh: bool = False) -> Iterator[Episode]:
    return truck_episodes(seed=seed, repeats=1, bystanders=n, test=fresh)


def _beside(episodes: Iterable[Episode]) -> list[Episode]:
    """The episodes in a schema that has the most bystanders."""
    return _in_schema(next(_rows(max(BYSTANDERS), 0)).schema, episodes)


def counts(*, seed: int, test: int) -> tuple[float, float]:
    """Learn scenes with 2, 3 and 4 boxes, shuffled; test on fresh ones, and on scenes with 5.

    Returns
    -------
    Largest share of wrong predictions, of any number of boxes; and of predictions of layouts of five boxes that a mode
    made instead of abstaining.
    """
    rng = np.random.default_rng(seed)
    taught = [episode for n in COUNTS for episode in _among(n_boxes=n, seed=seed, repeats=_REPEATS[n])]
    model = learned([taught[k] for k in rng.permutation(len(taught))])
    fresh = [_among(n_boxes=n, seed=test, repeats=1, test=True) for n in COUNTS]
    new = islice(truck_episodes(seed=test, n_boxes=max(COUNTS) + 1, repeats=1, test=True), 0, None, _EVERY)
    spoken = _errors(model, list(new))
    guessed = 1.0 - spoken.abstained / spoken.examples
    return max(_errors(model, episodes).rate for episodes in fresh), guessed


def _among(**options: Any) -> list[Episode]:
    """Episodes with some of the boxes, in a schema that has the most."""
    return _in_schema(next(truck_episodes(seed=0, n_boxes=max(COUNTS))).schema, truck_episodes(**options))


def _in_schema(schema: SceneSchema, episodes: Iterable[Episode]) -> list[Episode]:
    return [
        replace(episode, schema=schema, layout=schema.layout(episode.layout.names)) for episode in episodes
    ]


def _errors(model: WorldModel, episodes: Iterable[Episode]) -> ModeErrors:
    return evaluate(model, episodes)["truck.vx"].total
