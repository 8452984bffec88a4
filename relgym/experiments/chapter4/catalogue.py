"""All jobs by name: every table and figure of chapter IV, those of chapter III, and what is beyond the thesis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

from relgym.errors import ConfigError
from relgym.experiments.chapter4 import (
    figures_accuracy,
    figures_comparison,
    figures_drawn,
    figures_rollouts,
    figures_trees,
    plans,
    tables_baselines,
    tables_clauses,
    tables_errors,
    tables_modes,
)
from relgym.experiments.chapter4.job import Job, Plan
from relgym.experiments.chapter4.protocol import LEARNERS, Protocol

__all__ = ["JOBS", "chosen"]

_RELATIONAL: Final = ("original", "thesis", "world")
"""Learners that have modes and clauses."""

_X: Final = ("ball.vx",)
_BOTH: Final = ("ball.vx", "ball.vy")


def _lessons(experiment: int, learners: Sequence[str] = tuple(LEARNERS)) -> Callable[[Protocol], Plan]:
    return partial(plans.lessons, experiment=experiment, learners=learners)


def _long(protocol: Protocol) -> Plan:
    return plans.lessons(protocol, 3, ("thesis", "world", "default"))


def _lwr(*shown: str) -> Callable[[Protocol], Plan]:
    def plan(protocol: Protocol) -> Plan:
        ours = plans.lessons(protocol, 2, ("thesis", "default"))
        return {**ours, **plans.regressions(protocol, ("lwr-50", "lwr-25"), shown)}

    return plan


def _classifiers(protocol: Protocol) -> Plan:
    return {**plans.lessons(protocol, 2), **plans.classifications(protocol)}


def _headline(protocol: Protocol) -> Plan:
    ours = plans.lessons(protocol, 2, ("thesis", "default"))
    return {**ours, **plans.regressions(protocol, (), ("thesis", "contact"))}


def _rates(protocol: Protocol) -> Plan:
    return {
        f"{experiment}/{learner}": tasks
        for experiment in (1, 2)
        for learner, tasks in plans.lessons(protocol, experiment).items()
    }


def _one_polarity(protocol: Protocol) -> Plan:
    return {**plans.lessons(protocol, 1, ("thesis",)), **plans.one_polarity(protocol)}


def _transfer(*stages: str) -> Callable[[Protocol], Plan]:
    return partial(plans.transfers, stages=stages)


_ROWS: Final[Sequence[tuple[str, str, str, str, Callable[[Protocol], Plan], Any]]] = (
    ("figure-1.3", "Modes of a ball on a box and a ramp", "§1.2.4", "experiment-1", _lessons(1, ("world",)),
     figures_drawn.ball_modes_shown),
    ("figure-3.1", "The box pushing domain", "§3.1", "pushing", plans.nothing, figures_drawn.layouts_shown),
    ("table-3.1", "Modes of box pushing", "§3.2.6", "pushing", plans.pushing, tables_modes.pushing_modes_shown),
    ("table-3.2", "Mode classifier of box pushing", "§3.4.6", "pushing", plans.pushing,
     tables_clauses.pushing_clauses_shown),
    ("figure-3.8", "Role classifiers of box pushing", "§3.5.1", "pushing", plans.pushing,
     tables_clauses.roles_shown),
    ("table-4.1", "Configuration parameters", "§4.2", "drawn", plans.nothing, figures_drawn.parameters_shown),
    ("figure-4.1", "Initial configurations", "§4.2", "drawn", plans.nothing, figures_drawn.configurations_shown),
    ("table-4.2", "Modes, experiment 1", "§4.3.1", "experiment-1", _lessons(1),
     partial(tables_modes.modes_shown, experiment=1)),
    ("table-4.3", "Clauses, x velocity", "§4.3.2", "experiment-1", _lessons(1, _RELATIONAL),
     partial(tables_clauses.clauses_shown, number="4.3")),
    ("table-4.4", "Mode 2 as the positive class", "§4.3.2", "experiment-1", _one_polarity,
     partial(tables_clauses.clauses_shown, number="4.4")),
    ("table-4.5", "Clauses, y velocity", "§4.3.2", "experiment-1", _lessons(1, _RELATIONAL),
     partial(tables_clauses.clauses_shown, number="4.5")),
    ("table-4.6", "Not negated, modes 2 and 3", "§4.3.2", "experiment-1", _one_polarity,
     partial(tables_clauses.clauses_shown, number="4.6")),
    ("figure-4.2", "Decision tree, y modes 1 and 3", "§4.3.2", "experiment-1", _lessons(1, _RELATIONAL),
     partial(figures_trees.trees_shown, number="4.2")),
    ("figure-4.3", "Prediction accuracy", "§4.3.3", "experiment-1", _lessons(1),
     partial(figures_accuracy.accuracy_shown, targets=_BOTH)),
    ("figure-4.4", "Accuracy by mode, x velocity", "§4.3.3", "experiment-1", _lessons(1),
     partial(figures_accuracy.by_mode_shown, target="ball.vx")),
    ("figure-4.5", "Accuracy by mode, y velocity", "§4.3.3", "experiment-1", _lessons(1),
     partial(figures_accuracy.by_mode_shown, target="ball.vy")),
    ("figure-4.6", "Classification errors", "§4.3.4", "experiment-1", _lessons(1),
     partial(figures_accuracy.rates_shown, targets=_BOTH)),
    ("table-4.7", "Confusions, x velocity", "§4.3.4", "experiment-1", _lessons(1),
     partial(tables_errors.confusion_shown, number="4.7")),
    ("table-4.8", "Confusions, y velocity", "§4.3.4", "experiment-1", _lessons(1),
     partial(tables_errors.confusion_shown, number="4.8")),
    ("figure-4.7", "Floor bounces, perfect classifier", "§4.3.4", "experiment-1", _lessons(1, _RELATIONAL),
     partial(figures_accuracy.perfect_shown, target="ball.vy", mode="floor")),
    ("table-4.9", "Modes, experiment 2", "§4.4.1", "experiment-2", _lessons(2),
     partial(tables_modes.modes_shown, experiment=2)),
    ("figure-4.8", "Bounces on a level surface", "§4.4.1", "drawn", plans.nothing,
     partial(figures_drawn.collisions_shown, level=True)),
    ("figure-4.9", "Bounces on an upright surface", "§4.4.1", "drawn", plans.nothing,
     partial(figures_drawn.collisions_shown, level=False)),
    *(
        (f"table-{number}", f"Clauses, {axis} velocity, part {part}", "§4.4.2", "experiment-2",
         _lessons(2, _RELATIONAL), partial(tables_clauses.clauses_shown, number=number))
        for number, axis, part in (("4.10", "x", 1), ("4.11", "x", 2), ("4.12", "y", 1), ("4.13", "y", 2),
                                   ("4.14", "y", 3))
    ),
    ("figure-4.10", "Decision tree, x modes 1 and 2", "§4.4.2", "experiment-2", _lessons(2, _RELATIONAL),
     partial(figures_trees.trees_shown, number="4.10")),
    ("figure-4.11", "Decision tree, y modes 4 and 5", "§4.4.2", "experiment-2", _lessons(2, _RELATIONAL),
     partial(figures_trees.trees_shown, number="4.11")),
    ("figure-4.12", "Prediction accuracy", "§4.4.3", "experiment-2", _lessons(2),
     partial(figures_accuracy.accuracy_shown, targets=_BOTH)),
    ("figure-4.13", "Accuracy by mode, x velocity", "§4.4.3", "experiment-2", _lessons(2),
     partial(figures_accuracy.by_mode_shown, target="ball.vx")),
    ("figure-4.14", "Accuracy by mode, y velocity", "§4.4.3", "experiment-2", _lessons(2),
     partial(figures_accuracy.by_mode_shown, target="ball.vy")),
    ("figure-4.15", "Classification errors", "§4.4.4", "experiment-2", _lessons(2),
     partial(figures_accuracy.rates_shown, targets=_BOTH)),
    ("table-4.15", "Confusions, x velocity", "§4.4.4", "experiment-2", _lessons(2),
     partial(tables_errors.confusion_shown, number="4.15")),
    ("table-4.16", "Confusions, y velocity", "§4.4.4", "experiment-2", _lessons(2),
     partial(tables_errors.confusion_shown, number="4.16")),
    ("table-4.17", "Modes, two frictions", "§4.5", "experiment-3", _long,
     partial(tables_modes.modes_shown, experiment=3)),
    ("figure-4.16", "Prediction accuracy, two frictions", "§4.5", "experiment-3", _long,
     partial(figures_accuracy.accuracy_shown, targets=_X)),
    ("figure-4.17", "Classification errors, two frictions", "§4.5", "experiment-3", _long,
     partial(figures_accuracy.rates_shown, targets=_X)),
    ("figure-4.18", "Noise, expected and true", "§4.6", "noise", plans.noise, figures_comparison.noise_shown),
    ("figure-4.19", "Locally weighted regression", "§4.7.1", "comparison", _lwr("thesis"),
     partial(figures_comparison.lwr_shown, number="4.19")),
    ("figure-4.20", "Locally weighted regression, uncentred", "§4.7.1", "comparison", _lwr("thesis-uncentred"),
     partial(figures_comparison.lwr_shown, number="4.20")),
    ("figure-4.21", "Classifiers", "§4.7.2", "comparison", _classifiers, figures_comparison.classifiers_shown),
    ("figure-4.22", "Roll-outs, x position", "§4.8", "rollouts", plans.rollouts,
     partial(figures_rollouts.rollout_errors_shown, axis=0)),
    ("figure-4.23", "Roll-outs, y position", "§4.8", "rollouts", plans.rollouts,
     partial(figures_rollouts.rollout_errors_shown, axis=1)),
    ("figure-4.24", "Imperfect collision resolution", "§4.8", "rollouts", plans.rollouts,
     partial(figures_rollouts.failure_shown,
             causes=("bad collision resolution, vertical", "bad collision resolution, ramp slant"))),
    ("table-4.18", "Errors of roll-outs", "§4.8", "rollouts", plans.rollouts, tables_errors.rollouts_shown),
    ("figure-4.25", "Corner, low error", "§4.8", "rollouts", plans.rollouts,
     partial(figures_rollouts.failure_shown, causes=("bounce against a corner",), severe=False)),
    ("figure-4.26", "Corner, high error", "§4.8", "rollouts", plans.rollouts,
     partial(figures_rollouts.failure_shown, causes=("bounce against a corner",), severe=True)),
    ("figure-4.27", "Transfer from box-only", "§4.9", "transfer", _transfer("box"),
     partial(figures_accuracy.by_mode_shown, target="ball.vx")),
    ("figure-4.28", "Transfer from ramp-only", "§4.9", "transfer", _transfer("ramp"),
     partial(figures_accuracy.by_mode_shown, target="ball.vx")),
    ("figure-4.29", "Transfer from box-only, then ramp-only", "§4.9", "transfer", _transfer("box", "ramp"),
     partial(figures_accuracy.by_mode_shown, target="ball.vx")),
    ("rates", "All learners beside the thesis' rates", "§4.3.4, §4.4.4", "beyond", _rates,
     tables_errors.rates_shown),
    ("baselines", "All baselines at equal features", "§4.7", "beyond", _headline,
     tables_baselines.headline_shown),
    ("tuning", "Settings of the baselines", "§4.7", "beyond", plans.tunings, tables_baselines.tuning_shown),
)  # fmt: skip
"""Name, caption, section, group, tasks and rendering of every job, in the order of the thesis."""


def _groups(name: str, group: str) -> tuple[str, ...]:
    kind = name.partition("-")[0]
    return (group, f"{kind}s") if kind in ("table", "figure") else (group,)


JOBS: Final[Mapping[str, Job]] = {
    name: Job(name, title, source, _groups(name, group), plan, show)
    for name, title, source, group, plan, show in _ROWS
}
"""All jobs, in the order of the thesis."""


def chosen(names: Sequence[str]) -> list[Job]:
    """Jobs by name or group (``table-4.2``, ``experiment-1``, ``tables``, ``figures``, ``all``), each once.

    Raises
    ------
    ConfigError
        There is no such job or group.
    """
    groups = sorted(
        {group for job in JOBS.values() for group in job.groups if "-" not in group or "exp" in group}
    )
    wanted: dict[str, Job] = {}
    for name in names:
        found = [job for job in JOBS.values() if name in ("all", job.name, *job.groups)]
        if not found:
            raise ConfigError(
                f"no experiment {name!r}: expected a table (table-4.2), a figure (figure-4.3), or one of "
                f"{', '.join(['all', *groups])}; `relgym reproduce --list` names all"
            )
        wanted |= {job.name: job for job in found}
    return [job for name, job in JOBS.items() if name in wanted]
