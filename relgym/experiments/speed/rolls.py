"""How many steps a second learned models are rolled out: on one core, and on a graphics card where there is one.

In the worlds of `relgym.experiments.dyna.speed`, with what the engine makes in the same run. On a card the time counts
from the call to its result: scenes are sent there and fetched back (`relgym benchmark speed rolls`).
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from time import perf_counter, process_time
from typing import Any, Final, Literal

import numpy as np

from relgym.errors import ConfigError
from relgym.experiments.dyna.speed import HORIZONS, dreams, engine, rate
from relgym.model.running.compiled import KERNEL
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Float2D, SceneLayout

__all__ = ["scenes", "speeds", "trial"]

STEPS: Final = 100
FEW, MANY = 4096, 1 << 20
"""Scenes at once, on one core and on a card."""


def scenes(world: str, count: int) -> tuple[WorldModel, SceneLayout, Float2D]:
    """A model, and state vectors from all over its world, with random actions where there are any."""
    envs = dreams(world)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    deeds, found = envs._setting.shown.deeds(), []
    for _ in range(20):
        actions = envs.action_space.sample()
        found.append(deeds.joined(envs.vectors, deeds.checked(actions, envs.num_envs)))
        envs.step(actions)
    drawn = np.random.default_rng(0).integers(len(found) * envs.num_envs, size=count)
    model: Any = envs.model
    return model, deeds.layout, np.ascontiguousarray(np.concatenate(found)[drawn])


def speeds(world: str) -> tuple[float, float, str]:
    """Steps a second on one core and on a card (NaN where there is none), and why there is none."""
    KERNEL.load()
    model, layout, vectors = scenes(world, FEW)
    model.rollout_batch(layout, vectors, STEPS)

    def steps_a_second(clock: Callable[[], float], device: Literal["cpu", "cuda"]) -> float:
        found = []
        for _ in range(5):
            start = clock()
            lasted = model.rollout_batch(layout, vectors, STEPS, device=device).lasted
            found.append(int(lasted.sum()) / (clock() - start))
        return median(found)

    core = steps_a_second(process_time, "cpu")
    try:
        model.rollout_batch(layout, vectors, STEPS, device="cuda")
    except ConfigError as error:
        return core, np.nan, str(error)
    vectors = np.ascontiguousarray(np.tile(vectors, (MANY // FEW, 1)))
    return core, steps_a_second(perf_counter, "cuda"), ""


def trial(*, world: str) -> dict[str, Any]:
    """`speeds` and the engine's, as a task for the store of results."""
    core, card, why = speeds(world)
    own = rate(engine(world), rounds=3, steps=HORIZONS[world] + 1)
    return {"engine": own, "core": core, "card": card if card == card else None, "why": why}
