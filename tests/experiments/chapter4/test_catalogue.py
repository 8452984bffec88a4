from __future__ import annotations

import csv
import errno
import json
import os
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from relgym.cli import app
from relgym.errors import ConfigError, StoreError
from relgym.experiments.benchmark import Made
from relgym.experiments.chapter4.catalogue import JOBS, chosen
from relgym.experiments.chapter4.command import Request, remaining, reproduce
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.published import REMARKS
from relgym.experiments.chapter4.reproduce import compute, make, page
from relgym.experiments.jobs.code import code_version, modules_behind
from relgym.experiments.jobs.run import Progress
from relgym.experiments.jobs.store import ResultStore
from relgym.experiments.jobs.task import Task


def _numbers(kind: str) -> list[str]:
    return [name.partition("-")[2] for name in JOBS if name.startswith(f"{kind}-")]


def test_every_table_and_figure_has_a_job() -> None:
    assert _numbers("table") == ["3.1", "3.2", *(f"4.{k}" for k in range(1, 19))]
    assert set(_numbers("figure")) == {"1.3", "3.1", "3.8", *(f"4.{k}" for k in range(1, 30))}


@pytest.mark.parametrize("protocol", [Protocol.thesis(1), Protocol.fast()])
def test_every_task_can_be_named_and_found(protocol: Protocol) -> None:
    tasks = {task for job in JOBS.values() for group in job.plan(protocol).values() for task in group}
    assert len({task.key for task in tasks}) == len(tasks) > 100
    assert all(task.kind for task in tasks if task.name != "lesson" or "learner" not in task.arguments)


def test_what_draws_is_no_part_of_what_measures() -> None:
    assert code_version("relgym.experiments.chapter4.lesson") != code_version(
        "relgym.experiments.chapter4.comparison"
    )
    behind = modules_behind("relgym.experiments.chapter4.lesson")
    assert not [m for m in behind if "figures_" in m or "tables_" in m or m.endswith(".cli")]


def test_jobs_by_name_and_group() -> None:
    assert [job.name for job in chosen(["table-4.2", "figure-4.1"])] == ["figure-4.1", "table-4.2"]
    assert len(chosen(["all"])) == len(JOBS)
    assert {job.name for job in chosen(["tables"])} == {f"table-{n}" for n in _numbers("table")}
    with pytest.raises(ConfigError, match=r"no experiment 'table-9\.9': expected a table .*experiment-1"):
        chosen(["all", "table-9.9"])


def test_a_figure_and_a_table_are_written_and_put_on_the_page(tmp_path: Path) -> None:
    made = [
        m for m in reproduce(Request(("table-4.1", "figure-4.8"), tmp_path, fast=True)) if isinstance(m, Made)
    ]
    assert [m.name for m in made] == ["table-4.1", "figure-4.8"]
    assert (tmp_path / "figure-4.8.png").read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "table-4.1.csv").open(newline="") as file:
        assert next(csv.reader(file)) == ["parameter", "printed", "values of the env"]
    assert page(tmp_path, tmp_path / "docs" / "results.md") == ["table-4.1", "figure-4.8"]
    text = (tmp_path / "docs" / "results.md").read_text()
    assert "`relgym reproduce figure-4.8 --fast`" in text and "40 configurations" in text
    assert "![Bounces on a level surface](results/figure-4.8.png)" in text
    assert (tmp_path / "docs" / "results" / "figure-4.8.png").is_file()
    assert "Not made yet: figure-1.3" in text and "dream.md" not in text
    (tmp_path / "docs" / "results" / "dream.md").write_text("# What dreaming is worth\n")
    page(tmp_path, tmp_path / "docs" / "results.md")
    text = (tmp_path / "docs" / "results.md").read_text()
    assert "(results/dream.md)" in text and "any-env.md" not in text


