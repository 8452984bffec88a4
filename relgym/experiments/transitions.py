"""How many transitions it takes until predictions are right, and until they are right again after a law has changed.

`relgym benchmark transitions` tells a line for each world and seed. In a world that changes, gravity is halved or
friction doubled after the given steps, which nothing tells the learner:

- *right after*: steps until `RIGHT` of `WINDOW` predictions in a row, of all properties, were claimed and right;
- *again after*: the same from the change on;
- *claimed, off*: predictions after the change that were claimed and off by more than 5 % of what mostly changes: how
  many until they are right again, and what share of all; what was always right is doubted after a miss or two;
- *late*: the share of the last `WINDOW` steps that were claimed and right in all properties.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import relgym  # noqa: F401 - registers the envs
from relgym.experiments.benchmark import Benchmark, Extent, Known, Shown, Suite
from relgym.experiments.criterion import measured
from relgym.experiments.seeds import TRAINING_SEEDS
from relgym.model.predicting.prequential import StepReport
from relgym.model.reports.text import Cell, table
from relgym.wrappers import ModelLearner

__all__ = ["SUITE", "WORLDS", "World", "course", "falling", "sliding", "trial"]

WINDOW, RIGHT = 100, 99
"""So many of so many steps in a row are right once a law is known: one slip is no relapse."""

OFF: Final = 0.05
"""Share of what mostly changes by which a claim may be off."""


class _Point(gym.Env[NDArray[np.float64], NDArray[np.float64]]):
    """A point whose velocity follows a law; pushed by the action."""

    def __init__(self, law: Callable[[float, float], float], start: float) -> None:
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (1,), np.float64)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float64)
        self._law, self._start, self._v = law, start, start

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        super().reset(seed=seed)
        self._v = self._start
        return np.array([self._v]), {}

    def step(
        self, action: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        self._v = self._law(self._v, float(action[0]))
        return np.array([self._v]), 0.0, False, abs(self._v) > 20.0, {}


def falling(gravity: float = 1.0) -> gym.Env[Any, Any]:
    """What falls, and is slowed by nothing but the end of an episode."""
    return _Point(lambda v, u: v + 0.1 * u - gravity, 0.0)


def sliding(friction: float = 0.05) -> gym.Env[Any, Any]:
    """What a force moves, and friction in proportion to its speed slows."""
    return _Point(lambda v, u: (1.0 - friction) * v + 0.3 * u, 3.0)


@dataclass(frozen=True, slots=True)
class World:
    """What is learned, and what it becomes.

    Attributes
    ----------
    make
        The world, with arguments that differ from the default.
    steps
        Before the change, and after it.
    changed
        Arguments after the change; None: nothing changes.
    """

    make: Callable[..., gym.Env[Any, Any]]
    steps: int
    changed: Mapping[str, Any] | None = None


def _named(env_id: str, **fixed: Any) -> Callable[..., gym.Env[Any, Any]]:
    return lambda **given: gym.make(env_id, **{**fixed, **given})


WORLDS: Final[Mapping[str, World]] = {
    "ball": World(_named("relgym/BallBoxRamp-v0"), 1_500),
    "ball-friction": World(_named("relgym/BallBoxRamp-v0", friction=0.2), 1_500),
    "truck": World(_named("relgym/TruckPush-v0"), 800),
    "mountain-car": World(_named("MountainCar-v0"), 2_000),
    "pendulum": World(_named("Pendulum-v1"), 2_000),
    "falling-gravity-halved": World(falling, 600, {"gravity": 0.5}),
    "sliding-friction-doubled": World(sliding, 600, {"friction": 0.1}),
    "truck-gravity-halved": World(_named("relgym/TruckPush-v0"), 800, {"gravity": 4.9}),
    "ball-friction-doubled": World(_named("relgym/BallBoxRamp-v0", friction=0.1), 1_500, {"friction": 0.2}),
}
"""Worlds by name."""


def course(world: World, seed: int) -> dict[str, Any]:
    """Learn a world from random actions, and what becomes of it.

    Returns
    -------
    ``first`` and ``again``: steps until predictions were right, from the beginning and from the change on; None where
    that never came to be. ``slips``: predictions between the change and being right again that were claimed and off;
    ``off``: the share of all predictions after the change that were, or None. ``late``: the share of the last steps
    that were right in all properties.
    """
    learner = ModelLearner(world.make())
    before = list(islice(_reports(learner, seed), world.steps))
    first = _until(before)
    if world.changed is None:
        return {"first": first, "again": None, "slips": 0, "off": None, "late": _late(before)}
    other = ModelLearner(world.make(**world.changed), model=learner.get_wrapper_attr("model"))
    after = list(islice(_reports(other, seed + 1_000), world.steps))
    again, off = _until(after), _off(after)
    return {
        "first": first,
        "again": again,
        "slips": int(off[:again].sum()),
        "off": float(off.sum() / max(sum(len(r.residuals) for r in after), 1)),
        "late": _late(after),
    }


def _late(reports: Sequence[StepReport]) -> float:
    """Share of the last steps that were right in all properties."""
    return float(np.mean([not r.wrong for r in reports[-WINDOW:]]))


def _reports(learner: ModelLearner, seed: int) -> Iterator[StepReport]:
    """Reports of the steps of which something was predicted."""
    learner.action_space.seed(seed)
    learner.reset(seed=seed)
    while True:
        _, _, terminated, truncated, info = learner.step(learner.action_space.sample())
        if info["relgym"].transition is not None:
            yield info["relgym"]
        if terminated or truncated:
            learner.reset()


def _until(reports: Sequence[StepReport]) -> int | None:
    """Steps before the first `WINDOW` of which `RIGHT` are right in all properties."""
    right = np.array([bool(r.residuals) and not r.wrong for r in reports], dtype=np.int64)
    sums = np.concatenate([[0], np.cumsum(right)])
    found = np.flatnonzero(sums[WINDOW:] - sums[:-WINDOW] >= RIGHT)
    return int(found[0]) if len(found) else None


def _off(every: Sequence[StepReport]) -> NDArray[np.int64]:
    """How many predictions of each step were claimed and off."""
    changes: dict[tuple[str, str], list[float]] = {}
    for report in every:
        if report.transition is not None:
            for name, prop in report.residuals:
                now, then = report.transition.before[name][prop], report.transition.after[name][prop]
                changes.setdefault((name, prop), []).append(abs(then - now))
    size = {key: float(np.median([c for c in some if c > 0.0] or [0.0])) for key, some in changes.items()}
    return np.array(
        [
            sum(
                told.ok and abs(report.residuals[key]) > max(1e-9, OFF * size[key])
                for told in (() if report.prediction is None else report.prediction.parts)
                if (key := (told.object, told.property)) in report.residuals
            )
            for report in every
        ],
        dtype=np.int64,
    )


def trial(*, world: str, seed: int) -> dict[str, Any]:
    """`course` in one of `WORLDS`, as a task for the store of results."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # other people's envs warn when they are made
        return course(WORLDS[world], seed)


