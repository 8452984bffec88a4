"""How many steps a second learned models are rolled out: on one core, and on a graphics card where there is one.

``python -m relgym.experiments.roll_speed`` prints a line for each of the worlds of `relgym.experiments.dyna_speed`,
with what the engine makes in the same run. On a card the time counts from the call to its result: scenes are sent there
and fetched back.
"""

from __future__ import annotations

from statistics import median
from time import perf_counter, process_time
from typing import Any, Final

import numpy as np

from relgym.errors import ConfigError
from relgym.experiments.dyna_speed import HORIZONS, WORLDS, dreams, engine, rate
from relgym.model.compiled import KERNEL
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Float2D, SceneLayout

__all__ = ["main", "scenes", "speeds"]

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


def speeds(world: str, *, few: int = FEW, many: int = MANY) -> tuple[float, float, str]:
    """Steps a second on one core and on a card (NaN where there is none), and why there is none."""
    KERNEL.load()
    model, layout, vectors = scenes(world, few)
    model.rollout_batch(layout, vectors, STEPS)
    core = []
    for _ in range(5):
        start = process_time()
        lasted = model.rollout_batch(layout, vectors, STEPS).lasted
        core.append(int(lasted.sum()) / (process_time() - start))
    try:
        model.rollout_batch(layout, vectors, STEPS, device="cuda")
    except ConfigError as error:
        return median(core), np.nan, str(error)
    vectors = np.ascontiguousarray(np.tile(vectors, (-(-many // few), 1)))
    card = []
    for _ in range(5):
        start = perf_counter()
        lasted = model.rollout_batch(layout, vectors, STEPS, device="cuda").lasted
        card.append(int(lasted.sum()) / (perf_counter() - start))
    return median(core), median(card), ""


def main() -> None:
    """Print the table."""
    print(f"{'million steps a second':<24}{'engine':>8}{'one core':>10}{'card':>8}")
    for world in WORLDS:
        core, card, why = speeds(world)
        own = rate(engine(world), rounds=3, steps=HORIZONS[world] + 1)
        told = f"{card / 1e6:>8.1f}" if card == card else "  not measured: " + why
        print(f"{world:<24}{own / 1e6:>8.3f}{core / 1e6:>10.1f}{told}", flush=True)


if __name__ == "__main__":
    main()
