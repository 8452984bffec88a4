"""Which tasks the tables and figures rest on; several share the same ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, Literal

from relgym.baselines.catalogue import CLASSIFIERS, REGRESSORS, installed
from relgym.baselines.tuned import setting_of
from relgym.experiments.chapter4.job import Plan
from relgym.experiments.chapter4.protocol import ABLATIONS, LEARNERS, WHOLE_TEST, Batch, Protocol
from relgym.experiments.jobs.code import LEARNER
from relgym.experiments.jobs.task import Task
from relgym.experiments.seeds import TEST_SEEDS, TRAINING_SEEDS, TUNING_SEEDS, TUNING_TEST_SEED

__all__ = [
    "ablations",
    "classifications",
    "lessons",
    "noise",
    "nothing",
    "one_polarity",
    "pushing",
    "regressions",
    "rollouts",
    "transfers",
    "tunings",
]

_ROOM: Final = "relgym.experiments.chapter4"

_EXPORT: Final = ("relgym.model.files.upgrade", "relgym.program.source")
"""What reads files of earlier versions, and what writes models down as Python: no section runs any of it."""


def _without(learner: str) -> tuple[str, ...]:
    """What a learner, or a baseline, runs nothing of, though it is imported beside it."""
    return _EXPORT if learner in ("world", "default", "auto") else LEARNER


def nothing(_: Protocol) -> Plan:
    """What is only drawn."""
    return {}


def pushing(protocol: Protocol) -> Plan:
    """Box pushing, every learner, every training seed; tables show the first."""
    return {
        learner: [
            Task(f"{_ROOM}.pushing:lesson", {"learner": learner, "seed": seed}, without=_without(learner))
            for seed in TRAINING_SEEDS
        ]
        for learner in LEARNERS
    }


def lessons(protocol: Protocol, experiment: int, learners: Sequence[str] = tuple(LEARNERS)) -> Plan:
    """A ball experiment: every learner, every batch."""
    runs = protocol.runs(protocol.long_batches if experiment == 3 else protocol.batches)
    return {learner: [_lesson(protocol, experiment, learner, run) for run in runs] for learner in learners}


def one_polarity(protocol: Protocol) -> Plan:
    """Experiment 1 without the choice of the positive class (tables 4.4 and 4.6): one batch."""
    return {"one polarity": [_lesson(protocol, 1, "one-polarity", protocol.runs(1)[0])]}


def ablations(protocol: Protocol) -> Plan:
    """The thesis' program on experiments 1 and 2, whole and without single causes of its errors.

    Always tested on all 24,000 examples: in a tenth of them a ball rests or doesn't, and rates differ threefold. Groups
    are ``experiment/learner``.
    """
    runs = protocol.runs(protocol.comparison_batches)
    plan: dict[str, list[Task]] = {}
    for experiment in (1, 2):
        last = {experiment: protocol.after(experiment)[-1:]}
        whole = replace(protocol, test_episodes=WHOLE_TEST, checkpoints=last)
        for learner in ABLATIONS:
            plan[f"{experiment}/{learner}"] = [_lesson(whole, experiment, learner, run) for run in runs]
    return plan


def transfers(protocol: Protocol, stages: Sequence[str]) -> Plan:
    """Experiment 1 trained without the box, without the ramp, or in two stages (§4.9)."""
    runs = protocol.runs(protocol.transfer_batches)
    return {
        learner: [_lesson(protocol, 1, learner, run, stages) for run in runs]
        for learner in ("thesis", "world", "default")
    }


def _lesson(
    protocol: Protocol, experiment: int, learner: str, run: Batch, stages: Sequence[str] = ()
) -> Task:
    arguments = {
        "learner": learner,
        "experiment": experiment,
        "seed": run.seed,
        "order": run.order,
        "checkpoints": list(protocol.after(experiment)),
        "tests": protocol.tests(),
        "stages": list(stages),
    }
    return Task(f"{_ROOM}.lesson:lesson", arguments, f"experiment {experiment}, {learner}", _without(learner))


def rollouts(protocol: Protocol) -> Plan:
    """Roll-outs of one model of experiment 1 per learner: of all batches the most accurate one (§4.8)."""
    arguments = {
        "experiment": 1,
        "batches": [[run.seed, run.order] for run in protocol.runs()],
        "episodes": protocol.after(1)[-1],
        "chosen_on": {"seeds": list(TEST_SEEDS[2:]), "episodes": protocol.test_episodes // len(TEST_SEEDS)},
        "tests": list(TEST_SEEDS[:2]),
        "trials": protocol.trials,
    }
    return {
        learner: [
            Task(f"{_ROOM}.rolled:imagine", {"learner": learner, **arguments}, learner, _without(learner))
        ]
        for learner in LEARNERS
    }


def noise(protocol: Protocol) -> Plan:
    """The sweep of §4.6: every expected variance against every true one; groups are the expected ones."""
    runs = protocol.runs(protocol.noise_batches)
    plan: dict[str, list[Task]] = {}
    for expected in (*protocol.variances, "auto", "default"):
        for true in protocol.variances:
            for run in runs:
                arguments = {
                    "expected": expected,
                    "true": true,
                    "seed": run.seed,
                    "order": run.order,
                    "episodes": protocol.after(1)[-1],
                    "tests": protocol.tests(),
                }
                task = Task(
                    f"{_ROOM}.noisy:lesson", arguments, f"expected {expected}", _without(f"{expected}")
                )
                plan.setdefault(f"{expected}", []).append(task)
    return plan


def regressions(protocol: Protocol, names: Sequence[str], shown: Sequence[str]) -> Plan:
    """Regressors on experiment 2, all whose libraries are installed; groups are ``baseline/features``."""
    return {
        f"{name}/{seen}": [_baseline(protocol, "regress", name, seen, run) for run in _comparing(protocol)]
        for name in names or installed(REGRESSORS)
        for seen in shown
    }


def classifications(
    protocol: Protocol, names: Sequence[str] = (), shown: Sequence[str] = ("thesis", "contact")
) -> Plan:
    """Classifiers on experiment 2; groups are ``baseline/features``."""
    return {
        f"{name}/{seen}": [_baseline(protocol, "classify", name, seen, run) for run in _comparing(protocol)]
        for name in names or installed(CLASSIFIERS)
        for seen in shown
    }


def _comparing(protocol: Protocol) -> Sequence[Batch]:
    return protocol.runs(protocol.comparison_batches)


def _baseline(
    protocol: Protocol, function: Literal["regress", "classify"], name: str, seen: str, run: Batch
) -> Task:
    arguments = {
        "baseline": name,
        "shown": seen,
        "experiment": 2,
        "seed": run.seed,
        "order": run.order,
        "checkpoints": list(protocol.after(2)),
        "tests": protocol.tests(),
        "setting": setting_of(function, name, seen),
    }
    return Task(f"{_ROOM}.comparison:{function}", arguments, f"{name}, {seen}", LEARNER)


def tunings(protocol: Protocol) -> Plan:
    """Every setting of every baseline on tuning seeds; groups are ``kind/baseline/features``."""
    plan: dict[str, list[Task]] = {}
    for function, known in (("regress", REGRESSORS), ("classify", CLASSIFIERS)):
        for name in installed(known):
            for seen in ("thesis", "contact"):
                for number in range(len(known[name].settings)):
                    arguments = {
                        "baseline": name,
                        "shown": seen,
                        "experiment": 2,
                        "seed": TUNING_SEEDS[0],
                        "order": 0,
                        "checkpoints": [protocol.tuning_episodes],
                        "tests": {"seeds": [TUNING_TEST_SEED], "episodes": 12},
                        "setting": number,
                    }
                    task = Task(f"{_ROOM}.comparison:{function}", arguments, f"{name}, {seen}", LEARNER)
                    plan.setdefault(f"{function}/{name}/{seen}", []).append(task)
    return plan
