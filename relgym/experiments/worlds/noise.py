"""Noise tolerance (§4.6, Figure 4.18): the expected noise swept against the true one, and estimated.

Every number that changes from step to step (targets, and what follows from them) is corrupted independently at
every step, in training and in testing. Numbers that stay what they are while an episode lasts are known exactly:
a ball whose extents are corrupted one by one is no ball.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.config import ClusteringConfig, ModelConfig
from relgym.experiments.criterion import Measure, measured
from relgym.experiments.data import ball_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.worlds.online import learned
from relgym.model.world_model import WorldModel
from relgym.scene.objects import SceneLayout
from relgym.scene.schema import SceneSchema
from relgym.thesis.model import ThesisModel

__all__ = [
    "SIGMAS",
    "VARIANCES",
    "NoiseOutcome",
    "Sigma",
    "best_sigmas",
    "corrupted",
    "moving",
    "noise_measures",
    "noise_outcomes",
    "shortfall",
]

VARIANCES: Final = (1e-20, 1e-15, 1e-10, 1e-8, 1e-5)
"""Variances of the noise, and of what is expected, as the thesis swept them."""

SIGMAS: Final = tuple(variance**0.5 for variance in VARIANCES)
"""The same as standard deviations, which is what a learner is told."""

TEST_EPISODES: Final = 40
"""Episodes of a test set: a median needs fewer than a rate of errors does."""

EXACT: Final = 1e-12
"""An error of no more than this is as good as none, in units of the property."""

Sigma: TypeAlias = float | Literal["auto"]
"""Standard deviation that a learner expects, as of `ClusteringConfig.noise_std`."""


def moving(schema: SceneSchema, layout: SceneLayout) -> list[int]:
    """Columns of what changes from step to step: the schema's targets and what its kinematics derive from them."""
    names = {(t.type, t.property) for t in schema.targets or ()}
    names |= {(k.type, k.property) for k in schema.kinematics}
    return [
        layout.column(i, prop)
        for i, kind in enumerate(layout.types)
        for prop in kind.properties
        if (kind.name, prop) in names
    ]


def corrupted(episode: Episode, variance: float, *, rng: np.random.Generator) -> Episode:
    """The episode as seen through noise: each moving number plus a draw of its own at every step.

    Parameters
    ----------
    episode
        An episode; its truth stays what it was.
    variance
        Of the noise, in squared units of each property.
    """
    columns = moving(episode.schema, episode.layout)
    vectors = episode.vectors.copy()
    vectors[:, columns] += rng.normal(scale=variance**0.5, size=(len(vectors), len(columns)))
    vectors.flags.writeable = False
    return replace(episode, vectors=vectors)


def shortfall(model: WorldModel | ThesisModel, episodes: Iterable[Episode], target: str) -> float:
    """Mode-averaged median error (§4.6): the median error of each true mode, averaged.

    All modes count the same, however rare. Where the model says nothing, the error is that of the present value.

    Parameters
    ----------
    model
        Unchanged.
    episodes
        Fresh episodes; steps without a single true mode are left out.
    target
        Such as ``ball.vy``.
    """
    kind, prop = target.split(".")
    errors: list[NDArray[np.float64]] = []
    modes: list[NDArray[np.int64]] = []
    for episode in episodes:
        (index,) = episode.layout.of_type(kind)
        column = episode.layout.column(index, prop)
        predicted = model.predict_batch(episode.layout, episode.vectors[:-1]).vectors[:, column]
        errors.append(np.abs(predicted - episode.vectors[1:, column]))
        modes.append(episode.truth.mode[target])
    error, mode = np.concatenate(errors), np.concatenate(modes)
    return float(np.mean([np.median(error[mode == m]) for m in np.unique(mode[mode >= 0])]))


