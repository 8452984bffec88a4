"""Whether a model says the same whoever runs it: arrays, the compiled kernel, and the Python it is exported as.

``python -m relgym.experiments.agreement`` learns models, asks each of 100,000 scenes and prints a line for each:
shares of equal outcomes, largest differences of values, and whether a scene alone gets the bits that it gets among
others. Scenes are those of fresh runs, a third as they are, a third shaken a little and a third a lot.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import relgym  # noqa: F401 - registers the envs
from relgym.experiments.law_trials import TRIALS, Trial, trial_rooms
from relgym.model.compiled import KERNEL
from relgym.model.lowering import lowered
from relgym.model.prediction import BatchPrediction
from relgym.model.querying import predict_many
from relgym.model.running import Runner
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Float2D, SceneLayout
from relgym.wrappers import ModelLearner
from relgym.wrappers.follower import scenes_of

__all__ = ["MODELS", "Agreement", "agreement", "main"]

_SHAKEN: Final = (0.0, 1e-3, 0.3)
"""By how much scenes are changed, as a share of how much each number varies."""

_LEARNED, _FRESH = 300, 700
"""Seeds of what is learned from, and of what is asked."""

_CHUNK: Final = 10_000
_ALONE: Final = 300

Taught = tuple[WorldModel, SceneLayout, Float2D]
"""A model, a layout, and state vectors of fresh scenes."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """How two ways to run a model agree with arrays.

    Attributes
    ----------
    scenes
        How many were asked.
    outcomes
        Share of predictions with the same outcome, mode and margin, by the kernel.
    largest
        Largest difference of a value, by the kernel.
    alone
        Whether scenes asked alone got the same bits.
    exported, exported_outcomes, exported_largest
        Scenes asked of the exported Python, and the same of it.
    refused
        Why there is no program; empty: there is.
    """

    scenes: int
    outcomes: float
    largest: float
    alone: bool
    exported: int
    exported_outcomes: float
    exported_largest: float
    refused: str = ""

    def __str__(self) -> str:
        if self.refused:
            return f"left to arrays: {self.refused}"
        return (
            f"{self.scenes:>8,} {100 * self.outcomes:>9.5g} {self.largest:>9.1e} {'yes' if self.alone else 'no':>6} "
            f"{self.exported:>8,} {100 * self.exported_outcomes:>9.5g} {self.exported_largest:>9.1e}"
        )


def _of_env(env_id: str, steps: int, arguments: dict[str, Any], options: dict[str, Any]) -> Taught:
    """A model learned in an env, with random actions, and what a fresh run shows."""
    env = ModelLearner(gym.make(env_id, **arguments), **options)
    env.action_space.seed(_LEARNED)
    env.reset(seed=_LEARNED)
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    model: WorldModel = env.model
    model.finish()
    scenes = list(scenes_of(gym.make(env_id, **arguments), env.view, 2000, seed=_FRESH))
    layout = scenes[0].layout
    return model, layout, np.array([s.vector for s in scenes if s.layout == layout])


def _of_trial(trial: Trial) -> Taught:
    """A model learned in a world of laws, and what rooms of other seeds show."""
    model: WorldModel | None = None
    for room in trial_rooms(trial.world, 4, seed=_LEARNED, steps=200):
        model = model or WorldModel(room.schema)
        model.fit(list(room.transitions()))
    assert model is not None, "there are rooms"
    model.finish()
    (fresh,) = trial_rooms(trial.world, 1, seed=_FRESH, steps=500)
    return model, fresh.layout, fresh.vectors[:-1]


_TASK: Final = {"learn_reward": True, "learn_termination": True}
_WORLDS: Final = [t for t in TRIALS if t.world.dimensions == 2]
MODELS: Final[dict[str, Callable[[], Taught]]] = {
    "ball by laws": partial(_of_env, "relgym/BallBoxRamp-v0", 4000, {}, {}),
    "ball by modes": partial(_of_env, "relgym/BallBoxRamp-v0", 4000, {}, {"config": {"frames": "world"}}),
    "ball with friction": partial(_of_env, "relgym/BallBoxRamp-v0", 4000, {"friction": 0.2}, {}),
    "truck": partial(_of_env, "relgym/TruckPush-v0", 1200, {"task": None}, {}),
    "truck with reward and end": partial(_of_env, "relgym/TruckPush-v0", 1200, {}, _TASK),
    "CartPole": partial(_of_env, "CartPole-v1", 1500, {}, {}),
    "Pendulum": partial(_of_env, "Pendulum-v1", 1500, {}, {}),
    "MountainCar": partial(_of_env, "MountainCar-v0", 1500, {}, {}),
    "MountainCarContinuous": partial(_of_env, "MountainCarContinuous-v0", 1500, {}, {}),
    **{f"laws: {trial.name}": partial(_of_trial, trial) for trial in _WORLDS},
}
"""What is learned, and where."""


def _scenes(layout: SceneLayout, vectors: Float2D, count: int) -> Float2D:
    """So many scenes like some, changed by `_SHAKEN` where their numbers vary; sizes and turns of bodies stay."""
    rng = np.random.default_rng(0)
    found = vectors[rng.integers(len(vectors), size=count)]
    by = rng.choice(_SHAKEN, size=(count, 1)) * np.std(vectors, axis=0)
    for index in layout.bodies:
        by[:, [layout.offsets[index] + k for k in layout.types[index].pose_columns()[3:] if k >= 0]] = 0.0
    shaken: Float2D = found + by * rng.normal(size=found.shape)
    return shaken


def agreement(taught: Taught, *, scenes: int, exported: int) -> Agreement:
    """Ask a model of many scenes, in all ways there are.

    Parameters
    ----------
    taught
        What is asked.
    scenes, exported
        How many are asked of the kernel, and how many of the exported Python.
    """
    model, layout, some = taught
    parts, machine = model._parts, KERNEL.load()
    assert machine is not None, "no kernel: nothing to compare"
    runner = Runner(parts, layout, lowered(parts, layout), machine)
    module: dict[str, Any] = {"__name__": "exported"}
    exec(compile(model.to_python(layout), "exported.py", "exec"), module)
    vectors = _scenes(layout, some, scenes)
    same, largest = list[float](), 0.0
    same_exported, largest_exported = list[float](), 0.0
    for at in range(0, scenes, _CHUNK):
        chunk = vectors[at : at + _CHUNK]
        with np.errstate(all="ignore"):
            known = predict_many(parts, parts.perception.percept(layout, chunk), layout, chunk)
            told = runner.many(chunk)
        if told is None:
            return Agreement(0, 0.0, 0.0, False, 0, 0.0, 0.0, "laws of hypothesis classes that were added")
        same.append(_same(told, known))
        largest = max(largest, _apart(told.vectors, known.vectors))
        if at < exported:
            few = chunk[: exported - at]
            after, outcomes, modes, *_ = module["predict"](few)
            equal = (outcomes == known.outcomes[: len(few)]) & (modes == known.modes[: len(few)])
            same_exported.append(float(equal.mean()))
            largest_exported = max(largest_exported, _apart(after, known.vectors[: len(few)]))
    whole = runner.many(vectors[:_ALONE])
    assert whole is not None, "it was asked before"
    alone = all(
        told is not None and told.vectors.tobytes() == whole.vectors[k : k + 1].tobytes()
        for k, told in enumerate(runner.many(vectors[k : k + 1]) for k in range(_ALONE))
    )
    means = float(np.mean(same)), float(np.mean(same_exported or 1.0))
    return Agreement(scenes, means[0], largest, alone, exported, means[1], largest_exported)


def _same(a: BatchPrediction, b: BatchPrediction) -> float:
    equal = (a.outcomes == b.outcomes) & (a.modes == b.modes) & (a.margins == b.margins)
    return float(equal.mean())


def _apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Largest difference, as a share of what is larger than 1."""
    return float((np.abs(a - b) / np.maximum(np.abs(b), 1.0)).max(initial=0.0))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each model."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="*", default=list(MODELS), metavar="MODEL", help=", ".join(MODELS))
    parser.add_argument("--scenes", type=int, default=100_000, help="asked of arrays and of the kernel")
    parser.add_argument("--exported", type=int, default=24_000, help="asked of the exported Python, too")
    given = parser.parse_args(arguments)
    heads = ("scenes", "same, %", "apart", "alone", "exported", "same, %", "apart")
    print(
        f"{'model':<28} " + " ".join(f"{h:>{w}}" for h, w in zip(heads, (8, 9, 9, 6, 8, 9, 9), strict=True))
    )
    for name in given.models:
        if name not in MODELS:
            parser.error(f"there is no model {name!r}: {', '.join(MODELS)}")
        found = agreement(MODELS[name](), scenes=given.scenes, exported=min(given.exported, given.scenes))
        print(f"{name:<28} {found}", flush=True)


if __name__ == "__main__":
    main()
