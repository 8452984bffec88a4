"""What learning and asking cost: per transition through the wrapper, per query, per scene of a batch."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any

import gymnasium as gym
import numpy as np

import relgym  # noqa: F401 - registers the envs
from relgym.envs.ball_box_ramp import BallBoxRampEnv
from relgym.experiments.criterion import Measure, measured
from relgym.experiments.data import BALL_EXPERIMENTS, BallExperiment
from relgym.experiments.episodes import Episode
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Float1D, Scene
from relgym.wrappers import ModelLearner

__all__ = ["QueryCost", "StepCost", "query_cost", "query_measures", "step_cost", "step_measures"]


@dataclass(frozen=True)
class StepCost:
    """Cost of a stream of transitions, in seconds of this process' CPU time: neighbours don't count.

    Attributes
    ----------
    model
        What was learned meanwhile.
    steps
        Of every transition: env, relations, prediction and learning, shape ``(n,)``.
    resets
        Of all resets together.
    engine
        Of the same steps of the physics engine alone, together.
    clock
        Of everything, by the clock on the wall.
    """

    model: WorldModel
    steps: Float1D
    resets: float
    engine: float
    clock: float

    @property
    def total(self) -> float:
        """Everything but the engine alone."""
        return float(self.steps.sum()) + self.resets


def step_cost(episodes: Iterable[Episode], setting: BallExperiment = BALL_EXPERIMENTS[1]) -> StepCost:
    """Run the learner through the scenes of some episodes, and the bare engine beside it, episode by episode.

    Parameters
    ----------
    episodes
        Where episodes begin; what then happens is the env's own.
    setting
        Parameters of the world.
    """
    arguments = (setting.incline, setting.elasticity, setting.frictions[0])
    given: dict[str, Any] = dict(zip(("incline", "elasticity", "friction"), arguments, strict=True))
    env = ModelLearner(gym.make("relgym/BallBoxRamp-v0", **given), config={"frames": "world"})
    bare = BallBoxRampEnv(*arguments)
    steps, resets, engine, begin = [], 0.0, 0.0, perf_counter()
    for episode in episodes:
        options = dict(episode.configuration)
        resets += _timed(env.reset, options=options)
        steps += [_timed(env.step, 0) for _ in range(len(episode))]
        bare.reset(options=options)
        engine += sum(_timed(bare._engine.step) for _ in range(len(episode)))
    return StepCost(env.model, np.array(steps), resets, engine, perf_counter() - begin)


def step_measures(costs: Iterable[StepCost]) -> list[Measure]:
    """Totals and quantiles, one figure per run."""
    runs = list(costs)
    ms = [1000.0 * run.steps for run in runs]
    return [
        measured("total, s", 30.0, [run.total for run in runs]),
        measured("99th percentile, ms", 20.0, [np.quantile(m, 0.99) for m in ms]),
        measured("worst transition, ms", 250.0, [m.max() for m in ms]),
        measured("last 1,000 / second 1,000", 1.5, [m[-1000:].sum() / m[1000:2000].sum() for m in ms]),
    ]


@dataclass(frozen=True, slots=True)
class QueryCost:
    """Cost of asking, in seconds of CPU time.

    Attributes
    ----------
    single
        Median time of a ``predict_one`` of all targets.
    batch
        Time per scene of a ``predict_batch`` of all targets.
    equal
        Whether both say the same, bit for bit.
    """

    single: float
    batch: float
    equal: bool


def query_cost(model: WorldModel, episodes: Iterable[Episode], *, singles: int = 2000) -> QueryCost:
    """Ask a model for every scene of some episodes: all at once, and some one by one.

    Parameters
    ----------
    model
        The model; unchanged.
    episodes
        Episodes with the same objects.
    singles
        How many scenes, evenly spread, are asked for one by one.
    """
    parts = list(episodes)
    layout, schema = parts[0].layout, parts[0].schema
    vectors = np.concatenate([episode.vectors[:-1] for episode in parts])
    model.predict_batch(layout, vectors[:10])
    start = process_time()
    batch = model.predict_batch(layout, vectors)
    per_scene = (process_time() - start) / len(vectors)
    times, equal = [], True
    for k in np.unique(np.linspace(0, len(vectors) - 1, singles).astype(int)).tolist():
        scene = Scene(schema, layout, vectors[k])
        start = process_time()
        one = model.predict_one(scene)
        times.append(process_time() - start)
        equal &= one.scene.vector.tobytes() == batch.vectors[k].tobytes()
    return QueryCost(float(np.median(times)), per_scene, equal)


def query_measures(costs: Iterable[QueryCost]) -> list[Measure]:
    """One figure per run."""
    runs = list(costs)
    return [
        measured("predict_one, ms", 1.0, [1e3 * run.single for run in runs]),
        measured("predict_batch, us per scene", 20.0, [1e6 * run.batch for run in runs]),
        measured("bit for bit equal", 1.0, [run.equal for run in runs], ">="),
    ]


def _timed(call: Callable[..., Any], *arguments: Any, **keywords: Any) -> float:
    start = process_time()
    call(*arguments, **keywords)
    return process_time() - start
