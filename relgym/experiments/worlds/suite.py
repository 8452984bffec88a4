"""Benchmarks of learning the thesis' worlds: accuracy, cost, learning online, noise (`relgym benchmark worlds`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.seeds import TEST_SEEDS, TRAINING_SEEDS, TUNING_SEEDS, TUNING_TEST_SEED
from relgym.experiments.worlds.accuracy import ball
from relgym.experiments.worlds.cost import per_query, per_step
from relgym.experiments.worlds.noise import (
    SIGMAS,
    VARIANCES,
    Sigma,
    best_sigmas,
    noise_measures,
    noise_outcomes,
)
from relgym.experiments.worlds.stream import later_episodes, prequential
from relgym.experiments.worlds.truck import bystanders, per_episode

__all__ = ["SUITE", "part"]


def _noise(training: Sequence[int], tests: Sequence[int]) -> Shown:
    """The estimated noise beside what is best set by hand, which is chosen on the seeds for tuning."""
    # Noise larger than expected is known to teach nothing, at a high price: every step is searched in vain.
    hand = {variance: [sigma for sigma in SIGMAS if sigma >= variance**0.5] for variance in VARIANCES}
    best = best_sigmas(noise_outcomes(training=TUNING_SEEDS[:1], test=TUNING_TEST_SEED, sigmas=hand))
    sigmas: dict[float, list[Sigma]] = {}
    for (variance, _), sigma in best.items():
        chosen = sigmas.setdefault(variance, ["auto"])
        chosen += [sigma] if sigma not in chosen else []
    outcomes = list(noise_outcomes(training=training, test=tests[0], sigmas=sigmas))
    told = [f"variance {o.variance:g}, sigma {o.sigma}, seed {o.seed}: {dict(o.errors)}" for o in outcomes]
    return Shown(noise_measures(outcomes, best), told)


_PARTS: Final[Mapping[str, tuple[str, Callable[[Sequence[int], Sequence[int]], Shown]]]] = {
    "ball-1": ("Experiment 1", partial(ball, 1)),
    "ball-2": ("Experiment 2", partial(ball, 2)),
    "ball-3": ("Experiment 3", partial(ball, 3)),
    "online": ("Errors while learning, experiment 1", prequential),
    "later-episodes": ("What later episodes may not change", later_episodes),
    "cost-per-step": ("Cost per transition, experiment 1", per_step),
    "cost-per-query": ("Cost per query, experiment 1", per_query),
    "truck-per-episode": ("TruckPush, constants per episode", per_episode),
    "truck-bystanders": ("TruckPush, bystanders and 2, 3 and 4 boxes", bystanders),
    "noise": ("Noise, experiment 1", _noise),
}
"""Titles, and what measures them from training and test seeds; roll-outs are measured with experiments 1 and 2."""


def part(*, name: str, seeds: Sequence[int], tuning: bool) -> dict[str, Any]:
    """Measure one benchmark, as a task for the store of results."""
    tests = (TUNING_TEST_SEED,) if tuning else TEST_SEEDS
    return _PARTS[name][1](seeds, tests).to_json()


def _benchmark(name: str) -> Benchmark:
    def measure(extent: Extent, known: Known) -> Shown:
        seeds = TUNING_SEEDS if extent["tuning"] else TRAINING_SEEDS
        asked = {"name": name, "tuning": extent["tuning"], "seeds": list(extent.first(seeds))}
        return known.whole("relgym.experiments.worlds.suite:part", asked)

    return Benchmark(_PARTS[name][0], measure)


SUITE: Final = Suite(
    "worlds",
    "Learning the thesis' worlds: accuracy, cost, learning online, noise",
    {name: _benchmark(name) for name in _PARTS},
    seeds=len(TRAINING_SEEDS),
    options={"tuning": Option(False, "the seeds for tuning instead of those for reporting")},
)
