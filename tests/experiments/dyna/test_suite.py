"""Benchmarks of Dyna: by hand from made-up results, and the whole command with tiny tasks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from relgym.experiments.benchmark import Known, Shown, main
from relgym.experiments.criterion import Measure
from relgym.experiments.dyna.course import Run, solved_at
from relgym.experiments.dyna.suite import SUITE
from relgym.experiments.jobs.store import Result, ResultStore
from relgym.experiments.jobs.task import Task


def value(arm: str, seed: int, *successes: int, course: str = "truck", steps: int = 60_000) -> dict[str, Any]:
    curve = tuple((250 * (k + 1), good) for k, good in enumerate(successes))
    return asdict(Run(course, arm, seed, steps, curve, solved_at(curve), 10.0))


def told(name: str, results: Sequence[tuple[dict[str, Any], Any]]) -> Shown:
    """A benchmark of made-up results, each with the arguments that its task is to have."""

    class Made(Known):
        def of(self, tasks: Sequence[Task], wanted: object = None) -> list[tuple[Task, Any]]:
            return [(Task("made:up", arguments), result) for arguments, result in results]

    return SUITE.benchmarks[name].measure(SUITE.extent(), Made())


def tasks(name: str, **said: Any) -> list[Task]:
    wanted = Known()
    SUITE.benchmarks[name].measure(SUITE.extent(**said), wanted)
    return wanted.missing


def by_name(shown: Shown) -> dict[str, Measure]:
    return {m.what: m for m in shown.measures}


def test_ratios_are_of_medians_and_lower_bounds_where_a_baseline_failed() -> None:
    runs = [value("relgym", s, *([0] * s), 90, 90) for s in range(3)]  # 500, 750, 1,000
    runs += [value("sac", 0, 1, 2), value("ensemble", 0, 0, 0, 0, 0, 95, 95)]
    found = by_name(told("truck", [({}, run) for run in runs]))
    assert found["SAC: times as many real steps (at least)"].worst == pytest.approx(60_001 / 750)
    assert found["Dyna, MLP ensemble: times as many real steps"].worst == 2.0
    assert found["Dyna, relgym: seconds of one core"].values == (10.0, 10.0, 10.0)
    assert len(found) == 3  # none of the arm that wasn't run


def test_the_better_baseline_counts() -> None:
    runs = [value("relgym", 0, 90, 90, course="ball"), value("sac", 0, 1, 1, 1, 90, 90, course="ball")]
    runs.append(value("sac20", 0, 1, 90, 90, course="ball"))
    (ratio,) = told("ball", [({}, run) for run in runs]).measures
    assert ratio.worst == 1.5 and not ratio.ok


def test_no_harm_is_measured_at_the_same_real_steps() -> None:
    change = {"change": {}}
    found = by_name(
        told(
            "truck-wrong-model",
            [
                ({}, value("sac", 0, 5, 20)),
                ({}, {"run": value("relgym", 0, 5, 15), "right_there": 0.995}),
                (change, value("sac", 0, 5, 40)),
                (change, value("relgym", 0, 95, 10)),
                (change, value("relgym", 1, 95, 10)),  # nothing to compare it with yet
            ],
        )
    )
    assert found["wrong model: % right in its own world"].ok
    assert found["wrong model: successes of 100 fewer than SAC"].values == (5.0,)
    assert found["changed world: successes of 100 fewer than SAC"].values == (30.0,)
    assert not found["changed world: successes of 100 fewer than SAC"].ok


def test_dreamt_policies_and_speeds() -> None:
    asleep = told("truck-dream-only", [({}, {"successes": good, "seconds": 1.0}) for good in (90, 89)])
    assert [m.ok for m in asleep.measures] == [False]
    among = told("truck-more-boxes", [({}, {"successes": {"2": 80, "7": 79}, "seconds": 1.0})])
    assert [m.ok for m in among.measures] == [True, False]
    speed = told("speed", [({"world": "truck"}, {"dreams": 1.6e6, "engine": 50_000.0})])
    assert [m.ok for m in speed.measures] == [True, False]


def test_finished_runs_are_not_run_again_and_make_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (task,) = tasks("truck", seeds=1, arms=("sac",))
    assert task.arguments["arm"] == "sac"
    ResultStore(tmp_path / "cache").put(task, Result(value("sac", 0, 42), 3.0))
    monkeypatch.setattr(Task, "run", None)  # nothing may be computed
    page = tmp_path / "docs" / "dream.md"
    main(SUITE, ["truck", "--arms", "sac", "--seeds", "1", "--out", str(tmp_path), "--page", str(page)])
    assert "> 60,000" in capsys.readouterr().out
    text = page.read_text()
    assert "truck: TruckPush: real steps to success" in text and "(./dyna-truck.png)" in text
    assert "1 of 30 runs have been made." in text
    assert "Not made yet: truck-dream-only, TruckPush: trained in the dream alone; ball" in text
    assert (page.parent / "dyna-truck.png").stat().st_size > 5_000


def test_every_task_can_be_asked_for() -> None:
    assert len(tasks("truck")) == 30
    assert {task.arguments["seed"] for task in tasks("truck", seeds=2)} == {0, 1}
    assert tasks("truck", arms=("sac5",)) == []
    assert all(tasks(name) for name in SUITE.benchmarks)
