"""Baselines on the ball experiments: trained like our learner, tested on the same examples (§4.7)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from time import perf_counter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.baselines.base import Classifier, Regressor
from relgym.baselines.catalogue import CLASSIFIERS, REGRESSORS, Columns, make_classifier, make_regressor
from relgym.baselines.features import Features, columns, features
from relgym.experiments.chapter4.lesson import fresh_episodes, taught_episodes
from relgym.experiments.chapter4.scores import target_score
from relgym.experiments.chapter4.testing import TARGETS, true_modes
from relgym.experiments.chapter4.weight import weight_of
from relgym.experiments.data import BALL_EXPERIMENTS
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import TOLERANCE, explicable, mode_labels

__all__ = ["classify", "regress"]

_VELOCITY: Final = ("vx", "vy")


def regress(
    *,
    baseline: str,
    shown: str,
    experiment: int,
    seed: int,
    order: int,
    checkpoints: Sequence[int],
    tests: Mapping[str, Any],
    setting: int = 0,
) -> dict[str, Any]:
    """Train a regressor on one batch; test after some numbers of episodes.

    Parameters
    ----------
    baseline
        One of `relgym.baselines.catalogue.REGRESSORS`.
    shown
        Which features it sees, of `relgym.baselines.features.FEATURES`.
    experiment, seed, order, checkpoints, tests
        As for our learner (`relgym.experiments.chapter4.lesson.lesson`).
    setting
        Number of the setting (`relgym.baselines.tuned.setting_of` has the one that is reported).

    Returns
    -------
    Plain data: scores by checkpoint and target; seconds spent on learning and on all tests, bytes that it keeps.
    """
    known = REGRESSORS[baseline]
    episodes = list(taught_episodes(experiment, seed, order, checkpoints[-1]))
    fresh = fresh_episodes(experiment, tests)
    seen = features(shown, episodes[0].schema, "ball")
    velocity = columns(seen, _VELOCITY)
    rng = np.random.default_rng([seed, order])
    meaning = Columns(velocity, seen.own, seen.objects)
    model = make_regressor(baseline, known.settings[setting], columns=meaning, rng=rng)
    questions, answers = _examples(fresh, seen)

    def teach(episode: Episode) -> None:
        _teach(model, *_examples([episode], seen), velocity if known.change else ())

    def ask() -> NDArray[np.float64]:
        predicted = model.predict_batch(questions)
        return predicted + (questions[:, list(velocity)] if known.change else 0.0)

    def scored(predicted: NDArray[np.float64]) -> dict[str, Any]:
        return _scores(predicted, answers, fresh, experiment)

    course = _course(episodes, checkpoints, teach, ask, scored)
    return {**course, "setting": dict(known.settings[setting]), "bytes": weight_of(model)}


def _course(
    episodes: Sequence[Episode],
    checkpoints: Sequence[int],
    teach: Callable[[Episode], None],
    ask: Callable[[], Any],
    scored: Callable[[Any], dict[str, Any]],
) -> dict[str, Any]:
    """Scores after some numbers of episodes, and seconds spent on learning and on all tests."""
    scores, learning, asking = [], 0.0, 0.0
    for count, episode in enumerate(episodes, start=1):
        start = perf_counter()
        teach(episode)
        learning += perf_counter() - start
        if count in checkpoints:
            start = perf_counter()
            said = ask()
            asking += perf_counter() - start
            scores.append({"episodes": count, "targets": scored(said)})
    return {"scores": scores, "learning": learning, "asking": asking}


def _teach(model: Regressor, x: NDArray[np.float64], y: NDArray[np.float64], present: Sequence[int]) -> None:
    values = y - x[:, list(present)] if present else y
    for row, value in zip(x, values, strict=True):
        model.learn_one(row, value)


def _examples(episodes: Sequence[Episode], seen: Features) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Features and next velocities of all transitions."""
    x = [seen.rows(episode.layout, episode.vectors[:-1]) for episode in episodes]
    y = [episode.columns("ball", *_VELOCITY)[1:] for episode in episodes]
    return np.concatenate(x), np.concatenate(y)


