"""Questions about planning besides how soon it succeeds: exploration, changes, pits, and foreign envs."""

from __future__ import annotations

from collections.abc import Mapping
from statistics import median
from typing import Final

from relgym.experiments.benchmark import Benchmark, Extent, Known, Shown
from relgym.experiments.criterion import Measure, measured
from relgym.experiments.dyna.course import ENOUGH
from relgym.experiments.plan.course import COURSES
from relgym.experiments.plan.foreign import FOREIGN
from relgym.model.reports.text import Cell, table

__all__ = ["QUESTIONS", "SEEDS"]

SEEDS: Final = tuple(range(10))
"""On which nothing was chosen; what was chosen was chosen on seeds from 100 on."""

_EXPLORATION: Final[Mapping[str, tuple[int, int]]] = {
    "truck": (1_500, 25),
    "ball": (60, 1),
    "materials": (1_000, 1),
}
"""Real decisions in which agents get to know a world, and from one test of what they know to the next."""

_MORE: Final = 2.0
"""How many times as many decisions random play is to take, and in what share of the seeds."""

_MOSTLY: Final = 90

_CHANGED: Final = 400
"""Real steps after the world has changed."""

_BACK: Final = 300
"""Real steps after which success is to be back, and successes of 100 that SAC may be ahead by at any test."""

_AHEAD: Final = 10

_FALLS: Final = 1
"""Falls in 100 episodes that a careful agent may have."""

_SOLVED: Final = 95
"""Successes of 100 that count as solved where a model was learned from random steps."""


def _exploration(extent: Extent, known: Known) -> Shown:
    asked = [
        {"course": course, "explores": explores, "seed": seed, "steps": steps, "every": every}
        for seed in extent.first(SEEDS)
        for course, (steps, every) in _EXPLORATION.items()
        for explores in (True, False)
    ]
    found = {
        (arguments["course"], arguments["seed"], arguments["explores"]): value["known_at"]
        for arguments, value in known.pairs("relgym.experiments.plan.course:knowing", asked)
    }
    measures: list[Measure] = []
    rows: list[list[Cell]] = []
    for course, (steps, every) in _EXPLORATION.items():
        ratios = []
        for seed in sorted({seed for name, seed, _ in found if name == course}):
            if not {(course, seed, True), (course, seed, False)} <= found.keys():
                continue
            both = found[course, seed, True], found[course, seed, False]
            own, other = (steps + every if at is None else at for at in both)
            ratios.append(other / own)
            told = [f"> {steps:,}" if at is None else f"{at:,}" for at in both]
            rows.append([COURSES[course].title, str(seed), *told, f"{ratios[-1]:.1f}"])
        if ratios:
            title = COURSES[course].title
            what = f"{title}: random play's decisions over exploration's until 99 % is right, median"
            measures.append(measured(what, _MORE, [median(ratios)], ">="))
            share = 100.0 * sum(ratio >= _MORE for ratio in ratios) / len(ratios)
            measures.append(
                measured(f"{title}: seeds in which it is twice as many, %", _MOSTLY, [share], ">=")
            )
    return Shown(measures, [table(["world", "seed", "explores", "at random", "ratio"], rows)])


def _change(extent: Extent, known: Known) -> Shown:
    size = {"steps": _CHANGED, "episodes": extent["episodes"]}
    asked = [{"seed": seed, **size} for seed in extent.first(SEEDS)]
    rows: list[list[Cell]] = []
    back, ahead = [], []
    for arguments, value in known.pairs("relgym.experiments.plan.course:recovering", asked):
        curve, baseline = value["curve"], value["baseline"]
        again = next((at for at, good in curve[1:] if good >= ENOUGH), None)
        back.append(_CHANGED + 50 if again is None else again)
        at_once = dict(map(tuple, curve))
        ahead += [good - at_once[at] for at, good in baseline if at in at_once]
        rows.append(
            [
                str(arguments["seed"]),
                ", ".join(str(good) for _, good in curve),
                "never" if again is None else str(again),
                ", ".join(f"{good} after {at}" for at, good in baseline),
            ]
        )
    measures = []
    if back:
        measures.append(measured("steps after the change until success is back", _BACK, back))
        measures.append(measured("successes of 100 by which SAC was ahead at a test", _AHEAD, ahead))
    heading = ["seed", "successes of 100 before, and every 50 steps after the change", "back after", "SAC"]
    return Shown(measures, [table(heading, rows)])


def _pit(extent: Extent, known: Known) -> Shown:
    def falls(*, safe: bool) -> list[float]:
        asked = [{"seed": seed, "safe": safe, "episodes": episodes} for seed in extent.first(SEEDS)]
        found = known("relgym.experiments.plan.pit:falling", asked)
        return [100.0 * value["falls"] / episodes for value in found]

    episodes = extent["episodes"]
    careful, bold = falls(safe=True), falls(safe=False)
    measures = []
    if careful:
        measures.append(measured("falls in 100 episodes, safe", _FALLS, careful))
    if bold:
        measures.append(measured("falls in 100 episodes, not safe (it is a pit)", _FALLS + 1, bold, ">="))
    return Shown(measures)


def _foreign(extent: Extent, known: Known) -> Shown:
    measures: list[Measure] = []
    rows: list[list[Cell]] = []
    for name, place in FOREIGN.items():
        asked = [{"name": name, "seed": seed, "episodes": extent["episodes"]} for seed in extent.first(SEEDS)]
        own, baseline = (
            known(f"relgym.experiments.plan.foreign:{function}", asked)
            for function in ("planned", "agent_alone")
        )
        if own:
            good = [value["successes"] for value in own]
            measures.append(
                measured(f"{place.title}: successes of 100 after 1,000 random steps", _SOLVED, good, ">=")
            )
            costs = [
                f"{median(value['learning'] for value in own):.1f} s",
                f"{1000 * median(value['decision'] for value in own):.1f} ms",
            ]
            rows.append([place.title, "planner, relgym", "1,000", ", ".join(map(str, good)), *costs])
        if baseline:
            at = [value["solved_at"] for value in baseline]
            steps = ", ".join(f"> {place.limit:,}" if one is None else f"{one:,}" for one in at)
            good = [value["curve"][-1][1] for value in baseline]
            rows.append([place.title, place.baseline, steps, ", ".join(map(str, good)), "-", "-"])
    return Shown(
        measures, [table(["env", "agent", "real steps", "successes of 100", "learning", "decision"], rows)]
    )


QUESTIONS: Final[Mapping[str, Benchmark]] = {
    "exploration": Benchmark("Exploration against random play", _exploration),
    "change": Benchmark("Half the gravity, and friction, after 1,000 steps", _change),
    "pit": Benchmark("A pit that was never seen", _pit),
    "foreign": Benchmark("Pendulum and MountainCar", _foreign),
}
"""By name."""
