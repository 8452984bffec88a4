"""Envs that nobody here wrote: classic control through views, as bars (``python -m relgym.experiments.any_env``).

Every env is learned twice from the same transitions: with the default configuration, and with the features that the
default's own advice recommends. Errors are *nRMSE-d*: root mean square error of one step over the standard deviation of
the change, per property, on fresh episodes, where rows at a limit (a wall, a clip) are judged apart: an error over
everything would measure the rare kind only.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.envs.views import NumbersView
from relgym.experiments.bar import Measure, measured, report
from relgym.experiments.seeds import TEST_SEEDS, TRAINING_SEEDS, TUNING_SEEDS, TUNING_TEST_SEED
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, Transition

__all__ = ["Lesson", "Study", "collect", "learned", "main", "nrmse_d", "recommended"]

TRAIN, TEST = 2_000, 4_000
"""Transitions learned from and judged on, where a row doesn't say otherwise."""

Policy = Callable[[Any, gym.Env[Any, Any], np.random.Generator], Any]


@dataclass(frozen=True, slots=True)
class Study:
    """An env and how it is looked at.

    Attributes
    ----------
    env
        Gymnasium's id.
    names
        Names of the observation's numbers.
    angles
        Pairs of them that are cosine and sine of an angle, and its name.
    special
        Whether next values show a limit at work (a wall, a clip): property vectors ``(n, d)`` to ``(n,)``.
    """

    env: str
    names: tuple[str, ...]
    angles: tuple[tuple[str, str, str], ...] = ()
    special: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None


STUDIES: Final = {
    "mountain": Study(
        "MountainCar-v0", ("x", "v"), special=lambda s: (s[:, 0] <= -1.2) | (abs(s[:, 1]) >= 0.07)
    ),
    "mountain-continuous": Study(
        "MountainCarContinuous-v0", ("x", "v"), special=lambda s: (s[:, 0] <= -1.2) | (abs(s[:, 1]) >= 0.07)
    ),
    "cart": Study("CartPole-v1", ("x", "xdot", "th", "thdot")),
    "pendulum": Study(
        "Pendulum-v1", ("c", "s", "w"), (("c", "s", "th"),), special=lambda s: abs(s[:, 0]) >= 8.0
    ),
    "acrobot": Study(
        "Acrobot-v1", ("c1", "s1", "c2", "s2", "w1", "w2"), (("c1", "s1", "th1"), ("c2", "s2", "th2"))
    ),
}
"""The envs of rows 1 to 4."""


@dataclass(frozen=True, slots=True)
class Lesson:
    """Transitions of an env, and the view that made them."""

    view: NumbersView
    transitions: list[Transition]


def at_random(observation: Any, env: gym.Env[Any, Any], rng: np.random.Generator) -> Any:
    """Any action."""
    return env.action_space.sample()


def pumping(observation: Any, env: gym.Env[Any, Any], rng: np.random.Generator) -> Any:
    """Push the way the car moves, so that it swings up and meets walls; one action in ten is random."""
    if rng.random() < 0.1:
        return env.action_space.sample()
    forward = observation[1] >= 0.0
    if isinstance(env.action_space, gym.spaces.Discrete):
        return 2 if forward else 0
    return np.array([1.0 if forward else -1.0], dtype=np.float32)


def collect(study: Study, steps: int, seed: int, policy: Policy = at_random) -> Lesson:
    """Step an env under a policy; episodes follow one another until there are enough transitions."""
    env = gym.make(study.env)
    env.action_space.seed(seed)
    rng = np.random.default_rng(seed)
    view = NumbersView(env.observation_space, env.action_space, names=study.names, angles=study.angles)
    observation, _ = env.reset(seed=seed)
    scene = view.scene(observation)
    found: list[Transition] = []
    while len(found) < steps:
        action = policy(observation, env, rng)
        observation, _, terminated, truncated, _ = env.step(action)
        following = view.scene(observation, last=scene)
        found.append(Transition(view.with_action(scene, action), following))
        scene = following
        if terminated or truncated:
            observation, _ = env.reset()
            scene = view.scene(observation)
    env.close()
    return Lesson(view, found)


def learned(lesson: Lesson, config: ModelConfig | None = None) -> WorldModel:
    """A model of all transitions, its classifiers up to date."""
    model = WorldModel(lesson.view.schema, config)
    for transition in lesson.transitions:
        model.learn_one(transition)
    model.finish()
    return model


def recommended(model: WorldModel) -> tuple[str, ...]:
    """Features that the model itself advises to switch on, of all its targets."""
    return tuple(dict.fromkeys(kind for advice in model.advice() for kind in advice.features))


def nrmse_d(model: WorldModel, lesson: Lesson, keep: NDArray[np.bool_] | None = None) -> dict[str, float]:
    """Errors of one step by property of the object `self`.

    Parameters
    ----------
    model, lesson
        What predicts, and what really followed.
    keep
        Which transitions count, shape ``(n,)``; default: all.
    """
    layout = lesson.transitions[0].before.layout
    before = np.array([t.before.vector for t in lesson.transitions])
    after = _after(lesson)
    predicted = model.predict_batch(layout, before).vectors
    keep = np.ones(len(before), dtype=bool) if keep is None else keep
    index = layout.index("self")
    found = {}
    for k, name in enumerate(layout.types[index].properties):
        column = layout.offsets[index] + k
        change = (after[:, k] - before[:, column])[keep]
        error = (predicted[:, column] - after[:, k])[keep]
        found[name] = float(np.sqrt(np.square(error).mean()) / change.std())
    return found