def test_figures_come_out_the_same_again(tmp_path: Path) -> None:
    for folder in ("one", "two"):
        list(reproduce(Request(("figure-4.9",), tmp_path / folder, fast=True)))
    one, two = ((tmp_path / folder / "figure-4.9.png").read_bytes() for folder in ("one", "two"))
    assert one == two


def test_a_job_from_end_to_end(tmp_path: Path) -> None:
    task = Task(
        "relgym.experiments.chapter4.pushing:lesson", {"learner": "thesis", "seed": 100, "repeats": 1}
    )
    small = replace(JOBS["table-3.1"], plan=lambda _: {"thesis": [task]})
    protocol, store = Protocol.fast(), ResultStore(tmp_path / "cache")
    assert [p.done for p in compute([small], protocol, store, workers=1)] == [0, 1]
    made = make(small, protocol, store, tmp_path, "relgym reproduce table-3.1")
    row = next(line for line in made.text.split("\n") if "7.5 Ca" in line)
    assert row.split()[-2:] == ["480", "240"]  # the thesis' examples, and half of them
    assert made.seconds > 0
    assert [p.reused for p in compute([small], protocol, store, workers=1)] == [1]
    store.path(task).write_text(store.path(task).read_text()[:100])
    with pytest.raises(StoreError, match=r"is damaged: .*; delete it, and it is computed again"):
        list(compute([small], protocol, store, workers=1))


def test_the_command_stops_where_the_disk_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    command = ["reproduce", "table-4.1", "--fast", "--out", str(tmp_path)]
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        failed = CliRunner().invoke(app, command)
    assert failed.exit_code == 2 and "can't be written (no space left" in " ".join(failed.output.split())
    assert not list(tmp_path.iterdir())
    assert CliRunner().invoke(app, command).exit_code == 0
    assert (tmp_path / "table-4.1.txt").is_file()


def test_what_the_thesis_says_of_a_figure_stands_below_it(tmp_path: Path) -> None:
    assert set(REMARKS) < set(JOBS)
    remark = {"table-4.1": "forty of them"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("relgym.experiments.chapter4.reproduce.REMARKS", remark)
        list(reproduce(Request(("table-4.1",), tmp_path, fast=True)))
    assert (tmp_path / "table-4.1.txt").read_text().endswith("\nprinted: forty of them\n")


def test_no_page_without_results(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="holds no results: run `relgym reproduce NAME"):
        page(tmp_path, tmp_path / "results.md")
    (tmp_path / "table-4.1.json").write_text(json.dumps({"name": "table-4.1"}))
    with pytest.raises(
        StoreError, match=r"table-4\.1\.json is damaged .* run `relgym reproduce table-4\.1` again"
    ):
        page(tmp_path, tmp_path / "results.md")


def test_remaining_time_claims_no_more_than_is_known() -> None:
    def words(done: int, left: float | None, guessed: int) -> str:
        return remaining(Progress(None, done, 9, 0, left, guessed))

    assert words(0, None, 9) == "no task timed yet"
    assert words(3, 42.0, 0) == "at most about 42 s left"
    assert words(3, 600.0, 2) == "about 10 min left, 2 tasks of kinds not timed yet"
    assert words(9, 0.0, 0) == "done"


def test_the_command_says_what_is_wrong(tmp_path: Path) -> None:
    run = CliRunner().invoke
    listed = run(app, ["reproduce", "--list"])
    assert listed.exit_code == 0 and "figure-4.21" in listed.output
    for arguments, words in (
        (["reproduce", "table-5"], "no experiment 'table-5'"),
        (["reproduce"], "name what to reproduce"),
        (["reproduce", "table-3.1", "--backend", "dask"], "needs the address of a running cluster"),
        (["reproduce", "table-3.1", "--batches", "99"], "batches must lie between 1 and 50"),
    ):
        failed = run(app, [*arguments, "--out", str(tmp_path)])
        assert failed.exit_code == 2 and words in failed.output
    assert not list(tmp_path.rglob("*.json"))
