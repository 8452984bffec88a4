"""Whether a model says the same whoever runs it: arrays, the compiled kernel, and the Python it is exported as.

`relgym benchmark agreement` learns models, asks each of 100,000 scenes and tells shares of equal outcomes, largest
differences of values, and whether a scene alone gets the bits that it gets among others. Scenes are those of fresh
runs, a third as they are, a third shaken a little and a third a lot.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import relgym  # noqa: F401 - registers the envs
from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.criterion import measured
from relgym.experiments.laws.trials import TRIALS, Trial, trial_rooms
from relgym.model.predicting.prediction import BatchPrediction
from relgym.model.predicting.querying import predict_many
from relgym.model.reports.text import Cell, table
from relgym.model.running.compiled import KERNEL
from relgym.model.running.lowering import lowered
from relgym.model.running.runner import Runner
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Float2D, SceneLayout
from relgym.wrappers import ModelLearner
from relgym.wrappers.follower import scenes_of

__all__ = ["MODELS", "SUITE", "agreement", "trial"]

_SHAKEN: Final = (0.0, 1e-3, 0.3)
"""By how much scenes are changed, as a share of how much each number varies."""

_LEARNED, _FRESH = 300, 700
"""Seeds of what is learned from, and of what is asked."""

_CHUNK: Final = 10_000
_ALONE: Final = 300

Taught = tuple[WorldModel, SceneLayout, Float2D]
"""A model, a layout, and state vectors of fresh scenes."""


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


def agreement(taught: Taught, *, scenes: int, exported: int) -> dict[str, Any]:
    """Ask a model of many scenes, in all ways there are.

    Parameters
    ----------
    taught
        What is asked.
    scenes, exported
        How many are asked of the kernel, and how many of the exported Python.

    Returns
    -------
    ``scenes`` asked; ``outcomes``, the share of predictions with the same outcome, mode and margin by the kernel, and
    ``largest``, the largest difference of a value; ``alone``, whether scenes asked alone got the same bits;
    ``exported``, ``exported_outcomes`` and ``exported_largest``, the same of the exported Python; ``refused``, why
    there is no program, or empty.
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
            why = "laws of hypothesis classes that were added"
            nothing = dict.fromkeys(("outcomes", "largest", "exported_outcomes", "exported_largest"), 0.0)
            return {**nothing, "scenes": 0, "alone": False, "exported": 0, "refused": why}
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
    return {
        "scenes": scenes,
        "outcomes": float(np.mean(same)),
        "largest": largest,
        "alone": alone,
        "exported": exported,
        "exported_outcomes": float(np.mean(same_exported or 1.0)),
        "exported_largest": largest_exported,
        "refused": "",
    }


def _same(a: BatchPrediction, b: BatchPrediction) -> float:
    equal = (a.outcomes == b.outcomes) & (a.modes == b.modes) & (a.margins == b.margins)
    return float(equal.mean())


def _apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Largest difference, as a share of what is larger than 1."""
    return float((np.abs(a - b) / np.maximum(np.abs(b), 1.0)).max(initial=0.0))


def trial(*, model: str, scenes: int, exported: int) -> dict[str, Any]:
    """`agreement` of one of `MODELS`, as a task for the store of results."""
    return agreement(MODELS[model](), scenes=scenes, exported=exported)


def _models(extent: Extent, known: Known) -> Shown:
    size = {"scenes": extent["scenes"], "exported": min(extent["exported"], extent["scenes"])}
    asked = [{"model": name, **size} for name in extent["models"] or MODELS]
    pairs = known.pairs("relgym.experiments.agreement:trial", asked)
    told = [found for _, found in pairs if not found["refused"]]
    measures = [
        measured("same outcomes, kernel, %", 100.0, [100.0 * one["outcomes"] for one in told], ">="),
        measured("values apart, kernel", 1e-12, [one["largest"] for one in told]),
        measured("asked alone, the same bits", 1, [one["alone"] for one in told], ">="),
        measured(
            "same outcomes, exported Python, %",
            100.0,
            [100.0 * one["exported_outcomes"] for one in told],
            ">=",
        ),
        measured("values apart, exported Python", 1e-12, [one["exported_largest"] for one in told]),
    ]
    rows: list[list[Cell]] = []
    for arguments, one in pairs:
        if one["refused"]:
            rows.append([arguments["model"], f"left to arrays: {one['refused']}", *[""] * 6])
            continue
        kernel, exported = (
            [f"{one[asked]:,}", f"{100 * one[f'{which}outcomes']:.5g}", f"{one[f'{which}largest']:.1e}"]
            for asked, which in (("scenes", ""), ("exported", "exported_"))
        )
        rows.append([arguments["model"], *kernel, "yes" if one["alone"] else "no", *exported])
    heads = ["model", "scenes", "same, %", "apart", "alone", "exported", "same, %", "apart"]
    return Shown(measures if told else (), [table(heads, rows)])


SUITE: Final = Suite(
    "agreement",
    "Whether arrays, kernel and exported Python say the same",
    {"models": Benchmark("Models in all ways to run them", _models)},
    seeds=1,
    options={
        "models": Option((), f"of {', '.join(MODELS)}", tuple(MODELS)),
        "scenes": Option(100_000, "asked of arrays and of the kernel"),
        "exported": Option(24_000, "asked of the exported Python, too"),
    },
)
