"""Benchmarks of Dyna: how many real steps it saves and what it costs (`relgym benchmark dyna`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any, Final, TypeAlias

from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.criterion import Measure, measured
from relgym.experiments.dyna.arms import ARMS, COURSES
from relgym.experiments.dyna.course import ENOUGH, STEPS, Run
from relgym.experiments.dyna.report import draw_runs, reached, summary
from relgym.experiments.dyna.speed import WORLDS
from relgym.experiments.jobs.task import Task
from relgym.experiments.seeds import TRAINING_SEEDS

__all__ = ["SUITE", "Found"]

Found: TypeAlias = Sequence[tuple[Mapping[str, Any], Any]]
"""Arguments and results of the tasks that have been run."""

_MODULES: Final = {
    "learning": "relgym.experiments.dyna.trials",
    "misled": "relgym.experiments.dyna.trials",
    "asleep": "relgym.experiments.dyna.asleep",
    "among": "relgym.experiments.dyna.asleep",
    "speed": "relgym.experiments.dyna.speed",
}
_RATES: Final = {"truck": (1.5e6, 40.0), "ball by laws": (3e6, 100.0), "ball by modes": (1e6, 30.0)}
"""Of each world the least env-steps a second of dreams, and how many times the engine's that is."""

_LIGHT: Final[Mapping[str, Any]] = {"gravity": 5.0}
"""Half the weight, and so half the friction."""

_TURN: Final = 3_000
"""Real steps after which the world becomes light, and how many there are before and after."""

_MISLED_STEPS: Final = 6_000
_BALL_STEPS: Final = 16_000

_TRUCK_ARMS: Final = ("sac", "sac40", "sac-permuted", "ensemble", "relgym", "relgym-given")
_BALL_BASELINES: Final = ("sac", "sac5", "sac20")
"""Agents without a model; those who dream update forty times a decision there."""


def _benchmark(title: str, tasks: Sequence[Task], show: Callable[[Found], Shown]) -> Benchmark:
    """Of tasks with all seeds and arms: those asked for are run, and all that is known is told."""

    def measure(extent: Extent, known: Known) -> Shown:
        few, arms = extent.first(TRAINING_SEEDS), extent["arms"]

        def wanted(task: Task) -> bool:
            return task.arguments.get("seed", 0) in few and task.arguments.get("arm", arms[0]) in arms

        found = known.of(tasks, wanted)
        return show([(task.arguments, value) for task, value in found]) if found else Shown()

    return Benchmark(title, measure)


def _task(function: str, **arguments: Any) -> Task:
    kind = " ".join(str(arguments[key]) for key in ("course", "arm") if key in arguments)
    return Task(f"{_MODULES[function]}:{function}", arguments, f"{function} {kind}")


def _learning(
    course: str, arms: Sequence[str], steps: int, fewer: Mapping[str, int] | None = None, **more: Any
) -> list[Task]:
    """Courses of learning of so many real steps at most; of some arms fewer."""
    most = {arm: (fewer or {}).get(arm, steps) for arm in arms}
    return [
        _task("learning", course=course, arm=arm, seed=seed, steps=most[arm], **more)
        for arm in arms
        for seed in TRAINING_SEEDS
    ]


# ------------------------------------------------------------------ real steps to success
def _truck(found: Found) -> Shown:
    runs = _runs(found)
    baselines = (("sac", 20.0), ("sac-permuted", 5.0), ("ensemble", 2.0))
    measures = [m for arm, limit in baselines for m in _fewer(runs, arm, limit)]
    own = [run.seconds for run in runs if run.arm == "relgym"]
    measures += [measured("Dyna, relgym: seconds of one core", 600, own)] if own else []
    return _compared(runs, measures)


def _ball(found: Found) -> Shown:
    runs = _runs(found)
    steps = {arm: median(map(reached, own)) for arm in _BALL_BASELINES if (own := _of(runs, arm))}
    best = min(steps, key=lambda arm: steps[arm], default="sac")
    return _compared(runs, _fewer(runs, best, 4.0))


def _compared(runs: Sequence[Run], measures: Sequence[Measure]) -> Shown:
    title = COURSES[runs[0].course].title
    return Shown(measures, [summary(runs)], lambda path: draw_runs(path, runs, title))


def _fewer(runs: Sequence[Run], baseline: str, times: float) -> list[Measure]:
    """How many times fewer real steps relgym needs, by the medians; none where an arm is missing."""
    ours, theirs = _of(runs, "relgym"), _of(runs, baseline)
    if not (ours and theirs):
        return []
    ratio = median(map(reached, theirs)) / median(map(reached, ours))
    least = "" if all(run.solved_at for run in theirs) else " (at least)"
    return [measured(f"{ARMS[baseline].title}: times as many real steps{least}", times, [ratio], ">=")]


def _runs(found: Found) -> list[Run]:
    return [Run.from_json(value) for _, value in found]


def _of(runs: Sequence[Run], arm: str) -> list[Run]:
    return [run for run in runs if run.arm == arm]


# ------------------------------------------------------------------ trained in the dream alone
def _asleep(found: Found) -> Shown:
    successes = measured(
        "successes of 100 real episodes", ENOUGH, [value["successes"] for _, value in found], ">="
    )
    return Shown([successes], [_times(found)])


