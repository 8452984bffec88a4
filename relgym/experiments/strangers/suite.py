"""Other people's worlds with nothing tuned to them: what is claimed, and how right claims are.

`relgym benchmark strangers` learns from 2,000 random steps of each env with the default configuration, and predicts
fresh episodes. Envs ending in ``-v5`` need the extra ``bench-envs``, those elsewhere ``bench-elsewhere``. What is
measured, per property:

- *claimed*, and *claimed and off*: by more than 5 % of the change (the median of those fresh steps that change it);
  *own*: by more than 5 % of each step's own change, however small;
- *against ridge*: root mean square error, fallback values included, over that of ridge regression of the change on
  (x, u, 1), fitted to the same steps; *against persistence*: the same over that of saying that nothing changes;
- *calibration error*: mean distance between the probability stated and the share of predictions that came true, over
  ten bins of the probability (Naeini et al. 2015), of all targets together;
- *coverage*: the share of next values inside the 95 % interval stated;
- with ``--advised``: the same with the features that are advised, learned from the same steps, and *against library
  ridge* and *against PySINDy* on the same columns (`relgym.experiments.strangers.baselines`);
- processor time per step, mean and largest. What is loaded once in a process, the kernel, is loaded before, and
  what Python's garbage collector does with all that was there before isn't counted: it is the same for any program.
"""

from __future__ import annotations

import gc
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.envs.views import NumbersView
from relgym.experiments.any_env.data import Study, stream
from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.criterion import measured
from relgym.experiments.seeds import TRAINING_SEEDS
from relgym.experiments.strangers.baselines import BASELINES, predicted, ridge, short
from relgym.experiments.strangers.elsewhere import ELSEWHERE
from relgym.experiments.strangers.made import MADE, TEXTBOOK
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.reports.text import Cell, table
from relgym.model.running.compiled import KERNEL
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition

__all__ = ["NAMED", "OTHERS", "SUITE", "measure", "trial"]

NAMED: Final = (
    "InvertedPendulum-v5",
    "Reacher-v5",
    "HalfCheetah-v5",
    "Ant-v5",
    "BipedalWalker-v3",
    "LunarLander-v3",
)
"""What thresholds may be chosen on."""

OTHERS: Final = (
    "Hopper-v5",
    "Pusher-v5",
    "Acrobot-v1",
    "Swimmer-v5",
    "Walker2d-v5",
    "MountainCar-v0",
    "MountainCarContinuous-v0",
    "CartPole-v1",
    "Pendulum-v1",
    "InvertedDoublePendulum-v5",
    *MADE,
)
"""What nothing was chosen on."""

STEPS: Final = 2_000
"""Learned from, and as many fresh ones predicted."""

WARM: Final = 40
"""Steps of another model before, which load what a process loads once."""

OFF: Final = 0.05
"""Share of the change by which a claim may be off."""

_PREDICTED: Final = OUTCOMES.index(Outcome.PREDICTED)


def measure(env_id: str, seed: int, steps: int = STEPS, *, advised: bool = False) -> dict[str, Any]:
    """Learn one env, and measure what is claimed of fresh episodes.

    Parameters
    ----------
    env_id
        Gymnasium's id.
    seed
        Of the training steps; the fresh ones' is another.
    steps
        Learned from, and predicted.
    advised
        Whether another model learns with the features that the default one advises, and is compared on those.
    """
    env = gym.make(env_id)
    view = NumbersView(env.observation_space, env.action_space)
    env.close()
    study = Study(env_id, ())
    training = _transitions(study, view, seed, steps)
    fresh = _transitions(study, view, 50_000 + seed, steps)
    warm = WorldModel(view.schema)
    KERNEL.load()
    for transition in training[:WARM]:
        compare_and_learn(warm, transition, warm.predict_one(transition.before), precision=view.precision)
    gc.collect()
    gc.freeze()
    model, costs = _taught(view, training, ModelConfig())
    baselines = {"ridge": _ridge(training, fresh)}
    features: tuple[str, ...] = ()
    if advised:
        features = model.advised_features()
        model, costs = _taught(view, training, ModelConfig(features=features))
        baselines |= predicted(model, training, fresh)
    return {
        "env": env_id,
        "seed": seed,
        "features": list(features),
        "mean_ms": 1e3 * float(np.mean(costs)),
        "max_ms": 1e3 * float(np.max(costs)),
        **_compared(model, baselines, fresh, view.precision),
    }


