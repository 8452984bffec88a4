"""The box pushing domain beyond Table 3.1: constants per episode, bystanders, other numbers of boxes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, Final

import numpy as np

from relgym.config import ModelConfig
from relgym.experiments.analytic import truck_modes
from relgym.experiments.criterion import Measure, measured
from relgym.experiments.data import truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import evaluate
from relgym.experiments.truck_check import truck_mode_of
from relgym.experiments.worlds.online import learned
from relgym.model.world_model import WorldModel
from relgym.scene.schema import SceneSchema

__all__ = [
    "BystanderOutcome",
    "CountOutcome",
    "PerEpisodeOutcome",
    "bystander_measures",
    "bystanders",
    "counts",
    "per_episode",
    "per_episode_measures",
]

LARGEST: Final = 5
"""Among so many of the largest modes the true ones must be."""

BYSTANDERS: Final = (2, 3, 4, 5, 6, 7)
COUNTS: Final = (2, 3, 4)

_REPEATS: Final = {2: 12, 3: 2, 4: 1}  # so that every law has some hundred examples
_EVERY: Final = 40  # of 1,920 episodes with five boxes


@dataclass(frozen=True, slots=True)
class PerEpisodeOutcome:
    """What became of constants that are drawn once an episode.

    Attributes
    ----------
    found
        How many rows of Table 3.1 are among the five largest modes.
    modes
        Formulas of the other modes.
    noise
        Training examples that no mode explains.
    wrong
        Share of wrong predictions on fresh episodes.
    """

    found: int
    spurious: tuple[str, ...]
    noise: int
    wrong: float


def per_episode(*, seed: int, test: int, config: ModelConfig | None = None) -> PerEpisodeOutcome:
    """Learn episodes whose force and frictions are constant within each; test on fresh ones."""
    model = learned(truck_episodes("episode", seed=seed), config=config)
    part = model.property_model("truck", "vx")
    largest = sorted(part.modes, key=lambda mode: -mode.examples)[:LARGEST]
    laws = truck_modes(3)
    stated = {truck_mode_of(mode, laws) for mode in largest} - {None}
    spurious = tuple(mode.formula() for mode in part.modes if truck_mode_of(mode, laws) is None)
    wrong = _wrong(model, truck_episodes("episode", seed=test, test=True))
    return PerEpisodeOutcome(len(stated), spurious, part.clusterer.noise_examples, wrong)


def per_episode_measures(outcomes: Iterable[PerEpisodeOutcome]) -> list[Measure]:
    """One figure per training seed."""
    runs = list(outcomes)
    return [
        measured("rows of Table 3.1 among the five largest modes", 3, [run.found for run in runs], ">="),
        measured("wrong on fresh episodes", 0.01, [run.wrong for run in runs]),
    ]


@dataclass(frozen=True, slots=True)
class BystanderOutcome:
    """What bystanders do to a model.

    Attributes
    ----------
    wrong
        Share of wrong predictions on fresh scenes, by number of bystanders.
    guessed
        Share of scenes with bystanders of which a model that never saw any says something wrong, by their number.
    """

    wrong: dict[int, float]
    guessed: dict[int, float]


def bystanders(*, seed: int, test: int, config: ModelConfig | None = None) -> BystanderOutcome:
    """Learn scenes in which 2 to 7 boxes stand beside the track, shuffled; test on fresh ones.

    Without any bystander in the lessons nothing teaches that a box has to be in the row to count: a second model,
    which saw none, should abstain where it can't tell.
    """
    rng = np.random.default_rng(seed)
    taught = [b for n in BYSTANDERS for b in _beside(islice(_rows(n, seed), n % 2, None, 2))]
    model = learned([taught[k] for k in rng.permutation(len(taught))], config=config)
    alone = learned(_beside(_rows(0, seed)), config=config)
    fresh = {n: _beside(_rows(n, test, fresh=True)) for n in BYSTANDERS}
    guessed = {n: _guessed(alone, episodes) for n, episodes in fresh.items()}
    return BystanderOutcome({n: _wrong(model, episodes) for n, episodes in fresh.items()}, guessed)


def _rows(n: int, seed: int, *, fresh: bool = False) -> Iterator[Episode]:
    return truck_episodes(seed=seed, repeats=1, bystanders=n, test=fresh)


def _beside(episodes: Iterable[Episode]) -> list[Episode]:
    """The episodes in a schema that has the most bystanders."""
    return _in_schema(next(_rows(max(BYSTANDERS), 0)).schema, episodes)


@dataclass(frozen=True, slots=True)
class CountOutcome:
    """How a model of scenes with 2, 3 and 4 boxes does on fresh ones, and on layouts that it has never seen.

    Attributes
    ----------
    wrong
        Share of wrong predictions by number of boxes.
    guessed
        Share of wrong predictions on layouts of five boxes that a mode made instead of abstaining.
    """

    wrong: dict[int, float]
    guessed: float


def counts(*, seed: int, test: int, config: ModelConfig | None = None) -> CountOutcome:
    """Learn scenes with 2, 3 and 4 boxes, shuffled; test on fresh ones, and on scenes with 5."""
    rng = np.random.default_rng(seed)
    taught = [episode for n in COUNTS for episode in _among(n_boxes=n, seed=seed, repeats=_REPEATS[n])]
    model = learned([taught[k] for k in rng.permutation(len(taught))], config=config)
    fresh = {n: _among(n_boxes=n, seed=test, repeats=1, test=True) for n in COUNTS}
    new = islice(truck_episodes(seed=test, n_boxes=max(COUNTS) + 1, repeats=1, test=True), 0, None, _EVERY)
    spoken = evaluate(model, list(new))["truck.vx"].total
    guessed = 1.0 - spoken.abstained / spoken.examples
    return CountOutcome({n: _wrong(model, episodes) for n, episodes in fresh.items()}, guessed)


def bystander_measures(beside: Sequence[BystanderOutcome], counted: Sequence[CountOutcome]) -> list[Measure]:
    """One figure per training seed."""
    return [
        measured("wrong with 2-7 bystanders", 0.001, [max(run.wrong.values()) for run in beside]),
        measured(
            "guessed wrongly where bystanders are new", 0.0, [max(run.guessed.values()) for run in beside]
        ),
        measured("wrong with 2, 3 and 4 boxes", 0.001, [max(run.wrong.values()) for run in counted]),
        measured("guessed where a layout is new", 0.0, [run.guessed for run in counted]),
    ]


def _among(**options: Any) -> list[Episode]:
    """Episodes with some of the boxes, in a schema that has the most."""
    return _in_schema(next(truck_episodes(seed=0, n_boxes=max(COUNTS))).schema, truck_episodes(**options))


def _in_schema(schema: SceneSchema, episodes: Iterable[Episode]) -> list[Episode]:
    return [
        replace(episode, schema=schema, layout=schema.layout(episode.layout.names)) for episode in episodes
    ]


def _wrong(model: WorldModel, episodes: Iterable[Episode]) -> float:
    return evaluate(model, episodes)["truck.vx"].total.rate


def _guessed(model: WorldModel, episodes: Iterable[Episode]) -> float:
    total = evaluate(model, episodes)["truck.vx"].total
    return (total.wrong - total.abstained) / total.examples
