"""Tables and figures whose making is killed again and again are those of an uninterrupted run (small tasks)."""

from __future__ import annotations

import json
import multiprocessing
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reproducing import reproduced

FEW = ("table-4.1", "table-4.4", "table-4.7")
MANY = (*FEW, "figure-4.3", "figure-4.6", "figure-4.22", "figure-4.27", "figure-4.28", "figure-4.29")


@pytest.fixture(scope="module")
def start() -> Callable[..., Any]:
    """Start a process that reproduces; it needn't import anything any more."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(
        [f"relgym.experiments.chapter4.{name}" for name in ("reproduce", "lesson", "rolled")]
    )

    def process(names: tuple[str, ...], folder: Path) -> Any:
        started = context.Process(target=reproduced, args=(names, str(folder)))
        started.start()
        return started

    return process


def _entries(folder: Path) -> dict[str, tuple[int, int]]:
    """Finished results, with when and as which file they were written."""
    files = folder.glob("cache/*/[!.]*.json")
    return {path.name: (path.stat().st_mtime_ns, path.stat().st_ino) for path in files}


def _numbers(folder: Path) -> dict[str, Any]:
    """All that a run leaves behind, times of computing set aside."""
    values = {p.name: json.loads(p.read_text())["value"] for p in folder.glob("cache/*/[!.]*.json")}
    for value in values.values():
        for cost in ("seconds", "bytes"):
            value.pop(cost, None)
    outputs = {p.name: p.read_bytes() for p in folder.glob("*.*") if p.suffix != ".json"}
    return values | outputs


def _killed(start: Callable[..., Any], names: tuple[str, ...], folder: Path, kills: int) -> None:
    rng = np.random.default_rng(kills)
    for _ in range(kills):
        before = _entries(folder)
        process = start(names, folder)
        wanted = len(before) + int(rng.integers(3))
        while process.is_alive() and len(_entries(folder)) < wanted:
            time.sleep(0.002)
        process.join(float(rng.uniform(0.0, 0.3)))
        process.kill()
        process.join()
        after = _entries(folder)
        assert before.items() <= after.items(), "finished work was done again"
    before = _entries(folder)
    process = start(names, folder)
    process.join()
    assert process.exitcode == 0
    assert before.items() <= _entries(folder).items()


def _check(start: Callable[..., Any], names: tuple[str, ...], folder: Path, kills: int) -> None:
    reproduced(names, str(folder / "whole"))
    _killed(start, names, folder / "killed", kills)
    whole, killed = _numbers(folder / "whole"), _numbers(folder / "killed")
    assert whole.keys() == killed.keys() and {f"{name}.txt" for name in names} <= whole.keys()
    assert whole == killed


def test_three_kills_change_nothing(start: Callable[..., Any], tmp_path: Path) -> None:
    _check(start, FEW, tmp_path, 3)


@pytest.mark.slow
def test_twenty_kills_change_nothing(start: Callable[..., Any], tmp_path: Path) -> None:
    _check(start, MANY, tmp_path, 20)