def _taught(
    view: NumbersView, training: Sequence[Transition], config: ModelConfig
) -> tuple[WorldModel, list[float]]:
    """A model of some steps, and the processor time that each took."""
    model, costs = WorldModel(view.schema, config), []
    for transition in training:
        began = time.thread_time()
        compare_and_learn(model, transition, model.predict_one(transition.before), precision=view.precision)
        costs.append(time.thread_time() - began)
    model.finish()
    return model, costs


def _transitions(study: Study, view: NumbersView, seed: int, steps: int) -> list[Transition]:
    found = stream(study, view, seed)
    return [next(found).transition for _ in range(steps)]


def _compared(
    model: WorldModel,
    baselines: Mapping[str, Mapping[str, NDArray[np.float64]]],
    fresh: Sequence[Transition],
    precision: float,
) -> dict[str, Any]:
    """What is claimed of fresh steps and how right it is; `baselines`: the changes that others predict, by property."""
    layout = fresh[0].before.layout
    before = np.array([t.before.vector for t in fresh])
    said = model.predict_batch(layout, before)
    rows: dict[str, dict[str, float]] = {}
    every: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    for k, (name, prop) in enumerate(said.parts):
        place = layout.column(layout.index(name), prop)
        came = np.array([t.after[name][prop] for t in fresh])
        angle = prop in layout.types[layout.index(name)].angles
        error = short(said.vectors[:, place] - came, angle)
        change = short(came - before[:, place], angle)
        moved = np.abs(change[change != 0.0])
        size = float(np.median(moved)) if len(moved) else 0.0
        claimed = said.outcomes[:, k] == _PREDICTED
        rounding = np.maximum(1e-9, precision * np.maximum(1.0, np.abs(came)))
        off = np.abs(error) > np.maximum(rounding, OFF * size)
        rows[f"{name}.{prop}"] = {
            "claimed": float(claimed.mean()),
            "claimed_off": float((claimed & off).mean()),
            "claimed_off_own": float(
                (claimed & (np.abs(error) > np.maximum(rounding, OFF * np.abs(change)))).mean()
            ),
            "persistence": _ratio(error, change, rounding),
            **{
                baseline: _ratio(error, short(said_there[f"{name}.{prop}"] - change, angle), rounding)
                for baseline, said_there in baselines.items()
            },
        }
        stated, width = said.probabilities[:, k], said.intervals[:, k]
        known = np.isfinite(stated)
        every.append((stated[known], ~off[known]))
        inside = np.abs(error) <= np.maximum(width, rounding)
        rows[f"{name}.{prop}"]["coverage"] = float(inside[np.isfinite(width)].mean())
    columns = {key: np.array([row[key] for row in rows.values()]) for key in next(iter(rows.values()))}
    summary = {key: float(np.mean(columns[key])) for key in ("claimed", "claimed_off", "claimed_off_own")}
    for baseline in baselines:
        summary[f"{baseline}_median"] = float(np.median(columns[baseline]))
        summary[f"{baseline}_worst"] = float(columns[baseline].max())
    summary |= {
        "persistence_worst": float(columns["persistence"].max()),
        "ece": _calibration_error(every),
        "coverage": float(np.nanmean(columns["coverage"])),
    }
    return {**summary, "properties": rows}


def _ratio(error: NDArray[np.float64], other: NDArray[np.float64], rounding: NDArray[np.float64]) -> float:
    """Ratio of root mean squares; errors within rounding aren't told apart."""
    least = float(np.sqrt(np.square(rounding).mean()))
    sizes = [float(np.sqrt(np.square(e).mean())) for e in (error, other)]
    return max(sizes[0], least) / max(sizes[1], least)


