"""Benchmark of planning: real decisions to success, by what is planned in; each figure beside its limit.

``relgym benchmark plan truck --arms relgym relgym-given --seeds 3`` runs two arms with three seeds each, and reports
all that is known. Results are kept in a store: what is there already isn't computed again, so that it can be stopped
and resumed. ``--page`` writes the page of results.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np

from relgym.experiments.criterion import Measure, measured, report
from relgym.experiments.dyna_report import interval
from relgym.experiments.jobs.run import run
from relgym.experiments.jobs.store import ResultStore, write_atomically
from relgym.experiments.jobs.task import Task
from relgym.experiments.plan import ARMS, COURSES
from relgym.experiments.plan_questions import QUESTIONS
from relgym.experiments.plots import require_matplotlib
from relgym.model.reports.text import Cell, table

__all__ = ["draw", "main", "page", "tasks", "told"]

SEEDS: Final = tuple(range(10))
"""On which nothing was chosen; what was chosen was chosen on seeds from 100 on."""

_HEAD: Final = """# What planning is worth

`relgym benchmark plan` wrote this page, but for what stands below the tables, which it leaves alone. An agent begins
with random actions, learns the world's laws, and searches in what it has learned: nothing is trained. Success is 90 of
100 in two tests of the same fixed episodes in a row, one test every 50 real decisions; the figure is the second test.
A test that can't succeed any more is broken off, and its share is that of the episodes played. Seeds are 0 to 9, on
which nothing was chosen; where a table is of fewer, no more were run, and where tests had fewer than 100 episodes the
table says so. *learning* is processor time without tests, of a whole run; *decision* that of one decision in the last
test, with the searches that the plans it followed had cost. The rows of SAC and Dyna are those of the
[page on dreaming](dream.md), tested every 250 decisions. The [guide](../guides/planning.md) says how it works."""

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


def tasks(course: str, arms: Sequence[str], *, seeds: int, steps: int, episodes: int) -> list[Task]:
    """What to run: each arm with each of the first seeds, and the search in the exact engine."""
    found = [
        Task(
            "relgym.experiments.plan:learning",
            {"course": course, "arm": arm, "seed": seed, "steps": steps, "episodes": episodes},
            f"plan {course} {arm}",
        )
        for seed in SEEDS[:seeds]
        for arm in arms
        if arm != "engine"
    ]
    if "engine" in arms:
        ceiling = {"course": course, "episodes": episodes}
        found.append(Task("relgym.experiments.plan:ceiling", ceiling, f"plan {course} engine"))
    return found


def known(course: str, arms: Sequence[str], store: ResultStore, **extent: int) -> dict[str, list[Any]]:
    """What the store holds, by arm; of an arm that has no result an empty list."""
    found: dict[str, list[Any]] = {arm: [] for arm in arms}
    for task in tasks(course, arms, **extent):
        result = store.get(task)
        if result is not None:
            found[task.arguments.get("arm", "engine")].append(result.value)
    return found


def told(course: str, found: Mapping[str, Sequence[Any]], *, steps: int, episodes: int, others: str) -> str:
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
    return report(COURSES[course].title, measures, [table(heading, rows), f"Tests of {episodes} episodes."])


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


def draw(path: Path, course: str, found: Mapping[str, Sequence[Any]]) -> Path:
    """Draw successes over real decisions: interquartile mean and 95 % interval of each arm.

    Raises
    ------
    ConfigError
        matplotlib isn't installed.
    """
    require_matplotlib()
    from matplotlib.figure import Figure  # no pyplot: it would choose a window system

    rng = np.random.default_rng(0)
    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.subplots()
    for arm, runs in found.items():
        if arm == "engine":
            for made in runs:
                axes.axhline(made["successes"], color="0.3", linestyle=":", label="the exact engine")
            continue
        if not runs:
            continue
        steps = sorted({int(at) for run in runs for at, _ in run["curve"]})
        values = np.array([[_at(run["curve"], at) for run in runs] for at in steps], dtype=np.float64)
        mean, low, high = interval(values, rng=rng)
        label = f"{ARMS[arm].title} ({len(runs)} {'seed' if len(runs) == 1 else 'seeds'})"
        (line,) = axes.plot(steps, mean, marker="o", markersize=3, label=label)
        axes.fill_between(steps, low, high, alpha=0.2, color=line.get_color())
    axes.axhline(90, color="0.6", linewidth=0.8, linestyle="--")
    title = COURSES[course].title
    axes.set(title=title, xlabel="real decisions", ylabel="successes of 100", ylim=(-2, 102))
    axes.legend(loc="best", fontsize="small")
    figure.savefig(path, dpi=120)
    return path


def _at(curve: Sequence[Sequence[int]], at: int) -> int:
    """Successes at a test, or at the last one before: a run that has succeeded is stopped."""
    return max([(step, good) for step, good in curve if step <= at], default=(0, 0))[1]


def page(target: Path, sections: Mapping[str, tuple[str, str]]) -> None:
    """Write the page of results; other sections stay, and so does what was written by hand below the tables and after.

    Parameters
    ----------
    target
        The page.
    sections
        By course or question: the picture's file name, empty if there is none, and the text.
    """
    old: dict[str, str] = {}
    if target.is_file():
        parts = target.read_text(encoding="utf-8").split("\n## ")[1:]
        old = {part.split(":")[0]: f"## {part.strip()}" for part in parts}
    for course, (picture, text) in sections.items():
        title = COURSES[course].title if course in COURSES else QUESTIONS[course].title
        remark = old.get(course, "").partition("\n```\n")[2].strip()
        shown = f"![Successes over real decisions]({picture})\n\n" if picture else ""
        command = f"`relgym benchmark plan {course}`, {date.today().isoformat()}."
        body = f"## {course}: {title}\n\n{command}\n\n{shown}```text\n{text.strip()}\n```\n"
        old[course] = f"{body}\n{remark}".strip()
    known = [name for name in [*COURSES, *QUESTIONS] if name in old]
    by_hand = [name for name in old if name not in known]
    write_atomically(target, "\n\n".join([_HEAD, *(old[name] for name in known + by_hand)]).encode() + b"\n")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what isn't run yet of what the command line asks for, then report it."""
    parser = argparse.ArgumentParser(prog="relgym benchmark plan", description=__doc__)
    parser.add_argument(
        "courses", nargs="*", help=f"{', '.join([*COURSES, *QUESTIONS])}; default: truck", metavar="what"
    )
    parser.add_argument("--arms", nargs="+", choices=[*ARMS, "engine"], default=[*ARMS, "engine"])
    parser.add_argument("--seeds", type=int, default=len(SEEDS), help=f"so many, at most {len(SEEDS)}")
    parser.add_argument("--steps", type=int, default=400, help="real decisions of a run at most")
    parser.add_argument("--episodes", type=int, default=100, help="of a test")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("out/plan"), help="folder for results and pictures")
    parser.add_argument("--page", type=Path, help="where to write the page of results")
    parser.add_argument("--report", action="store_true", help="run nothing, report what is known")
    chosen = parser.parse_args(arguments)
    asked = chosen.courses or ["truck"]
    if unknown := [name for name in asked if name not in {*COURSES, *QUESTIONS}]:
        parser.error(f"unknown {unknown[0]!r}: expected one of {', '.join([*COURSES, *QUESTIONS])}")
    courses = [name for name in asked if name in COURSES]
    store = ResultStore(chosen.out / "cache")
    extent = {"seeds": chosen.seeds, "steps": chosen.steps, "episodes": chosen.episodes}
    seeds = SEEDS[: chosen.seeds]
    questions = {name: QUESTIONS[name] for name in asked if name in QUESTIONS}
    wanted = [task for name in courses for task in tasks(name, chosen.arms, **extent)]
    wanted += [task for each in questions.values() for task in each.tasks(seeds, chosen.episodes)]
    if not chosen.report:
        for progress in run(wanted, store, workers=chosen.jobs):
            print(f"{progress.done} of {progress.total} runs", file=sys.stderr, flush=True)
    dreaming = chosen.page.parent / "dream.md" if chosen.page is not None else Path("docs/results/dream.md")
    others = dreaming.read_text(encoding="utf-8") if dreaming.is_file() else ""
    sections: dict[str, tuple[str, str]] = {}
    for name, question in questions.items():
        text = question.text(store, seeds, chosen.episodes)
        print(text, flush=True)
        sections[name] = "", text
    for name in courses:
        found = known(name, chosen.arms, store, **extent)
        text = told(name, found, steps=chosen.steps, episodes=chosen.episodes, others=others)
        print(text, flush=True)
        if chosen.page is not None:
            chosen.page.parent.mkdir(parents=True, exist_ok=True)
            picture = draw(chosen.page.parent / f"plan-{name}.png", name, found).name
            sections[name] = picture, text
    if chosen.page is not None:
        page(chosen.page, sections)


if __name__ == "__main__":
    main(sys.argv[1:])
