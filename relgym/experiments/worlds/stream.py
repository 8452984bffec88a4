"""Online in earnest: errors while learning, and what later episodes may not change."""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from dataclasses import replace

from relgym.experiments.benchmark import Shown
from relgym.experiments.criterion import measured
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import evaluate
from relgym.experiments.worlds.accuracy import AXES
from relgym.experiments.worlds.online import follow, last
from relgym.model.world_model import WorldModel

__all__ = ["later_episodes", "prequential"]

EARLY, LATE = 3, 32
"""Episodes from which on the two limits of `prequential` hold; the first episode is 1."""

FIRST, EVERY = 8, 16
"""Episodes after which a model must be the same, and those that another one has seen in all."""

EPISODES = 40
"""Episodes of either kind of room that are learned from, and tested on."""


def prequential(training: Sequence[int], _: Sequence[int]) -> Shown:
    """Share of wrong predictions from episode 3 and from episode 32 on; the worse of both coordinates."""
    laws = BALL_EXPERIMENTS[1].modes()
    courses = [last(follow(ball_episodes(1, seed=seed), laws=laws)) for seed in training]
    measures = []
    for first, limit in ((EARLY, 0.02), (LATE, 0.003)):
        rates = [max(course.rate(target, first) for target in AXES.values()) for course in courses]
        measures.append(measured(f"wrong from episode {first} on", limit, rates))
    return Shown(measures)


def later_episodes(training: Sequence[int], tests: Sequence[int]) -> Shown:
    """Whether a model is the same if more episodes follow, and what scenes of another kind change of what it says."""
    same = [_same_model(seed) for seed in training]
    kinds = [_box_then_ramp(seed, tests[0]) for seed in training]
    # By how much the share of wrong predictions grew, in the worse coordinate.
    worse = [max(after[axis] - before[axis] for axis in before) for before, after in kinds]
    measures = [
        measured("models equal byte for byte", 1.0, map(float, same), ">="),
        measured("more wrong on box-only scenes", 0.0, worse),
    ]
    notes = [f"box-only scenes wrong before {before}, after {after}" for before, after in kinds]
    return Shown(measures, notes)


def _same_model(seed: int) -> bool:
    """Whether the model after some episodes is, byte for byte, the same if more follow.

    One model sees the first episodes only. The other one sees all, and a copy is taken on the way.
    """
    every = list(ball_episodes(1, seed=seed, episodes=EVERY))
    alone = last(follow(every[:FIRST]))
    taken = ""
    for k, course in enumerate(follow(every), start=1):
        if k == FIRST:
            taken = _written(copy.deepcopy(course.model))
    return _written(alone.model) == taken


def _box_then_ramp(seed: int, test: int) -> list[dict[str, float]]:
    """Wrong predictions on fresh scenes with a box, before and after scenes with a ramp were learned, by axis."""
    setting = BALL_EXPERIMENTS[1]
    laws, whole = setting.modes(), next(ball_episodes(1, seed=seed)).schema

    def only(kind: str, number: int, *, fresh: bool = False) -> list[Episode]:
        rooms = ball_episodes(replace(setting, objects=(kind,)), seed=number, episodes=EPISODES, test=fresh)
        return [replace(room, schema=whole, layout=whole.layout(room.layout.names)) for room in rooms]

    box, ramp, tested = only("box", seed), only("ramp", seed), only("box", test, fresh=True)
    rates = []
    for k, course in enumerate(follow([*box, *ramp]), start=1):
        if k in (len(box), len(box) + len(ramp)):
            found = evaluate(course.model, tested, laws)
            rates.append({axis: found[target].total.rate for axis, target in AXES.items()})
    return rates


def _written(model: WorldModel) -> str:
    return json.dumps(model.to_json(history=True), sort_keys=True)
