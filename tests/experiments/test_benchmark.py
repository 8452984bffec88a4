"""How benchmarks are declared, run, resumed, told and kept on a page; and that all there are can be asked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from relgym.cli import app
from relgym.errors import ConfigError, StoreError
from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite, main, page, whole
from relgym.experiments.criterion import measured, report
from relgym.experiments.jobs.store import ResultStore
from relgym.experiments.jobs.task import Task
from relgym.experiments.suites import SUITES, suite

SEEDS = (3, 5, 7)


def doubled(*, number: int, times: int = 2) -> int:
    """A task."""
    return times * number


def shown_of(*, seeds: Sequence[int], limit: float) -> dict[str, Any]:
    """A task that measures a whole benchmark."""
    return Shown([measured("seeds", limit, [*seeds, math.inf])], ["told on the way"]).to_json()


def _doubles(extent: Extent, known: Known) -> Shown:
    asked = [{"number": seed, "times": extent["times"]} for seed in extent.first(SEEDS)]
    found = known(f"{__name__}:doubled", asked)
    return Shown([measured("doubled", 10, found)], draw=lambda path: path.write_text("picture"))


SUITE = Suite(
    "made",
    "What is made up",
    {
        "doubles": Benchmark("Doubles", _doubles),
        "whole": whole("All at once", f"{__name__}:shown_of", {"limit": 6.0}, SEEDS),
    },
    seeds=len(SEEDS),
    options={"times": Option(2, "as much"), "loud": Option(False, "nothing")},
    head="By hand.",
    usual=("doubles",),
)


def test_it_is_run_once_told_and_kept_on_a_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "docs" / "made.md"
    options = ["--out", str(tmp_path / "out"), "--page", str(target)]
    main(SUITE, ["--seeds", "2", *options])
    told = capsys.readouterr()
    assert "2 of 2 runs" in told.err
    assert [line.split()[:6] for line in told.out.splitlines() if line.startswith("doubled")] == [
        ["doubled", "<=", "10", "10", "8", "2"]
    ]
    text = target.read_text()
    assert text.startswith("# What is made up\n\nBy hand.\n\nNot made yet: whole, All at once.")
    assert "`relgym benchmark made doubles --seeds 2`" in text and "(./made-doubles.png)" in text
    assert (target.parent / "made-doubles.png").read_text() == "picture"
    monkeypatch.setattr(Task, "run", None)  # nothing is left to compute
    main(SUITE, ["doubles", "--seeds", "2", *options])
    assert capsys.readouterr().out == told.out


def test_part_of_it_is_told_and_what_is_run_again_is_computed_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path)]
    main(SUITE, ["--seeds", "1", *out])
    main(SUITE, ["--report", *out])
    assert "1 of 3 runs have been made." in capsys.readouterr().out
    kept = next((tmp_path / "cache").rglob("*.json"))
    before = kept.stat().st_mtime_ns
    main(SUITE, ["--seeds", "1", "--again", *out])
    assert kept.stat().st_mtime_ns > before
    with pytest.raises(StoreError, match="nothing is known of doubles: run it"):
        main(SUITE, ["--seeds", "0", "--times", "3", *out])


def test_a_whole_benchmark_is_one_task_and_figures_that_are_no_numbers_stay(tmp_path: Path) -> None:
    wanted = Known()
    assert SUITE.benchmarks["whole"].measure(SUITE.extent(), wanted) == Shown()
    assert [task.arguments for task in wanted.missing] == [{"limit": 6.0, "seeds": [3, 5, 7]}]
    main(SUITE, ["whole", "--out", str(tmp_path)])
    shown = SUITE.benchmarks["whole"].measure(SUITE.extent(), Known(ResultStore(tmp_path / "cache")))
    assert shown.measures[0].values == (3.0, 5.0, 7.0, math.inf) and not shown.measures[0].ok
    assert list(shown.notes) == ["told on the way"]


def test_a_page_keeps_what_was_made_elsewhere_and_what_was_written_by_hand(tmp_path: Path) -> None:
    target = tmp_path / "made.md"
    for name in ("doubles", "whole"):
        main(SUITE, [name, "--out", str(tmp_path / name)])
    page(SUITE, tmp_path / "whole", target)
    remark = "\nAll in one night.\n\n```text\nand day\n```\n\nReally.\n\n## Much more\n\nBy hand.\n"
    target.write_text(target.read_text() + remark)
    before = target.read_text().split("\n## ")[1:]
    page(SUITE, tmp_path / "doubles", target)
    head, first, *rest = target.read_text().split("\n## ")
    assert "Not made yet" not in head and first.startswith("doubles: Doubles\n")
    assert rest == before
    page(SUITE, tmp_path / "whole", target)
    assert target.read_text().split("\n## ") == [head, first, *rest]
    (tmp_path / "whole" / "whole.json").write_text("{")
    with pytest.raises(StoreError, match=r"whole\.json is damaged"):
        page(SUITE, tmp_path / "whole", target)


def test_where_nothing_has_a_limit_there_is_no_empty_table() -> None:
    assert report("Title", [], ["A note."]) == "Title\nA note."


def test_mistakes_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(SUITE, ["doubled"])
    assert "'doubled': expected one of doubles, whole" in capsys.readouterr().err
    with pytest.raises(ConfigError, match="'gone' is usual, and no benchmark"):
        Suite("x", "X", {}, seeds=1, usual=("gone",))
    with pytest.raises(ConfigError, match="expected one of laws"):
        suite("lawz")


def test_a_command_says_what_isnt_usual() -> None:
    assert SUITE.command("doubles", SUITE.extent()) == "relgym benchmark made doubles"
    extent = SUITE.extent(seeds=1, times=4, loud=True)
    assert SUITE.command("doubles", extent) == "relgym benchmark made doubles --seeds 1 --times 4 --loud"


@pytest.mark.parametrize("name", list(SUITES))
def test_every_suite_is_declared_and_its_tasks_exist(name: str, tmp_path: Path) -> None:
    from importlib import import_module

    known = suite(name)
    assert known.name == name and known.benchmarks
    for each, benchmark in known.benchmarks.items():
        assert each.replace("-", "").isalnum() and benchmark.title
        if each in ("pong", "highway"):
            continue  # learned from recordings
        wanted = Known()
        benchmark.measure(known.extent(seeds=1), wanted)
        for task in wanted.missing:
            module, _, function = task.function.partition(":")
            assert callable(getattr(import_module(module), function))
        assert wanted.missing or each == "any"  # envs that the command line names


def test_the_console_lists_them_and_runs_them() -> None:
    listed = CliRunner().invoke(app, ["benchmark"]).output
    assert all(name in listed for name in SUITES) and "truck-dream-only" in listed
    asked = CliRunner().invoke(app, ["benchmark", "laws", "--help"])
    assert asked.exit_code == 0
