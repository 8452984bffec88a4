from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from relgym.errors import ConfigError, StoreError
from relgym.experiments.jobs.pace import Pace
from relgym.experiments.jobs.run import results, run
from relgym.experiments.jobs.store import ResultStore
from relgym.experiments.jobs.task import Task

TASKS = [Task("statistics:fmean", {"data": [float(n), 2.0]}) for n in range(5)]
VALUES = [(n + 2.0) / 2.0 for n in range(5)]

SLOW = """
import pathlib, time
def slow(n, log):
    with open(log, "a") as file:
        file.write(f"{n}\\n")
    time.sleep(0.02)
    return {"n": n, "square": n * n}
"""

MAIN = """
import sys
from relgym.experiments.jobs.run import run
from relgym.experiments.jobs.store import ResultStore
from relgym.experiments.jobs.task import Task
folder, log = sys.argv[1:]
for _ in run([Task("slow_module:slow", {"n": n, "log": log}) for n in range(12)], ResultStore(folder), workers=1):
    print("x", flush=True)
"""


@pytest.mark.parametrize("workers", [1, 2])
def test_all_are_computed_and_then_reused(tmp_path: Path, workers: int) -> None:
    store = ResultStore(tmp_path)
    steps = list(run([*TASKS, TASKS[0]], store, workers=workers))
    assert [s.done for s in steps] == [0, 1, 2, 3, 4, 5]
    assert steps[-1].seconds_left == 0.0 and steps[-1].total == 5
    assert results(TASKS, store) == VALUES
    again = list(run(TASKS, store, workers=workers))
    assert len(again) == 1 and again[0].reused == again[0].done == 5


def test_a_missing_result_is_named(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="no result yet"):
        results(TASKS, ResultStore(tmp_path))


def test_a_run_that_stops_is_taken_up_again(tmp_path: Path) -> None:
    store = ResultStore(tmp_path)
    list(islice(run(TASKS, store, workers=1), 3))
    assert next(run(TASKS, store, workers=1)).reused == 2


def test_a_killed_run_repeats_nothing_that_was_finished(tmp_path: Path) -> None:
    (tmp_path / "slow_module.py").write_text(SLOW)
    (tmp_path / "main.py").write_text(MAIN)
    folder, log = tmp_path / "store", tmp_path / "log"
    command = [sys.executable, str(tmp_path / "main.py"), str(folder), str(log)]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(5):
            process.stdout.readline()
        process.kill()
    finished = {json.loads(p.read_text())["value"]["n"] for p in folder.rglob("[!.]*.json")}
    begun = [int(line) for line in log.read_text().split()]
    assert 4 <= len(finished) < 12
    assert not list(folder.rglob(".*.json.*"))[1:]  # at most the one that was being written
    subprocess.run(command, env=environment, check=True, capture_output=True)
    repeated = [int(line) for line in log.read_text().split()][len(begun) :]
    assert set(repeated) == set(range(12)) - finished
    assert len(list(folder.rglob("[!.]*.json"))) == 12


@pytest.mark.slow
def test_twenty_kills_at_random_moments_change_nothing(tmp_path: Path) -> None:
    (tmp_path / "slow_module.py").write_text(SLOW.replace("0.02", "0.3"))
    (tmp_path / "main.py").write_text(MAIN)
    log, environment = tmp_path / "log", os.environ | {"PYTHONPATH": str(tmp_path)}
    rng = np.random.default_rng(0)

    def command(folder: str) -> list[str]:
        return [sys.executable, str(tmp_path / "main.py"), str(tmp_path / folder), str(log)]

    for _ in range(20):
        kept = len(list((tmp_path / "killed").rglob("[!.]*.json")))
        with subprocess.Popen(command("killed"), env=environment, stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()  # it has begun
            time.sleep(float(rng.uniform(0.0, 0.6)))
            process.kill()
        assert len(list((tmp_path / "killed").rglob("[!.]*.json"))) >= kept
    subprocess.run(command("killed"), env=environment, check=True, capture_output=True)
    begun = len(log.read_text().split())
    assert begun <= 12 + 20  # every kill costs at most the task that was running
    subprocess.run(command("whole"), env=environment, check=True, capture_output=True)
    values = [
        {path.name: json.loads(path.read_text())["value"] for path in (tmp_path / folder).rglob("[!.]*.json")}
        for folder in ("killed", "whole")
    ]
    assert len(values[0]) == 12 and values[0] == values[1]


def test_unknown_backend_and_missing_address(tmp_path: Path) -> None:
    store = ResultStore(tmp_path)
    for options, words in (
        ({"backend": "slurm"}, "expected one of"),
        ({"backend": "dask"}, "needs the address"),
        ({"address": "somewhere:1"}, "without a cluster"),
    ):
        with pytest.raises(ConfigError, match=words):
            list(run(TASKS, store, **options))  # type: ignore[arg-type]


def test_remaining_time_is_that_of_the_same_kind() -> None:
    tasks = [Task("os:getpid", {"n": n}, kind) for n, kind in enumerate(["long"] * 3 + ["short"] * 4)]
    pace = Pace(tasks, workers=2)
    assert pace.left() is None and pace.guessed == 7
    pace.took(tasks[0], 100.0)
    pace.took(tasks[3], 10.0)
    assert pace.guessed == 0
    assert pace.left() == (2 * 100.0 + 3 * 10.0) / 2
    for task in tasks[1:3]:
        pace.took(task, 100.0)
    assert pace.left() == 15.0
    for task in tasks[4:6]:
        pace.took(task, 10.0)
    assert pace.left() == 10.0  # the last one takes as long as it takes, however many workers there are


def test_the_clock_plays_no_part() -> None:
    pace = Pace(TASKS, workers=1)
    pace.learn(TASKS[0], 2.0)
    before = pace.left()
    time.sleep(0.01)
    assert pace.left() == before == 10.0