SEEDS: Final = tuple(range(40))
"""On those from 20 on nothing was chosen."""

_LIMITS: Final[Mapping[str, int]] = {"truck": 200}
"""Steps after which predictions are to be right."""

_OFF: Final = 1.0
"""Per cent of the predictions after a change that may be claimed and off."""

_TIMES: Final = 2.0
"""Times as many steps as at first it may take until predictions are right again."""


def _benchmark(name: str) -> Benchmark:
    def measure(extent: Extent, known: Known) -> Shown:
        asked = [{"world": name, "seed": seed} for seed in extent.first(SEEDS)]
        pairs = known.pairs("relgym.experiments.transitions:trial", asked)
        found, never = [each for _, each in pairs], WORLDS[name].steps
        first, again = ([never if one[k] is None else one[k] for one in found] for k in ("first", "again"))
        measures = []
        if found and name in _LIMITS:
            measures.append(measured("steps until predictions are right", _LIMITS[name], first))
        if found and WORLDS[name].changed is not None:
            ratios = [late / max(early, 1) for late, early in zip(again, first, strict=True)]
            measures.append(measured("steps until right again, over those at first", _TIMES, ratios))
            off = [100.0 * one["off"] for one in found]
            measures.append(measured("claimed and off after the change, %", _OFF, off))
        rows: list[list[Cell]] = [
            [
                arguments["seed"],
                *("-" if n is None else n for n in (one["first"], one["again"])),
                one["slips"],
                f"{100.0 * one['late']:.1f}",
            ]
            for arguments, one in pairs
        ]
        return Shown(
            measures, [table(["seed", "right after", "again after", "claimed, off", "late, %"], rows)]
        )

    return Benchmark(name, measure)


SUITE: Final = Suite(
    "transitions",
    "How many transitions it takes",
    {name: _benchmark(name) for name in WORLDS},
    seeds=len(TRAINING_SEEDS),
)
