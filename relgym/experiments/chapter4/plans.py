"""Which tasks the tables and figures rest on; several share the same ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, Literal, TypeAlias

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
    size = {"episodes": protocol.after(1)[-1], "tests": protocol.tests()}
    return {
        f"{expected}": [
            Task(
                f"{_ROOM}.noisy:lesson",
                {"expected": expected, "true": true, "seed": run.seed, "order": run.order, **size},
                f"expected {expected}",
                _without(f"{expected}"),
            )
            for true in protocol.variances
            for run in protocol.runs(protocol.noise_batches)
        ]
        for expected in (*protocol.variances, "auto", "default")
    }


def regressions(protocol: Protocol, names: Sequence[str], shown: Sequence[str]) -> Plan:
    """Regressors on experiment 2, all whose libraries are installed; groups are ``baseline/features``."""
    return _compared(protocol, "regress", names or installed(REGRESSORS), shown)


def classifications(
    protocol: Protocol, names: Sequence[str] = (), shown: Sequence[str] = ("thesis", "contact")
) -> Plan:
    """Classifiers on experiment 2; groups are ``baseline/features``."""
    return _compared(protocol, "classify", names or installed(CLASSIFIERS), shown)


_Kind: TypeAlias = Literal["regress", "classify"]


def _compared(protocol: Protocol, kind: _Kind, names: Sequence[str], shown: Sequence[str]) -> Plan:
    size = {"checkpoints": list(protocol.after(2)), "tests": protocol.tests()}
    runs = protocol.runs(protocol.comparison_batches)
    return {
        f"{name}/{seen}": [
            _baseline(kind, name, seen, run, setting_of(kind, name, seen), size) for run in runs
        ]
        for name in names
        for seen in shown
    }


def _baseline(kind: _Kind, name: str, seen: str, run: Batch, setting: int, size: Mapping[str, Any]) -> Task:
    about = {"baseline": name, "shown": seen, "setting": setting, "experiment": 2}
    arguments = {**about, "seed": run.seed, "order": run.order, **size}
    return Task(f"{_ROOM}.comparison:{kind}", arguments, f"{name}, {seen}", LEARNER)


def tunings(protocol: Protocol) -> Plan:
    """Every setting of every baseline on tuning seeds; groups are ``kind/baseline/features``."""
    size = {
        "checkpoints": [protocol.tuning_episodes],
        "tests": {"seeds": [TUNING_TEST_SEED], "episodes": 12},
    }
    kinds: dict[_Kind, Mapping[str, Any]] = {"regress": REGRESSORS, "classify": CLASSIFIERS}
    return {
        f"{kind}/{name}/{seen}": [
            _baseline(kind, name, seen, Batch(TUNING_SEEDS[0], 0), number, size)
            for number in range(len(known[name].settings))
        ]
        for kind, known in kinds.items()
        for name in installed(known)
        for seen in ("thesis", "contact")
    }
