"""Benchmark of planning: real decisions to success, by what is planned in (`relgym benchmark plan`)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any, Final

from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.criterion import Measure, measured
from relgym.experiments.dyna.report import draw_successes
from relgym.experiments.jobs.task import Task
from relgym.experiments.plan.course import ARMS, COURSES
from relgym.experiments.plan.questions import QUESTIONS, SEEDS
from relgym.model.reports.text import Cell, table

__all__ = ["SUITE", "tasks", "told"]

_HEAD: Final = """`relgym benchmark plan` wrote this page, but for what stands below the tables, which it leaves alone.
An agent begins with random actions, learns the world's laws, and searches in what it has learned: nothing is trained.
Success is 90 of 100 in two tests of the same fixed episodes in a row, one test every 50 real decisions; the figure is
the second test. A test that can't succeed any more is broken off, and its share is that of the episodes played. Seeds
are 0 to 9, on which nothing was chosen; where a table is of fewer, no more were run, and where tests had fewer than
100 episodes the table says so. *learning* is processor time without tests, of a whole run; *decision* that of one
decision in the last test, with the searches that the plans it followed had cost. The rows of SAC and Dyna are those of
the [page on dreaming](dream.md), tested every 250 decisions. The [guide](../guides/planning.md) says how it works."""

_LIMITS: Final[Mapping[tuple[str, str], tuple[int, int | None]]] = {
    ("truck", "relgym"): (300, 400),
    ("truck", "relgym-given"): (200, None),
    ("ball", "relgym"): (600, None),
    ("ball", "relgym-given"): (250, None),
}
"""Real decisions to success that are asked for: in the median, and in the worst seed. (Of the second test; the ball's
first good one is to be that after 200.)"""

_FINAL: Final[Mapping[tuple[str, str], float]] = {("truck", "relgym-given"): 97, ("ball", "relgym-given"): 90}
"""Successes of 100 that are asked for at the course's final test."""

_TIMES: Final = 5
"""How many times as many real decisions nets are to need."""

_BELOW: Final = 3
"""Successes of 100 by which the learned model may stay behind the exact engine."""

_DECISION: Final = 0.03
"""Seconds a decision."""


def tasks(course: str, arms: Sequence[str], *, seeds: Sequence[int], steps: int, episodes: int) -> list[Task]:
    """What to run: each arm with each seed, and the search in the exact engine."""
    found = [
        Task(
            "relgym.experiments.plan.course:learning",
            {"course": course, "arm": arm, "seed": seed, "steps": steps, "episodes": episodes},
            f"plan {course} {arm}",
        )
        for seed in seeds
        for arm in arms
        if arm != "engine"
    ]
    if "engine" in arms:
        ceiling = {"course": course, "episodes": episodes}
        found.append(Task("relgym.experiments.plan.course:ceiling", ceiling, f"plan {course} engine"))
    return found


def _course(name: str) -> Benchmark:
    """How soon each arm succeeds in one world."""

    def measure(extent: Extent, known: Known) -> Shown:
        size = {"steps": extent["steps"], "episodes": extent["episodes"]}
        found: dict[str, list[Any]] = {arm: [] for arm in extent["arms"]}
        for task, value in known.of(tasks(name, extent["arms"], seeds=extent.first(SEEDS), **size)):
            found[task.arguments.get("arm", "engine")].append(value)
        page = Path(extent["dreaming"])
        others = page.read_text(encoding="utf-8") if page.is_file() else ""
        return told(name, found, **size, others=others)

    return Benchmark(COURSES[name].title, measure)