def _scores(
    predicted: NDArray[np.float64], actual: NDArray[np.float64], episodes: Sequence[Episode], experiment: int
) -> dict[str, Any]:
    laws = BALL_EXPERIMENTS[experiment].modes()
    names = mode_labels(laws)
    before = np.concatenate([b.columns("ball", *_VELOCITY)[:-1] for b in episodes])
    counted = [explicable(b, laws) for b in episodes]
    found = {}
    for k, target in enumerate(TARGETS):
        found[target] = target_score(
            names[target],
            np.concatenate([true_modes(b, target, laws) for b in episodes]),
            np.concatenate([c[target] for c in counted]),
            np.abs(predicted[:, k] - actual[:, k]),
            np.zeros(len(actual), dtype=np.bool_),
            None,
            actual[:, k] - before[:, k],
        )
    return found


def classify(
    *,
    baseline: str,
    shown: str,
    experiment: int,
    seed: int,
    order: int,
    checkpoints: Sequence[int],
    tests: Mapping[str, Any],
    setting: int = 0,
) -> dict[str, Any]:
    """Train a classifier on the true modes of one batch; test after some numbers of episodes (§4.7.2).

    It is taught which mode of the analytic list holds. A prediction is right if the predicted mode explains the
    example, whichever really held: ties are forgiven. Examples that no mode explains are neither taught nor tested.

    Parameters as of `regress`; `baseline` is one of `relgym.baselines.catalogue.CLASSIFIERS`.

    Returns
    -------
    Plain data: examples and errors by checkpoint and target; seconds spent on learning and on all tests, bytes that it
    keeps.
    """
    episodes = list(taught_episodes(experiment, seed, order, checkpoints[-1]))
    fresh = fresh_episodes(experiment, tests)
    seen = features(shown, episodes[0].schema, "ball")
    settings = CLASSIFIERS[baseline].settings[setting]
    models = {
        t: make_classifier(baseline, settings, rng=np.random.default_rng([seed, order])) for t in TARGETS
    }
    asked = {target: _labelled(fresh, seen, target, experiment) for target in TARGETS}

    def teach(episode: Episode) -> None:
        for target, model in models.items():
            _tell(model, *_labelled([episode], seen, target, experiment)[:2])

    def ask() -> dict[str, Any]:
        return {target: _errors(models[target], *asked[target]) for target in TARGETS}

    course = _course(episodes, checkpoints, teach, ask, dict)
    return {**course, "setting": dict(settings), "bytes": weight_of(models)}


def _tell(model: Classifier, x: NDArray[np.float64], labels: NDArray[np.int64]) -> None:
    for row, label in zip(x, labels.tolist(), strict=True):
        model.learn_one(row, label)


def _labelled(
    episodes: Sequence[Episode], seen: Features, target: str, experiment: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """Features, true modes and which modes explain each example; of those with a true mode."""
    laws = BALL_EXPERIMENTS[experiment].modes()
    x, _ = _examples(episodes, seen)
    labels = np.concatenate([true_modes(b, target, laws) for b in episodes])
    before = np.concatenate([b.columns("ball", *_VELOCITY)[:-1] for b in episodes])
    after = np.concatenate([b.columns("ball", *_VELOCITY)[1:] for b in episodes])
    explaining = laws.explaining(target[-1], before, after, TOLERANCE)
    known = labels >= 0
    return x[known], labels[known], explaining[known]


def _errors(
    model: Classifier, x: NDArray[np.float64], labels: NDArray[np.int64], explaining: NDArray[np.bool_]
) -> dict[str, int]:
    chosen = model.predict_batch(x)
    right = explaining[np.arange(len(x)), chosen]
    return {"examples": len(x), "wrong": int((~right).sum()), "strict": int((chosen != labels).sum())}