@dataclass(frozen=True, slots=True)
class NoiseOutcome:
    """What became of one training under noise.

    Attributes
    ----------
    variance
        True variance of the noise.
    sigma
        What the learner expected.
    seed
        Training seed.
    found
        The noise that it ended with, by target.
    errors
        Mode-averaged median error, by target.
    modes
        Number of modes, by target.
    """

    variance: float
    sigma: Sigma
    seed: int
    found: Mapping[str, float]
    errors: Mapping[str, float]
    modes: Mapping[str, int]


def noise_outcomes(
    *,
    training: Iterable[int],
    test: int,
    sigmas: Mapping[float, Sequence[Sigma]],
    episodes: int | None = None,
    test_episodes: int = TEST_EPISODES,
) -> Iterator[NoiseOutcome]:
    """Train and test on experiment 1 through noise; outcomes as they come.

    Parameters
    ----------
    training, test
        Seeds.
    sigmas
        Per true variance: the standard deviations to expect.
    episodes, test_episodes
        How many episodes to train and to test on; default of the former: as many as in the thesis.
    """
    for seed in training:
        clean = list(ball_episodes(1, seed=seed, episodes=episodes))
        fresh = list(ball_episodes(1, seed=test, episodes=test_episodes, test=True))
        for number, (variance, expected) in enumerate(sorted(sigmas.items())):
            taught = _through_noise(clean, variance, np.random.default_rng([seed, number]))
            tested = _through_noise(fresh, variance, np.random.default_rng([seed, number, test]))
            for sigma in expected:
                yield _outcome(taught, tested, variance, sigma, seed)


def _through_noise(episodes: Iterable[Episode], variance: float, rng: np.random.Generator) -> list[Episode]:
    return [corrupted(episode, variance, rng=rng) for episode in episodes]


def _outcome(
    taught: Sequence[Episode], tested: Sequence[Episode], variance: float, sigma: Sigma, seed: int
) -> NoiseOutcome:
    config = ModelConfig(frames="world", clustering=ClusteringConfig(noise_std=sigma))
    model = learned(taught, config=config)
    parts = {str(t): model.property_model(t.type, t.property) for t in model.targets}
    return NoiseOutcome(
        variance,
        sigma,
        seed,
        found={name: part.clusterer.scale.sigma for name, part in parts.items()},
        errors={name: shortfall(model, tested, name) for name in parts},
        modes={name: len(part.modes) for name, part in parts.items()},
    )


def best_sigmas(outcomes: Iterable[NoiseOutcome]) -> dict[tuple[float, str], float]:
    """The hand-set standard deviation of least median error over seeds, by true variance and target."""
    errors: dict[tuple[float, str], dict[float, list[float]]] = {}
    for outcome in outcomes:
        if outcome.sigma != "auto":
            for target, error in outcome.errors.items():
                errors.setdefault((outcome.variance, target), {}).setdefault(outcome.sigma, []).append(error)
    return {key: min(found, key=lambda sigma: (median(found[sigma]), sigma)) for key, found in errors.items()}


def noise_measures(
    outcomes: Iterable[NoiseOutcome], best: Mapping[tuple[float, str], float]
) -> list[Measure]:
    """Error with the estimated noise over that with the best hand-set one, one figure per training seed.

    Parameters
    ----------
    outcomes
        On the reporting seeds: for each variance those of "auto", and those of the best hand-set values.
    best
        What `best_sigmas` chose on other seeds.
    """
    errors = {(o.variance, o.sigma, o.seed, t): error for o in outcomes for t, error in o.errors.items()}
    seeds = sorted({seed for _, _, seed, _ in errors})
    found = []
    for (variance, target), sigma in sorted(best.items()):
        pairs = [[errors[variance, each, seed, target] for each in ("auto", sigma)] for seed in seeds]
        ratios = [0.0 if auto <= EXACT else auto / hand for auto, hand in pairs]
        found.append(measured(f"variance {variance:g}, {target}: auto / sigma {sigma:.1e}", 1.5, ratios))
    return found