def regular(study: Study, lesson: Lesson) -> NDArray[np.bool_]:
    """Transitions at which no limit is at work."""
    if study.special is None:
        return np.ones(len(lesson.transitions), dtype=bool)
    return ~study.special(_after(lesson))


def _after(lesson: Lesson) -> NDArray[np.float64]:
    """Next property vectors of the object `self`, shape ``(n, d)``."""
    scenes: Sequence[Scene] = [t.after for t in lesson.transitions]
    return np.array([scene["self"].values for scene in scenes])


def _errors(
    name: str, train: int, test: int, policy: Policy, bar: float, seeds: tuple[int, int]
) -> list[Measure]:
    """Learn an env twice and judge both models; prints the second one's description."""
    study = STUDIES[name]
    lesson, fresh = collect(study, train, seeds[0], policy), collect(study, test, 2_000 + seeds[1], policy)
    plain = learned(lesson)
    features = recommended(plain)
    model = learned(lesson, ModelConfig(features=features)) if features else plain
    print(f"{study.env}, {train:,} transitions; recommended: {features or 'nothing'}\n\n{model.describe()}\n")
    usual = regular(study, fresh)
    found = [measured(f"{p}, regular", bar, [e]) for p, e in nrmse_d(model, fresh, usual).items()]
    if (~usual).sum() > 1:
        column = [f"{p}, {int((~usual).sum())} rows at a limit" for p in nrmse_d(model, fresh)]
        errors = _at_limits(model, fresh, ~usual)
        found += [measured(text, bar, [e]) for text, e in zip(column, errors, strict=True)]
    return found


def _at_limits(model: WorldModel, lesson: Lesson, rows: NDArray[np.bool_]) -> list[float]:
    """Errors at limits over the standard deviation of the change in all rows: there, changes may be constant."""
    layout = lesson.transitions[0].before.layout
    before, after = np.array([t.before.vector for t in lesson.transitions]), _after(lesson)
    start = layout.offsets[layout.index("self")]
    predicted = model.predict_batch(layout, before).vectors[:, start : start + after.shape[1]]
    spread = (after - before[:, start : start + after.shape[1]]).std(axis=0)
    return [float(e) for e in np.sqrt(np.square(predicted - after)[rows].mean(axis=0)) / spread]


def _memory(steps: int, bound: int, seed: int) -> list[Measure]:
    """Row 10: sizes and costs per step at the end against those early on, on CartPole."""
    import time

    study = STUDIES["cart"]
    lesson = collect(study, 10_000, seed)
    model = WorldModel(lesson.view.schema, ModelConfig(history=bound))
    costs = []
    for k in range(steps):
        start = time.perf_counter()
        model.learn_one(lesson.transitions[k % len(lesson.transitions)])
        costs.append(time.perf_counter() - start)
    model.finish()
    early, late = np.median(costs[8_000:10_000]), np.median(costs[-2_000:])
    fresh = collect(study, 1_000, 2_000 + TEST_SEEDS[0])
    error = nrmse_d(model, fresh)
    return [
        measured("median cost of a step at the end, over that at 10,000", 1.2, [late / early]),
        measured("rows kept, over the bound", 1.3, [model.history / bound]),
        measured("x, still right", 1e-3, [error["x"]]),
        measured("th, still right", 1e-3, [error["th"]]),
    ]


def rows(names: Sequence[str], *, tuning: bool, quick: bool) -> None:
    """Measure some rows and print each."""
    seeds = (TUNING_SEEDS[0], TUNING_TEST_SEED) if tuning else (TRAINING_SEEDS[0], TEST_SEEDS[0])
    test = 1_000 if quick else TEST
    for name in names:
        if name == "memory":
            found = _memory(5_000 if quick else 1_000_000, 1_000 if quick else 200_000, seeds[0])
        elif name.endswith("-pumped"):
            study = name.removesuffix("-pumped")
            found = _errors(study, 1_000 if quick else 14_000, test, pumping, 1e-3, seeds)
        else:
            bar = {"cart": 1e-3, "acrobot": 0.1}.get(name, 1e-4)
            train = 700 if quick else 10_000 if name == "pendulum" else TRAIN
            found = _errors(name, train, test, at_random, bar, seeds)
        print(report(name, found), "\n")


ROWS: Final = (*STUDIES, "mountain-pumped", "mountain-continuous-pumped", "memory")
"""All rows."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line: names of rows, ``--tuning`` for the tuning seeds, ``--quick`` for few transitions."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="*", default=list(ROWS), choices=[*ROWS, []])
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args(arguments)
    rows(given.rows or ROWS, tuning=given.tuning, quick=given.quick)


if __name__ == "__main__":
    main()
