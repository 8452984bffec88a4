"""What learning and asking cost: per transition through the wrapper, per query, per scene of a batch.

Seconds are of this process' CPU time: neighbours don't count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter, process_time
from typing import Any, Final

import gymnasium as gym
import numpy as np

import relgym  # noqa: F401 - registers the envs
from relgym.envs.ball_box_ramp import BallBoxRampEnv
from relgym.experiments.benchmark import Shown
from relgym.experiments.criterion import measured
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes
from relgym.experiments.worlds.online import learned
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Float1D
from relgym.wrappers import ModelLearner

__all__ = ["per_query", "per_step"]

SINGLES: Final = 2000
"""Scenes, evenly spread over a test set, that are asked for one by one."""


def per_step(training: Sequence[int], _: Sequence[int]) -> Shown:
    """Totals and quantiles of a transition's cost: env, relations, prediction and learning; one figure per seed."""
    runs = [_step_cost(seed) for seed in training]
    ms = [1000.0 * steps for steps, *_ in runs]
    measures = [
        measured("total, s", 30.0, [float(steps.sum()) + resets for steps, resets, *_ in runs]),
        measured("99th percentile, ms", 20.0, [np.quantile(m, 0.99) for m in ms]),
        measured("worst transition, ms", 250.0, [m.max() for m in ms]),
        measured("last 1,000 / second 1,000", 1.5, [m[-1000:].sum() / m[1000:2000].sum() for m in ms]),
    ]
    notes = [
        f"total {float(steps.sum()) + resets:.1f} s, of which resets {resets:.2f} s; by the clock {clock:.1f} s; "
        f"the engine alone {engine:.2f} s"
        for steps, resets, engine, clock in runs
    ]
    return Shown(measures, notes)


def _step_cost(seed: int) -> tuple[Float1D, float, float, float]:
    """Run the learner through the scenes of experiment 1, and the bare engine beside it, episode by episode.

    Seconds of every transition, shape ``(n,)``; of all resets; of the same steps of the engine alone; and of everything
    by the clock on the wall. Episodes say where to begin; what then happens is the env's own.
    """
    setting = BALL_EXPERIMENTS[1]
    given: dict[str, Any] = {
        "incline": setting.incline,
        "elasticity": setting.elasticity,
        "friction": setting.frictions[0],
    }
    env = ModelLearner(gym.make("relgym/BallBoxRamp-v0", **given), config={"frames": "world"})
    bare = BallBoxRampEnv(setting.incline, setting.elasticity, setting.frictions[0])
    steps, resets, engine, begin = [], 0.0, 0.0, perf_counter()
    for episode in ball_episodes(1, seed=seed):
        options = dict(episode.configuration)
        resets += _timed(env.reset, options=options)
        steps += [_timed(env.step, 0) for _ in range(len(episode))]
        bare.reset(options=options)
        engine += sum(_timed(bare._engine.step) for _ in range(len(episode)))
    return np.array(steps), resets, engine, perf_counter() - begin


def per_query(training: Sequence[int], tests: Sequence[int]) -> Shown:
    """What it costs to ask a model of experiment 1, one figure per test seed."""
    model = learned(ball_episodes(1, seed=training[0]))
    runs = [_query_cost(model, test) for test in tests]
    return Shown(
        [
            measured("predict_one, ms", 1.0, [1e3 * single for single, *_ in runs]),
            measured("predict_batch, us per scene", 20.0, [1e6 * batch for _, batch, _ in runs]),
            measured("bit for bit equal", 1.0, [equal for *_, equal in runs], ">="),
        ]
    )


def _query_cost(model: WorldModel, test: int) -> tuple[float, float, bool]:
    """Ask for every scene of a test set: all at once, and some one by one.

    Median seconds of a ``predict_one``, those of a ``predict_batch`` per scene, and whether both say the same, bit for
    bit.
    """
    parts = list(ball_episodes(1, seed=test, test=True))
    layout = parts[0].layout
    vectors = np.concatenate([episode.vectors[:-1] for episode in parts])
    model.predict_batch(layout, vectors[:10])
    start = process_time()
    batch = model.predict_batch(layout, vectors)
    per_scene = (process_time() - start) / len(vectors)
    times, equal, length = [], True, len(parts[0])
    for k in np.unique(np.linspace(0, len(vectors) - 1, SINGLES).astype(int)).tolist():
        scene = parts[k // length].scene(k % length)
        start = process_time()
        one = model.predict_one(scene)
        times.append(process_time() - start)
        equal &= one.scene.vector.tobytes() == batch.vectors[k].tobytes()
    return float(np.median(times)), per_scene, equal


def _timed(call: Callable[..., Any], *arguments: Any, **keywords: Any) -> float:
    start = process_time()
    call(*arguments, **keywords)
    return process_time() - start
