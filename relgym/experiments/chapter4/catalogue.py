"""All jobs by name: every table and figure of chapter IV, those of chapter III, and what is beyond the thesis."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Final, TypeAlias

from relgym.errors import ConfigError
from relgym.experiments.chapter4 import (
    claims,
    figures_accuracy,
    figures_comparison,
    figures_drawn,
    figures_rollouts,
    figures_trees,
    frequencies,
    plans,
    tables_baselines,
    tables_clauses,
    tables_errors,
    tables_modes,
)
from relgym.experiments.chapter4.job import Job, Plan, Shown, Values
from relgym.experiments.chapter4.protocol import LEARNERS, Protocol

__all__ = ["JOBS", "chosen"]

_RELATIONAL: Final = ("original", "thesis", "world")
"""Learners that have modes and clauses."""

_X: Final = ("ball.vx",)
_BOTH: Final = ("ball.vx", "ball.vy")

_LWR: Final = ("lwr-50-printed", "lwr-25-printed", "lwr-50")
_RESOLUTION: Final = ("bad collision resolution, vertical", "bad collision resolution, ramp slant")
_CORNER: Final = ("bounce against a corner",)

_Planned: TypeAlias = Callable[[Protocol], Plan]
_Rendered: TypeAlias = Callable[[Protocol, Values], Shown]


# ------------------------------------------------------------------ what jobs rest on
def _lessons(experiment: int, learners: Sequence[str] = tuple(LEARNERS)) -> _Planned:
    return partial(plans.lessons, experiment=experiment, learners=learners)


def _one_polarity(protocol: Protocol) -> Plan:
    return {**plans.lessons(protocol, 1, ("thesis",)), **plans.one_polarity(protocol)}


def _beside(learners: Sequence[str], others: _Planned) -> _Planned:
    """Our learners on experiment 2, and what they are compared with there."""
    return lambda protocol: {**plans.lessons(protocol, 2, learners), **others(protocol)}


def _regressors(names: Sequence[str], *shown: str) -> _Planned:
    return _beside(("thesis", "default"), partial(plans.regressions, names=names, shown=shown))


def _rates(protocol: Protocol) -> Plan:
    return {
        f"{experiment}/{learner}": tasks
        for experiment in (1, 2)
        for learner, tasks in plans.lessons(protocol, experiment).items()
    }


# ------------------------------------------------------------------ jobs, section by section
def _of(section: str, group: str, plan: _Planned, rows: Mapping[str, tuple[str, _Rendered]]) -> Iterator[Job]:
    """Jobs of one section that rest on the same tasks: by name the title, and what shows them."""
    for name, (title, show) in rows.items():
        kind = name.partition("-")[0]
        groups = (group, f"{kind}s") if kind in ("table", "figure") else (group,)
        yield Job(name, title, f"§{section}", groups, plan, show)


def _numbered(
    section: str, group: str, plan: _Planned, show: Callable[..., Shown], titles: Mapping[str, str]
) -> Iterator[Job]:
    """Likewise, where what shows them goes by the thesis' number."""
    rows = {name: (title, partial(show, number=name.partition("-")[2])) for name, title in titles.items()}
    return _of(section, group, plan, rows)


def _by_mode(target: str) -> _Rendered:
    return partial(figures_accuracy.by_mode_shown, target=target)


def _ball(experiment: int, section: str, accuracy: str, by_mode: Sequence[str], rates: str) -> Iterator[Job]:
    """Figures of errors that experiments 1 and 2 share, by number."""
    group, plan = f"experiment-{experiment}", _lessons(experiment)
    rows: dict[str, tuple[str, _Rendered]] = {
        f"figure-{accuracy}": ("Prediction accuracy", partial(figures_accuracy.accuracy_shown, targets=_BOTH))
    }
    for number, target in zip(by_mode, _BOTH, strict=True):
        rows[f"figure-{number}"] = (f"Accuracy by mode, {target[-1]} velocity", _by_mode(target))
    yield from _of(f"{section}.3", group, plan, rows)
    split = partial(figures_accuracy.rates_shown, targets=_BOTH)
    yield from _of(f"{section}.4", group, plan, {f"figure-{rates}": ("Classification errors", split)})


