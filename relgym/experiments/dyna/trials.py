"""Courses of learning as functions of plain data that give plain data: tasks for the store of results."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from typing import Any, Final

import numpy as np

from relgym.experiments.dyna.arms import ARMS, COURSES, Change, Course, make_env
from relgym.experiments.dyna.course import EPISODES, run
from relgym.model.world_model import WorldModel

__all__ = ["learning", "misled"]

_LESSONS: Final = 1_500
"""Random steps from which a model of another world is learned, and a third of them more on which it is tested."""

_FIRST_TEST: Final = 70_000  # seed of the tests in that world


def learning(
    *, course: str, arm: str, seed: int, steps: int, change: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """One agent's course of learning, as ``asdict`` of a `Run`.

    Parameters
    ----------
    course, arm
        Names in `COURSES` and `ARMS`.
    seed
        Of everything random.
    steps
        Real steps at most.
    change
        ``{"after": steps, "arguments": {…}}``: how the world changes in mid-run, which then goes on to its end.
    """
    altered = None if change is None else Change(int(change["after"]), change["arguments"])
    found = run(
        COURSES[course],
        ARMS[arm],
        seed=seed,
        steps=steps,
        change=altered,
        to_the_end=altered is not None,
        heard=partial(_heard, f"{course}, {arm}, seed {seed}"),
    )
    return asdict(found)


def misled(*, course: str, arm: str, seed: int, steps: int, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """An agent whose model was learned in another world of the same id and learns no more.

    Parameters
    ----------
    course, arm, seed, steps
        As for `learning`; the run goes on to its end.
    arguments
        What the other world is made with.

    Returns
    -------
    The `Run`, and the share of steps that the model predicts to within 1e-6 in its own world.
    """
    place = COURSES[course]
    model, right = _of_another_world(place, dict(arguments), seed)
    heard = partial(_heard, f"{course}, {arm} with a wrong model, seed {seed}")
    found = run(place, ARMS[arm], seed=seed, steps=steps, model=model, to_the_end=True, heard=heard)
    return {"run": asdict(found), "right_there": right}


def _of_another_world(course: Course, arguments: dict[str, Any], seed: int) -> tuple[WorldModel, float]:
    env = make_env(course, **arguments)
    model = WorldModel(env.get_wrapper_attr("schema"))
    transitions = [real.transition for real in _random_steps(env, _LESSONS, seed)]
    # In random order: what stays the same throughout an episode would pass for a law.
    for k in np.random.default_rng([seed, 4]).permutation(len(transitions)).tolist():
        model.learn_one(transitions[k])
    model.finish()
    model.frozen = True
    targets = [(target.type, target.property) for target in model.targets]
    tests = _random_steps(env, _LESSONS // 3, _FIRST_TEST + seed)
    right = [_predicted(model, real.transition, targets) for real in tests]
    return model, sum(right) / len(right)


def _predicted(model: WorldModel, transition: Any, targets: list[tuple[str, str]]) -> bool:
    found = model.predict_one(transition.before)
    return bool(found.ok) and all(
        abs(found.scene[o.name][prop] - o[prop]) <= 1e-6
        for o in transition.after
        for kind, prop in targets
        if o.type.name == kind
    )


def _random_steps(env: Any, steps: int, seed: int) -> list[Any]:
    env.action_space.seed(seed)
    env.reset(seed=seed)
    found: list[Any] = []
    while len(found) < steps:
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
        found += env.get_wrapper_attr("take")()
    return found[:steps]


def _heard(what: str, at: int, good: int) -> None:
    """Say on standard error how a run stands."""
    print(f"{what}: {good} of {EPISODES} after {at:,}", file=sys.stderr, flush=True)
