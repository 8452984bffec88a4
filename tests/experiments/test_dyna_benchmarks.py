"""Benchmarks of Dyna: by hand from made-up results, and the whole command with tiny tasks."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from relgym.errors import StoreError
from relgym.experiments import dyna_benchmarks
from relgym.experiments.criterion import Measure
from relgym.experiments.dyna import Run, solved_at
from relgym.experiments.dyna_arms import ARMS
from relgym.experiments.dyna_measures import BENCHMARKS, Shown
from relgym.experiments.jobs.store import Result, ResultStore


def value(arm: str, seed: int, *successes: int, course: str = "truck", steps: int = 60_000) -> dict[str, Any]:
    curve = tuple((250 * (k + 1), good) for k, good in enumerate(successes))
    return asdict(Run(course, arm, seed, steps, curve, solved_at(curve), 10.0))


def by_name(shown: Shown) -> dict[str, Measure]:
    return {m.criterion.what: m for m in shown.measures}


def test_ratios_are_of_medians_and_lower_bounds_where_a_baseline_failed() -> None:
    runs = [value("relgym", s, *([0] * s), 90, 90) for s in range(3)]  # 500, 750, 1,000
    runs += [value("sac", 0, 1, 2), value("ensemble", 0, 0, 0, 0, 0, 95, 95)]
    found = by_name(BENCHMARKS["truck"].show([({}, run) for run in runs]))
    assert found["SAC: times as many real steps (at least)"].worst == pytest.approx(60_001 / 750)
    assert found["Dyna, MLP ensemble: times as many real steps"].worst == 2.0
    assert found["Dyna, relgym: seconds of one core"].values == (10.0, 10.0, 10.0)
    assert len(found) == 3  # none of the arm that wasn't run


def test_the_better_baseline_counts() -> None:
    runs = [value("relgym", 0, 90, 90, course="ball"), value("sac", 0, 1, 1, 1, 90, 90, course="ball")]
    runs.append(value("sac20", 0, 1, 90, 90, course="ball"))
    (ratio,) = BENCHMARKS["ball"].show([({}, run) for run in runs]).measures
    assert ratio.worst == 1.5 and not ratio.ok


def test_no_harm_is_measured_at_the_same_real_steps() -> None:
    change = {"change": {}}
    found = by_name(
        BENCHMARKS["truck-wrong-model"].show(
            [
                ({}, value("sac", 0, 5, 20)),
                ({}, {"run": value("relgym", 0, 5, 15), "right_there": 0.995}),
                (change, value("sac", 0, 5, 40)),
                (change, value("relgym", 0, 95, 10)),
                (change, value("relgym", 1, 95, 10)),  # nothing to compare it with yet
            ]
        )
    )
    assert found["wrong model: % right in its own world"].ok
    assert found["wrong model: successes of 100 fewer than SAC"].values == (5.0,)
    assert found["changed world: successes of 100 fewer than SAC"].values == (30.0,)
    assert not found["changed world: successes of 100 fewer than SAC"].ok


def test_dreamt_policies_and_speeds() -> None:
    asleep = BENCHMARKS["truck-dream-only"].show(
        [({}, {"successes": good, "seconds": 1.0}) for good in (90, 89)]
    )
    assert [m.ok for m in asleep.measures] == [False]
    among = BENCHMARKS["truck-more-boxes"].show([({}, {"successes": {"2": 80, "7": 79}, "seconds": 1.0})])
    assert [m.ok for m in among.measures] == [True, False]
    speed = BENCHMARKS["speed"].show([({"world": "truck"}, {"dreams": 1.6e6, "engine": 50_000.0})])
    assert [m.ok for m in speed.measures] == [True, False]


def test_finished_runs_are_not_run_again_and_make_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    task = dyna_benchmarks.wanted(BENCHMARKS["truck"], seeds=1, arms=["sac"])
    assert [t.arguments["arm"] for t in task] == ["sac"]
    ResultStore(tmp_path / "cache").put(task[0], Result(value("sac", 0, 42), 3.0))
    monkeypatch.setattr(type(task[0]), "run", None)  # nothing may be computed
    page = tmp_path / "docs" / "dream.md"
    dyna_benchmarks.main(
        ["truck", "--arms", "sac", "--seeds", "1", "--out", str(tmp_path), "--page", str(page)]
    )
    assert "> 60,000" in capsys.readouterr().out
    text = page.read_text()
    assert "truck: TruckPush: real steps to success" in text and "(./dyna-truck.png)" in text
    assert "1 of 30 runs have been made." in text
    assert "Not made yet: truck-dream-only, TruckPush: trained in the dream alone; ball" in text
    assert (page.parent / "dyna-truck.png").stat().st_size > 5_000


def test_a_page_keeps_what_was_made_elsewhere_and_what_was_written_by_hand(tmp_path: Path) -> None:
    store, page = ResultStore(tmp_path / "cache"), tmp_path / "dream.md"
    for name, result in (
        ("truck-dream-only", {"successes": 97, "seconds": 1.0}),
        ("truck", value("sac", 0, 42)),
    ):
        task = next(t for t in BENCHMARKS[name].tasks if t.arguments.get("arm", "sac") == "sac")
        store.put(task, Result(result, 3.0))
    for name, folder in (("truck-dream-only", "a"), ("truck", "b")):
        dyna_benchmarks.shown(name, store, tmp_path / folder, "again")
    dyna_benchmarks.page(tmp_path / "a", page)
    second = page.read_text().split("\n## ")[1]
    remark = "\nAll in one night.\n\n```text\nand day\n```\n\nReally.\n"
    page.write_text(page.read_text() + remark)
    dyna_benchmarks.page(tmp_path / "b", page)
    head, first, other = page.read_text().split("\n## ")
    assert "Not made yet: ball, BallGoal" in head and first.startswith("truck: ")
    assert other == f"{second}{remark}"
    dyna_benchmarks.page(tmp_path / "a", page)
    assert page.read_text().split("\n## ") == [head, first, other]


def test_a_benchmark_of_which_nothing_is_known_says_so(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="nothing is known of truck-more-boxes"):
        dyna_benchmarks.shown("truck-more-boxes", ResultStore(tmp_path), tmp_path, "")


def test_every_task_can_be_asked_for() -> None:
    for benchmark in BENCHMARKS.values():
        every = dyna_benchmarks.wanted(benchmark, seeds=5, arms=list(ARMS))
        assert every == list(benchmark.tasks)
        assert dyna_benchmarks.wanted(replace(benchmark, tasks=()), seeds=5, arms=["sac"]) == []


def test_all_benchmarks_are_meant_where_none_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(StoreError, match="nothing is known of truck: run it"):  # the first one
        dyna_benchmarks.main(["--seeds", "0", "--arms", "sac5", "--out", str(tmp_path)])
    with pytest.raises(SystemExit):
        dyna_benchmarks.main(["truk"])
    assert "'truk': expected one of truck, truck-dream-only" in capsys.readouterr().err
