"""The unit of experiments 1 to 3 and of the transfer experiments: one training, tested on the way (§4.3-§4.5, §4.9)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from time import perf_counter
from typing import Any, Final

import numpy as np

from relgym.experiments.chapter4.learners import (
    Learner,
    governed,
    learner_of,
    modes_of,
    report_of,
    settings_of,
    trees_of,
)
from relgym.experiments.chapter4.testing import TARGETS, confusions, scores_of
from relgym.experiments.chapter4.weight import weight_of
from relgym.experiments.data import THESIS_EXPERIMENTS, BallExperiment, ball_episodes
from relgym.experiments.episodes import Episode
from relgym.model.reports.text import plain
from relgym.scene.schema import SceneSchema
from relgym.thesis.model import ThesisModel

__all__ = ["fresh_episodes", "lesson", "taught_episodes"]

_EPISODES_PER_SEED: Final = 40
"""Every configuration once (Table 4.1)."""


def lesson(
    *,
    learner: str,
    experiment: int,
    seed: int,
    order: int,
    checkpoints: Sequence[int],
    tests: Mapping[str, Any],
    stages: Sequence[str] = (),
) -> dict[str, Any]:
    """Train on one batch; test after some numbers of episodes.

    Parameters
    ----------
    learner
        Name of a configuration.
    experiment
        1, 2 or 3.
    seed, order
        Of the training episodes.
    checkpoints
        After how many episodes to test; the last one ends the training.
    tests
        ``seeds`` of the test scenes, and how many ``episodes`` in all.
    stages
        For transfer (§4.9): which object stands in the room, stage after stage of equal length, instead of both.

    Returns
    -------
    Plain data: scores by checkpoint and target, the learned model's report, confusions of its modes, its trees, seconds
    spent on learning, bytes that it keeps.
    """
    laws = THESIS_EXPERIMENTS[experiment].modes()
    episodes = list(taught_episodes(experiment, seed, order, checkpoints[-1], stages))
    fresh = fresh_episodes(experiment, tests)
    model = learner_of(settings_of(learner), episodes[0].schema)
    scores, seconds = [], 0.0
    for number, episode in enumerate(episodes, start=1):
        start = perf_counter()
        for transition in episode.transitions():
            model.learn_one(transition)
        if number in checkpoints:
            model.finish()
        seconds += perf_counter() - start
        if number in checkpoints:
            scores.append({"episodes": number, "targets": scores_of(model, fresh, laws)})
    return {
        "scores": scores,
        "report": plain(report_of(model)),
        "modes": _modes(model),
        "text": _text(model, THESIS_EXPERIMENTS[experiment].incline),
        "trees": _trees(model),
        "confusions": confusions(model, fresh, laws),
        "training": _mode_examples(episodes),
        "seconds": seconds,
        "bytes": weight_of(model),
        "corner_episodes": float(np.mean([b.truth.corner.any() for b in fresh])),
    }


def taught_episodes(
    experiment: int, seed: int, order: int, count: int, stages: Sequence[str] = ()
) -> Iterator[Episode]:
    """Training episodes; with stages, those of each kind of room, in the schema of the whole room."""
    if not stages:
        yield from ball_episodes(THESIS_EXPERIMENTS[experiment], seed=seed, episodes=count, order=order)
        return
    setting = THESIS_EXPERIMENTS[experiment]
    whole = next(ball_episodes(setting, seed=seed, episodes=1)).schema
    for k, kind in enumerate(stages):
        each = count // len(stages) + (k < count % len(stages))
        yield from _only(setting, kind, seed, order, each, whole)


def _only(
    setting: BallExperiment, kind: str, seed: int, order: int, count: int, whole: SceneSchema
) -> Iterator[Episode]:
    rooms = ball_episodes(replace(setting, objects=(kind,)), seed=seed, episodes=count, order=order)
    for room in rooms:
        yield replace(room, schema=whole, layout=whole.layout(room.layout.names))


def fresh_episodes(experiment: int, tests: Mapping[str, Any]) -> list[Episode]:
    """Test episodes: from every seed equally many of the configurations, all 40 when there are enough (§4.3.3)."""
    setting, seeds = THESIS_EXPERIMENTS[experiment], tests["seeds"]
    each = -(-int(tests["episodes"]) // len(seeds))
    cycle = max(each, _EPISODES_PER_SEED)
    return [
        episode
        for seed in seeds
        for episode in islice(ball_episodes(setting, seed=seed, episodes=cycle, test=True), each)
    ]


def _modes(model: Learner) -> dict[str, list[dict[str, Any]]]:
    """Learned modes as numbers, by target that modes predict; the first ones have most examples."""
    found = {}
    for target in TARGETS:
        if not governed(model, target):
            ordered = sorted(modes_of(model, target), key=lambda mode: -mode.examples)
            found[target] = [
                {
                    "id": mode.id,
                    "examples": mode.examples,
                    "weights": dict(mode.roles[0].terms),
                    "intercept": mode.intercept,
                    "others": sum(len(role.terms) for role in mode.open_roles),
                    "function": mode.formula(4),
                }
                for mode in ordered
            ]
    return found


def _text(model: Learner, incline: float) -> str:
    """The model for people; laws of contacts also along the world's axes, on level ground, on ramps and on walls."""
    if isinstance(model, ThesisModel):
        return model.describe()
    if not model.governed:
        return model.describe(details=True)
    return model.describe(details=True, frame="world", incline=(0.0, incline, 90.0))


def _trees(model: Learner) -> list[dict[str, Any]]:
    """Decision trees behind clauses (figures 4.2, 4.10 and 4.11)."""
    found = []
    for target in TARGETS:
        if governed(model, target):
            continue
        functions = {mode.id: mode.formula(3) for mode in modes_of(model, target)}
        for about in trees_of(model, target):
            sides = {"yes": functions.get(about["mode"], ""), "no": functions.get(about["other"], "")}
            found.append({"target": target, **about, **sides})
    return found


def _mode_examples(episodes: Sequence[Episode]) -> dict[str, dict[str, int]]:
    """Training examples of every true mode, by target."""
    found: dict[str, dict[str, int]] = {}
    for target in TARGETS:
        names = episodes[0].truth.mode_names[target]
        truth = np.concatenate([b.truth.mode[target] for b in episodes])
        found[target] = {name: int((truth == k).sum()) for k, name in enumerate(names)}
        found[target]["several contacts or a corner"] = int((truth < 0).sum())
    return found
