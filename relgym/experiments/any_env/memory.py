"""A long life: memory and cost of a step after many transitions, against those early on.

Measure one life per process: the peak of memory is the whole process'.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, count
from typing import Final, Literal

import numpy as np

from relgym.config import ModelConfig
from relgym.experiments.any_env.data import STUDIES, collect, nrmse_d, stream, view_of
from relgym.experiments.criterion import Figure
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes
from relgym.experiments.evaluate import evaluate
from relgym.experiments.worlds.accuracy import AXES
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition

__all__ = ["LIVES", "Life", "memory"]

STEPS, BOUND = 1_000_000, 200_000
"""Transitions, and examples kept: the default bound."""

EARLY, WINDOW = 10_000, 2_000
"""Costs at the end are compared with those of as many steps before this one."""

EXPERIMENT, EPISODES, TEST_EPISODES = 1, 400, 40
"""The ball's world; episodes of it that are drawn at a time, each time from another seed; and episodes evaluated on."""


@dataclass(frozen=True, slots=True)
class Life:
    """A world to live in.

    Attributes
    ----------
    transitions
        Fresh ones without end, of a seed.
    evaluated
        Whether a model is still right: figures and limits, on fresh transitions of a test seed.
    frames
        As in `ModelConfig`: while laws of motion do, modes rest, and a life costs little.
    """

    transitions: Callable[[int], Iterator[Transition]]
    evaluated: Callable[[WorldModel, int], Iterator[Figure]]
    frames: Literal["auto", "world"] = "auto"


def _carts(seed: int) -> Iterator[Transition]:
    study = STUDIES["cart"]
    return (step.transition for step in stream(study, view_of(study), seed))


def _cart_evaluated(model: WorldModel, test: int) -> Iterator[Figure]:
    error = nrmse_d(model, collect(STUDIES["cart"], 1_000, 2_000 + test))
    for prop in ("x", "th"):
        yield f"{prop}, still right", 1e-3, error[prop], "<="


def _balls(seed: int) -> Iterator[Transition]:
    for batch in count():
        for episode in ball_episodes(EXPERIMENT, seed=1_000 * seed + batch, episodes=EPISODES):
            yield from episode.transitions()


def _ball_evaluated(model: WorldModel, test: int) -> Iterator[Figure]:
    fresh = list(ball_episodes(EXPERIMENT, seed=test, episodes=TEST_EPISODES, test=True))
    found = evaluate(model, fresh, BALL_EXPERIMENTS[EXPERIMENT].modes())
    for axis, target in AXES.items():
        yield f"{axis}, wrong predictions", 0.001, found[target].total.rate, "<="


LIVES: Final = {
    "memory": Life(_carts, _cart_evaluated),
    "memory-ball": Life(_balls, _ball_evaluated),
    "memory-ball-modes": Life(_balls, _ball_evaluated, frames="world"),
}
"""By the name of the benchmark."""


def memory(
    name: str,
    seeds: Sequence[tuple[int, int]],
    *,
    quick: bool = False,
    steps: int | None = None,
    bound: int | None = None,
) -> Iterator[Figure]:
    """A stream of fresh transitions, of the first seed; `steps` of which `bound` are kept.

    The cost of the last steps is compared with that of a second model's at the beginning of the same stream, in turns:
    so it doesn't matter how busy the machine was earlier.
    """
    steps = steps or (12_000 if quick else STEPS)
    bound = bound or (2_000 if quick else BOUND)
    life, (training, test) = LIVES[name], seeds[0]
    window, at = min(WINDOW, steps // 4), min(EARLY, steps // 2)
    old, young = (_Living(life.transitions(training), bound, life.frames, n) for n in (steps, at))
    rows, peaks = list[int](), list[float]()
    for k in range(steps - window):
        old.step()
        if k >= 1.5 * bound and k % 100 == 0:  # the first cut is at 1.25 times the bound
            rows.append(old.model.history)
            peaks.append(_peak())
    for _ in range(at - window):
        young.step()
    for _ in range(window):
        young.step()
        old.step()
    old.model.finish()
    early, late = (float(np.median(each.costs[-window:])) for each in (young, old))
    print(
        f"{steps:,} transitions, {bound:,} kept: {1e3 * early:.3g} ms a step at {at:,}, {1e3 * late:.3g} at the end"
    )
    tenths = ", ".join(f"{1e3 * np.median(part):.3g}" for part in np.array_split(old.costs, 10))
    print(f"median by tenths: {tenths} ms; worst step {1e3 * old.costs.max():.3g} ms")
    print(f"peak memory {peaks[-1] / 1024:.0f} MiB\n{old.model.describe(digits=5)}")
    yield "median cost of a step at the end, over that at 10,000", 1.2, late / early, "<="
    yield "most rows kept, over the bound", 1.3, max(rows) / bound, "<="
    yield "peak memory at the end, over that at 1.5 bounds", 1.05, peaks[-1] / peaks[0], "<="
    yield from life.evaluated(old.model, test)


class _Living:
    """A model that lives through a stream, and what its steps cost, in seconds."""

    def __init__(
        self, stream: Iterator[Transition], bound: int, frames: Literal["auto", "world"], steps: int
    ) -> None:
        first = next(stream)
        self._stream = chain([first], stream)
        self.model = WorldModel(first.before.schema, ModelConfig(history=bound, frames=frames))
        self.costs = np.full(
            steps, np.nan
        )  # written to at once, so that it doesn't look like a growing memory
        self._taken = 0

    def step(self) -> None:
        """Learn from the next transition."""
        transition = next(self._stream)
        start = time.process_time()
        self.model.learn_one(transition)
        self.costs[self._taken] = time.process_time() - start
        self._taken += 1


def _peak() -> float:
    """Most memory that this process ever held, in the system's units (KiB on Linux)."""
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