def told(course: str, found: Mapping[str, Sequence[Any]], *, steps: int, episodes: int, others: str) -> Shown:
    """Figures beside their limits, and a table of all arms.

    Parameters
    ----------
    course
        Name in `COURSES`.
    found
        Results of each arm.
    steps, episodes
        Decisions of a run at most, and episodes of a test.
    others
        The page on dreaming, for its rows.
    """
    learned = {arm: runs for arm, runs in found.items() if runs and arm != "engine"}
    measures: list[Measure] = []
    for arm, runs in learned.items():
        name = ARMS[arm].title
        if (limits := _LIMITS.get((course, arm))) is not None:
            middle, worst = limits
            measures.append(measured(f"{name}: decisions to success, median", middle, [_median(runs, steps)]))
            if worst is not None:
                each = [_reached(run, steps) for run in runs]
                measures.append(measured(f"{name}: decisions to success, each", worst, each))
        if (least := _FINAL.get((course, arm))) is not None:
            title = f"{name}: successes of 100 after {COURSES[course].final}"
            ends = [run["final"] for run in runs if run["final"] is not None]
            measures.append(measured(title, least, ends, ">="))
        if limits is not None and course == "truck":
            spent = [run["decision"] for run in runs]
            measures.append(measured(f"{name}: seconds a decision", _DECISION, spent))
    measures += _against_others(found, steps)
    rows: list[list[Cell]] = [_row(ARMS[arm].title, runs, _most(arm, steps)) for arm, runs in learned.items()]
    for made in found.get("engine", ()):
        rest = made["successes"], "-", f"{made['decision']:.3f} s"
        rows.append(["the same search, exact engine", "-", "-", "-", *rest])
    rows += _others(course, others)
    heading = ["arm", "solved", "median", "each", "last, %", "learning", "decision"]
    notes = [table(heading, rows), f"Tests of {episodes} episodes."]
    return Shown(measures, notes, (lambda path: _draw(path, course, found)) if learned else None)


def _against_others(found: Mapping[str, Sequence[Any]], steps: int) -> list[Measure]:
    """The learned model beside nets and beside the exact engine, with the same search."""
    own = found.get("relgym", ())
    if not own:
        return []
    measures = []
    if nets := found.get("ensemble", ()):
        ratio = _median(nets, _most("ensemble", steps)) / _median(own, steps)
        measures.append(
            measured("MLP ensemble: times as many real decisions (at least)", _TIMES, [ratio], ">=")
        )
    for made in found.get("engine", ()):
        below = [made["successes"] - run["curve"][-1][1] for run in own]
        measures.append(measured("planner, relgym: successes of 100 below the exact engine's", _BELOW, below))
    return measures


def _row(title: str, runs: Sequence[Any], steps: int) -> list[Cell]:
    ordered = sorted(_reached(run, steps) for run in runs)
    middle = _median(runs, steps)
    return [
        title,
        f"{sum(run['solved_at'] is not None for run in runs)} of {len(runs)}",
        f"> {steps:,}" if middle > steps else f"{middle:,.0f}",
        ", ".join(f"> {steps:,}" if at > steps else f"{at:,}" for at in ordered),
        f"{median(run['curve'][-1][1] for run in runs):.0f}",
        f"{median(run['seconds'] for run in runs):.0f} s",
        f"{median(run['decision'] for run in runs):.3f} s",
    ]


def _most(arm: str, steps: int) -> int:
    """Real decisions that a run of an arm may take."""
    return steps * ARMS[arm].patience


def _reached(run: Mapping[str, Any], steps: int) -> int:
    return steps + 1 if run["solved_at"] is None else int(run["solved_at"])


def _median(runs: Sequence[Any], steps: int) -> float:
    return float(median(_reached(run, steps) for run in runs))


def _others(course: str, text: str) -> list[list[Cell]]:
    """The rows of SAC and Dyna in the section of this course."""
    own = re.search(rf"^## {course}:.*?^```\n", text, re.MULTILINE | re.DOTALL)
    rows: list[list[Cell]] = []
    for line in own[0].splitlines() if own else ():
        cells = re.split(r"\s{2,}", line.strip())
        if len(cells) == 8 and re.fullmatch(r"\d+ of \d+", cells[1]):
            rows.append([*cells[:5], cells[5], "-"])
    return rows


def _draw(path: Path, course: str, found: Mapping[str, Sequence[Any]]) -> Path:
    """Draw successes over real decisions."""
    shown: dict[str, Any] = {}
    for arm, runs in found.items():
        if arm == "engine" and runs:
            shown["the exact engine"] = int(runs[0]["successes"])
        elif runs:
            shown[ARMS[arm].title] = [run["curve"] for run in runs]
    return draw_successes(path, shown, COURSES[course].title, "real decisions")


SUITE: Final = Suite(
    "plan",
    "What planning is worth",
    {**{name: _course(name) for name in COURSES}, **QUESTIONS},
    seeds=len(SEEDS),
    options={
        "arms": Option((*ARMS, "engine"), f"what to run: {', '.join([*ARMS, 'engine'])}", (*ARMS, "engine")),
        "steps": Option(400, "real decisions of a run at most"),
        "episodes": Option(100, "of a test"),
        "dreaming": Option("docs/results/dream.md", "page with the rows of SAC and Dyna"),
    },
    head=_HEAD,
    usual=("truck",),
)
