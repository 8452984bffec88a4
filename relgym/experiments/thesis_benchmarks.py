"""Benchmarks of learning the thesis' worlds: accuracy, cost, learning online, noise; each figure beside its limit.

``python -m relgym.experiments.thesis_benchmarks ball-1 noise --json figures.json`` measures two of them and writes the
figures down as well.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

from relgym.experiments.accuracy import AXES, Outcome, accuracy, ball_measures
from relgym.experiments.cost import query_cost, query_measures, step_cost, step_measures
from relgym.experiments.criterion import Measure, report
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes
from relgym.experiments.noise import (
    SIGMAS,
    VARIANCES,
    NoiseOutcome,
    Sigma,
    best_sigmas,
    noise_measures,
    noise_outcomes,
)
from relgym.experiments.online import follow, last, learned
from relgym.experiments.seeds import TEST_SEEDS, TRAINING_SEEDS, TUNING_SEEDS, TUNING_TEST_SEED
from relgym.experiments.stream import box_then_ramp, prequential_measures, same_model, stream_measures
from relgym.experiments.truck import bystander_measures, bystanders, counts, per_episode, per_episode_measures

__all__ = ["main"]


Section: TypeAlias = tuple[str, list[Measure], list[str]]
"""Title, figures and remarks of one benchmark."""


@dataclass(frozen=True, slots=True)
class Request:
    """Which seeds to measure on."""

    training: tuple[int, ...]
    tests: tuple[int, ...]


def _ball(experiment: int) -> Callable[[Request], Section]:
    def measure(request: Request) -> Section:
        outcomes = []
        for outcome in accuracy(experiment, training=request.training, tests=request.tests):
            outcomes.append(outcome)
            print("\n".join(_lines(outcome)), flush=True)
        return f"experiment {experiment}", ball_measures(experiment, outcomes), []

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


def _steps(request: Request) -> Section:
    runs = [step_cost(ball_episodes(1, seed=seed)) for seed in request.training]
    notes = [
        f"total {run.total:.1f} s, of which resets {run.resets:.2f} s; by the clock {run.clock:.1f} s; "
        f"the engine alone {run.engine:.2f} s"
        for run in runs
    ]
    return "cost per transition, experiment 1", step_measures(runs), notes


def _queries(request: Request) -> Section:
    model = learned(ball_episodes(1, seed=request.training[0]))
    costs = [query_cost(model, list(ball_episodes(1, seed=test, test=True))) for test in request.tests]
    return "cost per query, experiment 1", query_measures(costs), []


def _prequential(request: Request) -> Section:
    laws = BALL_EXPERIMENTS[1].modes()
    courses = [last(follow(ball_episodes(1, seed=seed), laws=laws)) for seed in request.training]
    return "errors while learning, experiment 1", prequential_measures(courses), []


def _stream(request: Request) -> Section:
    same = [same_model(ball_episodes(1, seed=seed, episodes=16), 8) for seed in request.training]
    kinds = [box_then_ramp(seed=seed, test=request.tests[0]) for seed in request.training]
    notes = [f"box-only scenes wrong before {each.before}, after {each.after}" for each in kinds]
    return "what later episodes may not change", stream_measures(same, kinds), notes


def _per_episode(request: Request) -> Section:
    outcomes = [per_episode(seed=seed, test=request.tests[0]) for seed in request.training]
    exact = sum(outcome.found == 3 and not outcome.spurious for outcome in outcomes)
    notes = [f"exactly three modes: {exact} of {len(outcomes)} seeds"]
    notes += [f"other modes: {each.spurious}; noise: {each.noise}" for each in outcomes if each.spurious]
    return "truck-push, constants per episode", per_episode_measures(outcomes), notes


def _bystanders(request: Request) -> Section:
    test = request.tests[0]
    beside = [bystanders(seed=seed, test=test) for seed in request.training]
    counted = [counts(seed=seed, test=test) for seed in request.training]
    return "truck-push, bystanders and 2, 3 and 4 boxes", bystander_measures(beside, counted), []


def _heard(outcomes: Iterable[NoiseOutcome]) -> Iterator[NoiseOutcome]:
    """Tell of each outcome as it comes: all of them take an hour."""
    for each in outcomes:
        told = f"variance {each.variance:g}, sigma {each.sigma}, seed {each.seed}: {dict(each.errors)}"
        print(f"  {told}", flush=True)
        yield each


def _noise(request: Request) -> Section:
    # Noise larger than expected is known to teach nothing, at a high price: every step is searched in vain.
    hand = {variance: [sigma for sigma in SIGMAS if sigma >= variance**0.5] for variance in VARIANCES}
    best = best_sigmas(_heard(noise_outcomes(training=TUNING_SEEDS[:1], test=TUNING_TEST_SEED, sigmas=hand)))
    sigmas: dict[float, list[Sigma]] = {}
    for (variance, _), sigma in best.items():
        chosen = sigmas.setdefault(variance, ["auto"])
        chosen += [sigma] if sigma not in chosen else []
    outcomes = list(_heard(noise_outcomes(training=request.training, test=request.tests[0], sigmas=sigmas)))
    return "noise, experiment 1", noise_measures(outcomes, best), []


BENCHMARKS: Final[Mapping[str, Callable[[Request], Section]]] = {
    "ball-1": _ball(1),
    "ball-2": _ball(2),
    "ball-3": _ball(3),
    "online": _prequential,
    "later-episodes": _stream,
    "cost-per-step": _steps,
    "cost-per-query": _queries,
    "truck-per-episode": _per_episode,
    "truck-bystanders": _bystanders,
    "noise": _noise,
}
"""By name; roll-outs are measured with the ball's experiments 1 and 2."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure the benchmarks named on the command line and print them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("benchmarks", nargs="+", choices=list(BENCHMARKS))
    parser.add_argument("--json", type=Path, help="where to write the figures")
    parser.add_argument(
        "--tuning", action="store_true", help="the seeds for tuning instead of those for reporting"
    )
    parser.add_argument("--seeds", type=int, help="only so many training seeds")
    chosen = parser.parse_args(arguments)
    training = (TUNING_SEEDS if chosen.tuning else TRAINING_SEEDS)[: chosen.seeds]
    request = Request(training, (TUNING_TEST_SEED,) if chosen.tuning else TEST_SEEDS)
    found: dict[str, Any] = {}
    for name in chosen.benchmarks:
        title, measures, notes = BENCHMARKS[name](request)
        found[name] = {"title": title, "measures": [m.to_json() for m in measures], "notes": notes}
        print(report(f"{name}: {title}", measures, notes), flush=True)
    if chosen.json:
        chosen.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