# ------------------------------------------------------------------ models that are wrong
def _no_harm(found: Found) -> Shown:
    """A model of another world, then a world that becomes another one, each beside SAC."""
    learned = [(arguments, Run.from_json(value)) for arguments, value in found if "curve" in value]
    plain = {run.seed: run for arguments, run in learned if "change" not in arguments}
    turned = {
        arm: {run.seed: run for arguments, run in learned if "change" in arguments and run.arm == arm}
        for arm in ("sac", "relgym")
    }
    wrong = {
        value["run"]["seed"]: (Run.from_json(value["run"]), value["right_there"])
        for _, value in found
        if "run" in value
    }
    behind = [plain[s].last - wrong[s][0].last for s in wrong if s in plain]
    later = [turned["sac"][s].last - turned["relgym"][s].last for s in turned["relgym"] if s in turned["sac"]]
    measures = [
        measured("wrong model: % right in its own world", 99.0, [100 * w[1] for w in wrong.values()], ">="),
        measured("wrong model: successes of 100 fewer than SAC", 10, behind),
        measured("changed world: successes of 100 fewer than SAC", 10, later),
    ]
    told = [_course(run, "wrong model") for run, _ in wrong.values()]
    told += [_course(run, "") for run in plain.values()]
    told += [_course(run, "changed world") for arm in turned.values() for run in arm.values()]
    return Shown([m for m in measures if m.values], told)


def _course(run: Run, what: str) -> str:
    curve = " ".join(str(good) for _, good in run.curve)
    return (
        f"{ARMS[run.arm].title}, {what or 'as ever'}, seed {run.seed}, accepted {run.accepted:.0%}: {curve}"
    )


# ------------------------------------------------------------------ more boxes, and speed
def _among(found: Found) -> Shown:
    counts = list(found[0][1]["successes"])
    measures = [
        measured(f"{n} bystanders: successes of 100", 80, [value["successes"][n] for _, value in found], ">=")
        for n in counts
    ]
    return Shown(measures, [_times(found)])


def _speed(found: Found) -> Shown:
    measures = []
    for arguments, value in found:
        world = arguments["world"]
        least, times = _RATES[world]
        measures += [
            measured(f"{world}: env-steps a second", least, [value["dreams"]], ">="),
            measured(f"{world}: times the engine's", times, [value["dreams"] / value["engine"]], ">="),
        ]
    return Shown(
        measures,
        [
            "Processor time, medians of whole episodes and a reset; 1,024 scenes, the engine's in a SyncVectorEnv."
        ],
    )


def _times(found: Found) -> str:
    return f"{median(value['seconds'] for _, value in found):.0f} s of training each (median)."


_DREAMS: Final[Mapping[str, Any]] = {"real": 1_000, "updates": 30_000}
_FEW: Final[Mapping[str, int]] = {"sac40": 5_000, "ensemble": 2_500}
"""Real steps at most, where an arm's are costly and it is enough to know that it needs more."""

_CHANGE: Final[Mapping[str, Any]] = {"after": _TURN, "arguments": _LIGHT}

_BENCHMARKS: Final[Mapping[str, Benchmark]] = {
    "truck": _benchmark(
        "TruckPush: real steps to success", _learning("truck", _TRUCK_ARMS, STEPS, _FEW), _truck
    ),
    "truck-dream-only": _benchmark(
        "TruckPush: trained in the dream alone",
        [_task("asleep", course="truck", seed=seed, real=1_000, updates=20_000) for seed in TRAINING_SEEDS],
        _asleep,
    ),
    "ball": _benchmark(
        "BallGoal: real decisions to success",
        _learning("ball", ("relgym", "relgym-given", *_BALL_BASELINES), _BALL_STEPS),
        _ball,
    ),
    "truck-wrong-model": _benchmark(
        "TruckPush: wrong models do no harm",
        [
            *_learning("truck", ("sac",), _MISLED_STEPS),
            *(
                _task(
                    "misled", course="truck", arm="relgym", seed=seed, steps=_MISLED_STEPS, arguments=_LIGHT
                )
                for seed in TRAINING_SEEDS
            ),
            *_learning("truck", ("sac", "relgym"), 2 * _TURN, change=_CHANGE),
        ],
        _no_harm,
    ),
    "truck-more-boxes": _benchmark(
        "TruckPush: dreams among more boxes than the model saw",
        [_task("among", seed=seed, bystanders=[2, 3, 4, 5, 6, 7], **_DREAMS) for seed in TRAINING_SEEDS],
        _among,
    ),
    "speed": _benchmark(
        "Speed of dreams",
        [_task("speed", world=world) for world in WORLDS],
        _speed,
    ),
}

_HEAD: Final = """`relgym benchmark dyna` wrote this page, but for what stands below the tables, which it leaves alone.
Each section is a benchmark. Seeds are 0 to 4, on which nothing was chosen; where a figure is of fewer than five, no
more were run (*of* in the tables). Success is 90 of 100 fixed test episodes twice in a row, checked every 250 real
steps; *each* lists the real steps to it, the smallest first. *time* is processor time, tests included (a run has one
thread); *learning* and *dreaming* are wall time on a machine with two cores that did other things too, and so may be
longer. The [guide](../guides/dyna.md) says how it works."""

SUITE: Final = Suite(
    "dyna",
    "What dreaming is worth",
    _BENCHMARKS,
    seeds=len(TRAINING_SEEDS),
    options={"arms": Option(tuple(ARMS), f"what to run: {', '.join(ARMS)}", tuple(ARMS))},
    head=_HEAD,
)