def _ridge(training: Sequence[Transition], fresh: Sequence[Transition]) -> dict[str, NDArray[np.float64]]:
    """Changes that ridge regression on (x, u, 1) predicts, by property: standardised columns, penalty 1."""
    x, z = (np.array([t.before.vector for t in part]) for part in (training, fresh))
    mean, std = x.mean(axis=0), x.std(axis=0)
    std[std == 0.0] = 1.0
    x, z = (x - mean) / std, (z - mean) / std
    layout = training[0].before.layout
    found = {}
    for index, (name, kind) in enumerate(zip(layout.names, layout.types, strict=True)):
        for prop in kind.properties if name in training[0].after else ():
            place = layout.column(index, prop)
            y = np.array([t.after[name][prop] - t.before.vector[place] for t in training])
            y = short(y, prop in kind.angles)
            found[f"{name}.{prop}"] = z @ ridge(x, y - y.mean()) + y.mean()
    return found


def _calibration_error(every: list[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> float:
    stated, right = (np.concatenate(part) for part in zip(*every, strict=True))
    bins = np.minimum((10 * stated).astype(int), 9)
    shares = [
        (bins == k).mean() * abs(stated[bins == k].mean() - right[bins == k].mean()) for k in np.unique(bins)
    ]
    return float(sum(shares))


def trial(*, env: str, seed: int, steps: int, advised: bool) -> dict[str, Any]:
    """`measure`, as a task for the store of results; what isn't known is left out."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # envs and their bindings warn when they are made
        found = measure(env, seed, steps, advised=advised)
    rows = found.pop("properties")
    known = {name: {k: v for k, v in row.items() if np.isfinite(v)} for name, row in rows.items()}
    told = {k: v for k, v in found.items() if not isinstance(v, float) or np.isfinite(v)}
    return {**told, "properties": known}


_COLUMNS: Final = {
    "claimed": "claimed",
    "claimed_off": "and off",
    "ridge_median": "over ridge",
    "ridge_worst": "worst",
    "persistence_worst": "over latest",
    "ece": "calibration",
    "coverage": "coverage",
    **{f"{name}_{which}": f"{name} {which}" for name in BASELINES for which in ("median", "worst")},
    "mean_ms": "ms a step",
    "max_ms": "longest",
}


def _of(envs: Sequence[str]) -> Callable[[Extent, Known], Shown]:
    def measured_of(extent: Extent, known: Known) -> Shown:
        asked = [
            {"env": env, "seed": seed, "steps": extent["steps"], "advised": extent["advised"]}
            for env in envs or extent["envs"]
            if not extent["envs"] or env in extent["envs"]
            for seed in extent.first(TRAINING_SEEDS)
        ]
        found = known("relgym.experiments.strangers.suite:trial", asked)
        if not found:
            return Shown()
        measures = [
            measured("claimed and off, % of predictions", 1.0, [100.0 * one["claimed_off"] for one in found]),
            measured(
                "error over ridge regression's, median property", 1.0, [one["ridge_median"] for one in found]
            ),
            measured("the same, worst property", 1.1, [one["ridge_worst"] for one in found]),
            measured("calibration error, %", 2.0, [100.0 * one["ece"] for one in found if "ece" in one]),
        ]
        there = [name for name in _COLUMNS if any(name in one for one in found)]
        rows: list[list[Cell]] = [
            [one["env"], one["seed"], *(f"{one[k]:.4g}" if k in one else "-" for k in there)] for one in found
        ]
        notes = [table(["env", "seed", *(_COLUMNS[name] for name in there)], rows)]
        notes += [
            f"{one['env']}, seed {one['seed']}: {', '.join(one['features'])}"
            for one in found
            if one["features"]
        ]
        return Shown(measures, notes)

    return measured_of


SUITE: Final = Suite(
    "strangers",
    "Other people's worlds with nothing tuned to them",
    {
        "named": Benchmark("Worlds that thresholds may be chosen on", _of(NAMED)),
        "others": Benchmark("Worlds that nothing was chosen on", _of(OTHERS)),
        "textbook": Benchmark("Small worlds by the textbook", _of(TEXTBOOK)),
        "elsewhere": Benchmark("Worlds of other packages", _of(ELSEWHERE)),
        "any": Benchmark("Any worlds (--envs)", _of(())),
    },
    seeds=3,
    options={
        "envs": Option((), "ids of envs; of a list only those"),
        "steps": Option(STEPS, "learned from, and predicted"),
        "advised": Option(False, "with the features that are advised; needs the extra bench-envs"),
    },
    usual=("named",),
)
