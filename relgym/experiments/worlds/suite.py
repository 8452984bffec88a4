"""Benchmarks of learning the thesis' worlds: accuracy, cost, learning online, noise (`relgym benchmark worlds`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes
from relgym.experiments.seeds import TEST_SEEDS, TRAINING_SEEDS, TUNING_SEEDS, TUNING_TEST_SEED
from relgym.experiments.worlds.accuracy import AXES, Outcome, accuracy, ball_measures
from relgym.experiments.worlds.cost import query_cost, query_measures, step_cost, step_measures
from relgym.experiments.worlds.noise import (
    SIGMAS,
    VARIANCES,
    NoiseOutcome,
    Sigma,
    best_sigmas,
    noise_measures,
    noise_outcomes,
)
from relgym.experiments.worlds.online import follow, last, learned
from relgym.experiments.worlds.stream import box_then_ramp, prequential_measures, same_model, stream_measures
from relgym.experiments.worlds.truck import (
    bystander_measures,
    bystanders,
    counts,
    per_episode,
    per_episode_measures,
)

__all__ = ["SUITE", "part"]


@dataclass(frozen=True, slots=True)
class Request:
    """Which seeds to measure on."""

    training: tuple[int, ...]
    tests: tuple[int, ...]


def _ball(experiment: int) -> Callable[[Request], Shown]:
    def measure(request: Request) -> Shown:
        outcomes = list(accuracy(experiment, training=request.training, tests=request.tests))
        return Shown(ball_measures(experiment, outcomes), [line for o in outcomes for line in _lines(o)])

    return measure


def _lines(outcome: Outcome) -> list[str]:
    lines = [f"training seed {outcome.seed}:"]
    for axis, known in outcome.targets.items():
        lines.append(f"  {axis}: {len(known.stated)} analytic modes, noise {known.noise:.3%}")
        lines += [f"     missing:  {name}" for name in known.missing]
        lines += [f"     spurious: {formula}" for formula in known.spurious]
    for test, evaluation in outcome.evaluations.items():
        for axis, target in AXES.items():
            errors = evaluation[target]
            bad = ", ".join(f"{m.name} {m.wrong}/{m.examples}" for m in errors.modes if m.wrong)
            lines.append(
                f"  test {test} {axis}: wrong {errors.total.rate:.4%} ({bad}); left out {errors.left_out}"
            )
        if test in outcome.rolled:
            rolled = outcome.rolled[test]
            lines.append(
                f"  test {test} roll-outs: {rolled.failed} of {rolled.trials} failed, {rolled.failed_without_corner} "
                f"without a corner, {rolled.stopped} stopped early; median error {rolled.median:.1e}"
            )
    return lines


def _steps(request: Request) -> Shown:
    runs = [step_cost(ball_episodes(1, seed=seed)) for seed in request.training]
    notes = [
        f"total {run.total:.1f} s, of which resets {run.resets:.2f} s; by the clock {run.clock:.1f} s; "
        f"the engine alone {run.engine:.2f} s"
        for run in runs
    ]
    return Shown(step_measures(runs), notes)


def _queries(request: Request) -> Shown:
    model = learned(ball_episodes(1, seed=request.training[0]))
    costs = [query_cost(model, list(ball_episodes(1, seed=test, test=True))) for test in request.tests]
    return Shown(query_measures(costs))


def _prequential(request: Request) -> Shown:
    laws = BALL_EXPERIMENTS[1].modes()
    courses = [last(follow(ball_episodes(1, seed=seed), laws=laws)) for seed in request.training]
    return Shown(prequential_measures(courses))


def _stream(request: Request) -> Shown:
    same = [same_model(ball_episodes(1, seed=seed, episodes=16), 8) for seed in request.training]
    kinds = [box_then_ramp(seed=seed, test=request.tests[0]) for seed in request.training]
    notes = [f"box-only scenes wrong before {each.before}, after {each.after}" for each in kinds]
    return Shown(stream_measures(same, kinds), notes)


def _per_episode(request: Request) -> Shown:
    outcomes = [per_episode(seed=seed, test=request.tests[0]) for seed in request.training]
    exact = sum(outcome.found == 3 and not outcome.spurious for outcome in outcomes)
    notes = [f"exactly three modes: {exact} of {len(outcomes)} seeds"]
    notes += [f"other modes: {each.spurious}; noise: {each.noise}" for each in outcomes if each.spurious]
    return Shown(per_episode_measures(outcomes), notes)


def _bystanders(request: Request) -> Shown:
    test = request.tests[0]
    beside = [bystanders(seed=seed, test=test) for seed in request.training]
    counted = [counts(seed=seed, test=test) for seed in request.training]
    return Shown(bystander_measures(beside, counted))


def _told(each: NoiseOutcome) -> str:
    return f"variance {each.variance:g}, sigma {each.sigma}, seed {each.seed}: {dict(each.errors)}"


def _noise(request: Request) -> Shown:
    # Noise larger than expected is known to teach nothing, at a high price: every step is searched in vain.
    hand = {variance: [sigma for sigma in SIGMAS if sigma >= variance**0.5] for variance in VARIANCES}
    best = best_sigmas(noise_outcomes(training=TUNING_SEEDS[:1], test=TUNING_TEST_SEED, sigmas=hand))
    sigmas: dict[float, list[Sigma]] = {}
    for (variance, _), sigma in best.items():
        chosen = sigmas.setdefault(variance, ["auto"])
        chosen += [sigma] if sigma not in chosen else []
    outcomes = list(noise_outcomes(training=request.training, test=request.tests[0], sigmas=sigmas))
    return Shown(noise_measures(outcomes, best), [_told(each) for each in outcomes])


_PARTS: Final[Mapping[str, tuple[str, Callable[[Request], Shown]]]] = {
    "ball-1": ("Experiment 1", _ball(1)),
    "ball-2": ("Experiment 2", _ball(2)),
    "ball-3": ("Experiment 3", _ball(3)),
    "online": ("Errors while learning, experiment 1", _prequential),
    "later-episodes": ("What later episodes may not change", _stream),
    "cost-per-step": ("Cost per transition, experiment 1", _steps),
    "cost-per-query": ("Cost per query, experiment 1", _queries),
    "truck-per-episode": ("TruckPush, constants per episode", _per_episode),
    "truck-bystanders": ("TruckPush, bystanders and 2, 3 and 4 boxes", _bystanders),
    "noise": ("Noise, experiment 1", _noise),
}
"""Roll-outs are measured with the ball's experiments 1 and 2."""


def part(*, name: str, seeds: Sequence[int], tuning: bool) -> dict[str, Any]:
    """Measure one benchmark, as a task for the store of results."""
    tests = (TUNING_TEST_SEED,) if tuning else TEST_SEEDS
    return _PARTS[name][1](Request(tuple(seeds), tests)).to_json()


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
