"""Online in earnest: errors while learning, and what later episodes may not change."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterable
from dataclasses import dataclass, replace

from relgym.config import ModelConfig
from relgym.experiments.criterion import Measure, measured
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import evaluate
from relgym.experiments.worlds.accuracy import AXES
from relgym.experiments.worlds.online import Course, follow, last
from relgym.model.world_model import WorldModel

__all__ = ["KindsOutcome", "box_then_ramp", "prequential_measures", "same_model", "stream_measures"]

EARLY, LATE = 3, 32
"""Episodes from which on the two limits of `prequential_measures` hold; the first episode is 1."""


def prequential_measures(courses: Iterable[Course]) -> list[Measure]:
    """Share of wrong predictions from episode 3 and from episode 32 on; the worse of both coordinates."""
    runs = list(courses)
    found = []
    for first, limit in ((EARLY, 0.02), (LATE, 0.003)):
        rates = [max(run.rate(target, first) for target in AXES.values()) for run in runs]
        found.append(measured(f"wrong from episode {first} on", limit, rates))
    return found


def same_model(episodes: Iterable[Episode], after: int, *, config: ModelConfig | None = None) -> bool:
    """Whether the model after some episodes is, byte for byte, the same if more follow.

    One model sees the first episodes only. The other one sees all, and a copy is taken on the way.

    Parameters
    ----------
    episodes
        More than `after` episodes.
    after
        After how many episodes to compare.
    config
        Free parameters of the model.
    """
    every = list(episodes)
    alone = last(follow(every[:after], config=config))
    taken = ""
    for k, course in enumerate(follow(every, config=config), start=1):
        if k == after:
            taken = _written(copy.deepcopy(course.model))
    return _written(alone.model) == taken


@dataclass(frozen=True, slots=True)
class KindsOutcome:
    """Wrong predictions on fresh scenes with a box, before and after scenes with a ramp were learned, by axis."""

    before: dict[str, float]
    after: dict[str, float]

    @property
    def worsening(self) -> float:
        """By how much the share of wrong predictions grew, in the worse coordinate."""
        return max(self.after[axis] - self.before[axis] for axis in self.before)


def box_then_ramp(*, seed: int, test: int, episodes: int = 40, test_episodes: int = 40) -> KindsOutcome:
    """Learn scenes with a box only, then with a ramp only, and test on the former before and after.

    Parameters
    ----------
    seed, test
        Seeds of training and test scenes.
    episodes, test_episodes
        How many episodes of either kind to learn from, and how many to test on.
    """
    setting = BALL_EXPERIMENTS[1]
    laws, whole = setting.modes(), next(ball_episodes(1, seed=seed)).schema

    def only(kind: str, number: int, count: int, *, fresh: bool = False) -> list[Episode]:
        rooms = ball_episodes(replace(setting, objects=(kind,)), seed=number, episodes=count, test=fresh)
        return [replace(room, schema=whole, layout=whole.layout(room.layout.names)) for room in rooms]

    box, ramp = only("box", seed, episodes), only("ramp", seed, episodes)
    tested = only("box", test, test_episodes, fresh=True)

    def wrong(model: WorldModel) -> dict[str, float]:
        found = evaluate(model, tested, laws)
        return {axis: found[target].total.rate for axis, target in AXES.items()}

    rates = []
    for k, course in enumerate(follow([*box, *ramp]), start=1):
        if k in (len(box), len(box) + len(ramp)):
            rates.append(wrong(course.model))
    return KindsOutcome(*rates)


def stream_measures(same: Iterable[bool], kinds: Iterable[KindsOutcome]) -> list[Measure]:
    """One figure per run."""
    return [
        measured("models equal byte for byte", 1.0, map(float, same), ">="),
        measured("more wrong on box-only scenes", 0.0, [each.worsening for each in kinds]),
    ]


def _written(model: WorldModel) -> str:
    return json.dumps(model.to_json(history=True), sort_keys=True)
