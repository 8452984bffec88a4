"""The unit of experiments 1 to 3 and of the transfer experiments: one training, tested on the way (§4.3-§4.5, §4.9)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from time import perf_counter
from typing import Any, Final

import numpy as np

from relgym.config import ModelConfig
from relgym.errors import ConfigError
from relgym.experiments.chapter4.testing import TARGETS, confusions, scores_of
from relgym.experiments.chapter4.weight import weight_of
from relgym.experiments.data import BALL_EXPERIMENTS, BallExperiment, ball_episodes
from relgym.experiments.episodes import Episode
from relgym.model.report import report
from relgym.model.text import plain
from relgym.model.world_model import WorldModel
from relgym.scene.schema import SceneSchema

__all__ = ["config_of", "fresh_episodes", "lesson", "taught_episodes"]

_EPISODES_PER_SEED: Final = 40
"""Every configuration once (Table 4.1)."""


def config_of(learner: str) -> ModelConfig:
    """Configuration of a learner by name (`relgym.experiments.chapter4.protocol`: `LEARNERS`, `ABLATIONS`).

    ``"one-polarity"`` is the thesis' learner without §3.4.5: the first mode of a pair is always the positive class.
    """
    thesis, original = ModelConfig.thesis(), ModelConfig.original()
    known = {
        "original": original,
        "original, trees for rare modes": _with_rules(original, tree_errors="class"),
        "original, simplest of equals": replace(
            original, clustering=replace(original.clustering, stickiness="simple")
        ),
        "original, contact facts": _with_rules(original, contact_facts=True),
        "thesis": thesis,
        "one-polarity": _with_rules(thesis, both_polarities=False),
        "world": ModelConfig(frames="world"),
        "default": ModelConfig(),
    }
    if learner not in known:
        raise ConfigError(f"learner {learner!r}: expected one of {sorted(known)}")
    return known[learner]


def _with_rules(config: ModelConfig, **changes: Any) -> ModelConfig:
    return replace(config, classification=replace(config.classification, **changes))


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
    laws = BALL_EXPERIMENTS[experiment].modes()
    episodes = list(taught_episodes(experiment, seed, order, checkpoints[-1], stages))
    fresh = fresh_episodes(experiment, tests)
    model = WorldModel(episodes[0].schema, config_of(learner))
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
        "report": plain(report(model)),
        "modes": _modes(model),
        "text": _text(model, BALL_EXPERIMENTS[experiment].incline),
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
        yield from ball_episodes(experiment, seed=seed, episodes=count, order=order)
        return
    setting = BALL_EXPERIMENTS[experiment]
    whole = next(ball_episodes(experiment, seed=seed, episodes=1)).schema
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
    seeds = tests["seeds"]
    each = -(-int(tests["episodes"]) // len(seeds))
    cycle = max(each, _EPISODES_PER_SEED)
    return [
        episode
        for seed in seeds
        for episode in islice(ball_episodes(experiment, seed=seed, episodes=cycle, test=True), each)
    ]


def _modes(model: WorldModel) -> dict[str, list[dict[str, Any]]]:
    """Learned modes as numbers, by target that modes predict; the first ones have most examples."""
    found = {}
    for target in TARGETS:
        part = model.property_model(*target.split("."))
        if not model.governs(part.target):
            ordered = sorted(part.modes, key=lambda mode: -mode.examples)
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


def _text(model: WorldModel, incline: float) -> str:
    """The model for people; laws of contacts also along the world's axes, on level ground, on ramps and on walls."""
    if not model.governed:
        return model.describe(details=True)
    return model.describe(details=True, frame="world", incline=(0.0, incline, 90.0))


def _trees(model: WorldModel) -> list[dict[str, Any]]:
    """Decision trees behind clauses (figures 4.2, 4.10 and 4.11)."""
    found = []
    for target in TARGETS:
        part = model.property_model(*target.split("."))
        if model.governs(part.target):
            continue
        functions = {mode.id: mode.formula(3) for mode in part.modes}
        for pair in part.classifier.classifiers:
            other = pair.i if pair.positive == pair.j else pair.j
            stages = [*map(str, pair.definition.clauses), "else"]
            for stage, tree in zip(stages, (*pair.clause_trees, pair.fall_through_tree), strict=True):
                if tree is not None:
                    about = {"target": target, "mode": pair.positive, "other": other, "stage": stage}
                    sides = {"yes": functions.get(pair.positive, ""), "no": functions.get(other, "")}
                    found.append({**about, **sides, "tree": tree.to_dict()})
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