_ALL: Final = (
    # chapters I and III
    *_of("1.2.4", "experiment-1", _lessons(1, ("world",)), {
        "figure-1.3": ("Modes of a ball on a box and a ramp", figures_drawn.ball_modes_shown),
    }),
    *_of("3.1", "pushing", plans.nothing, {"figure-3.1": ("The box pushing domain", figures_drawn.layouts_shown)}),
    *_of("3.2.6", "pushing", plans.pushing, {"table-3.1": ("Modes of box pushing", tables_modes.pushing_modes_shown)}),
    *_of("3.4.6", "pushing", plans.pushing, {
        "table-3.2": ("Mode classifier of box pushing", tables_clauses.pushing_clauses_shown),
    }),
    *_of("3.5.1", "pushing", plans.pushing, {
        "figure-3.8": ("Role classifiers of box pushing", tables_clauses.roles_shown),
    }),
    *_of("4.2", "drawn", plans.nothing, {
        "table-4.1": ("Configuration parameters", figures_drawn.parameters_shown),
        "figure-4.1": ("Initial configurations", figures_drawn.configurations_shown),
    }),
    *_of("4.2", "scenes", frequencies.plan, {
        "scenes": ("Transitions by mode in our scenes", frequencies.counts_shown),
    }),
    # experiment 1
    *_of("4.3.1", "experiment-1", _lessons(1), {
        "table-4.2": ("Modes, experiment 1", partial(tables_modes.modes_shown, experiment=1)),
    }),
    *_numbered("4.3.2", "experiment-1", _lessons(1, _RELATIONAL), tables_clauses.clauses_shown, {
        "table-4.3": "Clauses, x velocity",
        "table-4.5": "Clauses, y velocity",
    }),
    *_numbered("4.3.2", "experiment-1", _one_polarity, tables_clauses.clauses_shown, {
        "table-4.4": "Mode 2 as the positive class",
        "table-4.6": "Not negated, modes 2 and 3",
    }),
    *_numbered("4.3.2", "experiment-1", _lessons(1, _RELATIONAL), figures_trees.trees_shown, {
        "figure-4.2": "Decision tree, y modes 1 and 3",
    }),
    *_ball(1, "4.3", "4.3", ("4.4", "4.5"), "4.6"),
    *_numbered("4.3.4", "experiment-1", _lessons(1), tables_errors.confusion_shown, {
        "table-4.7": "Confusions, x velocity",
        "table-4.8": "Confusions, y velocity",
    }),
    *_of("4.3.4", "experiment-1", _lessons(1, _RELATIONAL), {
        "figure-4.7": (
            "Floor bounces, perfect classifier",
            partial(figures_accuracy.perfect_shown, target="ball.vy", mode="floor"),
        ),
    }),
    # experiment 2
    *_of("4.4.1", "experiment-2", _lessons(2), {
        "table-4.9": ("Modes, experiment 2", partial(tables_modes.modes_shown, experiment=2)),
    }),
    *_of("4.4.1", "drawn", plans.nothing, {
        "figure-4.8": ("Bounces on a level surface", partial(figures_drawn.collisions_shown, level=True)),
        "figure-4.9": ("Bounces on an upright surface", partial(figures_drawn.collisions_shown, level=False)),
    }),
    *_numbered("4.4.2", "experiment-2", _lessons(2, _RELATIONAL), tables_clauses.clauses_shown, {
        "table-4.10": "Clauses, x velocity, part 1",
        "table-4.11": "Clauses, x velocity, part 2",
        "table-4.12": "Clauses, y velocity, part 1",
        "table-4.13": "Clauses, y velocity, part 2",
        "table-4.14": "Clauses, y velocity, part 3",
    }),
    *_numbered("4.4.2", "experiment-2", _lessons(2, _RELATIONAL), figures_trees.trees_shown, {
        "figure-4.10": "Decision tree, x modes 1 and 2",
        "figure-4.11": "Decision tree, y modes 4 and 5",
    }),
    *_ball(2, "4.4", "4.12", ("4.13", "4.14"), "4.15"),
    *_numbered("4.4.4", "experiment-2", _lessons(2), tables_errors.confusion_shown, {
        "table-4.15": "Confusions, x velocity",
        "table-4.16": "Confusions, y velocity",
    }),
    # experiment 3, noise, comparisons
    *_of("4.5", "experiment-3", _lessons(3, ("thesis", "world", "default")), {
        "table-4.17": ("Modes, two frictions", partial(tables_modes.modes_shown, experiment=3)),
        "figure-4.16": (
            "Prediction accuracy, two frictions",
            partial(figures_accuracy.accuracy_shown, targets=_X),
        ),
        "figure-4.17": (
            "Classification errors, two frictions",
            partial(figures_accuracy.rates_shown, targets=_X),
        ),
    }),
    *_of("4.6", "noise", plans.noise, {"figure-4.18": ("Noise, expected and true", figures_comparison.noise_shown)}),
    *_of("4.7.1", "comparison", _regressors(_LWR, "thesis"), {
        "figure-4.19": ("Locally weighted regression", figures_comparison.lwr_shown),
    }),
    *_of("4.7.1", "comparison", _regressors(_LWR, "thesis-uncentred"), {
        "figure-4.20": ("Locally weighted regression, uncentred", figures_comparison.lwr_shown),
    }),
    *_of("4.7.2", "comparison", _beside(tuple(LEARNERS), plans.classifications), {
        "figure-4.21": ("Classifiers", figures_comparison.classifiers_shown),
    }),
    # roll-outs, transfer
    *_of("4.8", "rollouts", plans.rollouts, {
        "figure-4.22": ("Roll-outs, x position", partial(figures_rollouts.rollout_errors_shown, axis=0)),
        "figure-4.23": ("Roll-outs, y position", partial(figures_rollouts.rollout_errors_shown, axis=1)),
        "figure-4.24": (
            "Imperfect collision resolution",
            partial(figures_rollouts.failure_shown, causes=_RESOLUTION),
        ),
        "table-4.18": ("Errors of roll-outs", tables_errors.rollouts_shown),
        "figure-4.25": (
            "Corner, low error",
            partial(figures_rollouts.failure_shown, causes=_CORNER, severe=False),
        ),
        "figure-4.26": (
            "Corner, high error",
            partial(figures_rollouts.failure_shown, causes=_CORNER, severe=True),
        ),
    }),
    *(
        job
        for number, title, stages in (
            ("4.27", "box-only", ("box",)),
            ("4.28", "ramp-only", ("ramp",)),
            ("4.29", "box-only, then ramp-only", ("box", "ramp")),
        )
        for job in _of("4.9", "transfer", partial(plans.transfers, stages=stages), {
            f"figure-{number}": (f"Transfer from {title}", _by_mode("ball.vx")),
        })
    ),
    # beyond the thesis
    *_of("4.3-§4.9", "beyond", claims.plan, {
        "claims": ("A verdict on each of the thesis' claims", claims.claims_shown),
    }),
    *_of("4.3.4, §4.4.4", "beyond", _rates, {
        "rates": ("All learners beside the thesis' rates", tables_errors.rates_shown),
    }),
    *_of("4.3.4, §4.4.4", "beyond", plans.ablations, {
        "ablation": ("Why the original program's rates are what they are", tables_errors.ablation_shown),
    }),
    *_of("4.7", "beyond", _regressors((), "thesis", "contact"), {
        "baselines": ("All baselines at equal features", tables_baselines.headline_shown),
    }),
    *_of("4.7", "beyond", plans.tunings, {"tuning": ("Settings of the baselines", tables_baselines.tuning_shown)}),
)  # fmt: skip


def _place(job: Job) -> tuple[list[int], list[int]]:
    """Sorting key: by section of the thesis, then by number; what is beyond it comes last."""
    if job.groups == ("beyond",):
        return [9], []
    section, number = job.source[1:], job.name.partition("-")[2] or "0"
    return [int(n) for n in section.split(".")], [int(n) for n in number.split(".")]


JOBS: Final[Mapping[str, Job]] = {job.name: job for job in sorted(_ALL, key=_place)}
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
