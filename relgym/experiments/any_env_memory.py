"""A long life: memory and cost of a step after many transitions, against those early on."""

from __future__ import annotations

import resource
import time
from collections.abc import Sequence
from itertools import islice

import numpy as np

from relgym.config import ModelConfig
from relgym.experiments.any_env_data import STUDIES, collect, nrmse_d, stream, view_of
from relgym.experiments.bar import Measure, measured
from relgym.model.world_model import WorldModel

__all__ = ["memory"]

STEPS, BOUND = 1_000_000, 200_000
"""Transitions, and examples kept: the default bound."""

EARLY, WINDOW = 10_000, 2_000
"""Costs at the end are compared with those of as many steps before this one."""


def memory(
    seeds: Sequence[tuple[int, int]],
    *,
    quick: bool = False,
    steps: int | None = None,
    bound: int | None = None,
) -> list[Measure]:
    """Row 10 on CartPole: a stream of fresh transitions, of the first seed."""
    steps = steps or (12_000 if quick else STEPS)
    bound = bound or (2_000 if quick else BOUND)
    study, (training, test) = STUDIES["cart"], seeds[0]
    view = view_of(study)
    model = WorldModel(view.schema, ModelConfig(history=bound))
    costs, rows, peaks = np.empty(steps), [], []
    for k, step in enumerate(islice(stream(study, view, training), steps)):
        start = time.process_time()
        model.learn_one(step.transition)
        costs[k] = time.process_time() - start
        if k >= 1.5 * bound and k % 100 == 0:  # the first cut is at 1.25 times the bound
            rows.append(model.history)
            peaks.append(_peak())
    model.finish()
    at, window = min(EARLY, steps // 2), min(WINDOW, steps // 4)
    early, late = (float(np.median(part)) for part in (costs[at - window : at], costs[-window:]))
    print(
        f"{steps:,} transitions, {bound:,} kept: {1e3 * early:.3g} ms a step at {at:,}, {1e3 * late:.3g} at the end"
    )
    print(
        f"worst step {1e3 * costs.max():.3g} ms; peak memory {peaks[-1] / 1024:.0f} MiB\n{model.describe(digits=5)}"
    )
    error = nrmse_d(model, collect(study, 1_000, 2_000 + test))
    return [
        measured("median cost of a step at the end, over that at 10,000", 1.2, [late / early]),
        measured("most rows kept, over the bound", 1.3, [max(rows) / bound]),
        measured("peak memory at the end, over that at 1.5 bounds", 1.05, [peaks[-1] / peaks[0]]),
        measured("x, still right", 1e-3, [error["x"]]),
        measured("th, still right", 1e-3, [error["th"]]),
    ]


def _peak() -> float:
    """Most memory that this process ever held, in the system's units (KiB on Linux)."""
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
