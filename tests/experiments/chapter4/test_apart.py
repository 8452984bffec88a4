"""What results of other learners are said not to depend on, they don't: nothing of it runs."""

from __future__ import annotations

import gc
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import relgym
from relgym.experiments.jobs.code import LEARNER, modules_behind

CHAPTER = "relgym.experiments.chapter4"
TESTS = {"seeds": [91], "episodes": 1}
TRAINING = {"seed": 11, "order": 0}
LESSON = {**TRAINING, "experiment": 2, "checkpoints": [2], "tests": TESTS}
TASKS: list[tuple[str, dict[str, Any]]] = [
    *(("lesson:lesson", {**LESSON, "learner": each}) for each in ("original", "thesis", "one-polarity")),
    ("lesson:lesson", {**LESSON, "experiment": 1, "learner": "thesis", "stages": ["box", "ramp"]}),
    (
        "rolled:imagine",
        {
            "learner": "original",
            "experiment": 1,
            "batches": [[11, 0]],
            "episodes": 2,
            "chosen_on": TESTS,
            "tests": [92],
            "trials": 1,
        },
    ),
    ("pushing:lesson", {"learner": "thesis", "seed": 11}),
    ("noisy:lesson", {**TRAINING, "expected": 1e-10, "true": 1e-10, "episodes": 2, "tests": TESTS}),
    ("comparison:regress", {**LESSON, "baseline": "persistence", "shown": "thesis", "setting": 0}),
    ("comparison:classify", {**LESSON, "baseline": "knn-1", "shown": "contact", "setting": 0}),
    ("frequencies:count", {"experiment": 1, "seed": 11, "scenes": "thesis"}),
]


@pytest.mark.parametrize("function,arguments", TASKS, ids=[f"{f} {k}" for k, (f, _) in enumerate(TASKS)])
def test_nothing_runs_of_what_a_result_is_said_not_to_depend_on(
    function: str, arguments: Mapping[str, Any]
) -> None:
    module, _, name = f"{CHAPTER}.{function}".partition(":")
    task = getattr(import_module(module), name)
    here, files = Path(relgym.__file__).parent, set[str]()

    def note(frame: FrameType, event: str, argument: object) -> None:
        if event == "call":
            files.add(frame.f_code.co_filename)

    before = sys.getprofile()
    gc.collect()  # searches that earlier tests left half done are closed now, or else while the task runs
    gc.disable()
    sys.setprofile(note)
    try:
        task(**arguments)
    finally:
        sys.setprofile(before)
        gc.enable()
    run = {_module(Path(file), here) for file in files if Path(file).is_relative_to(here)}
    assert len(run) > 5 and module in run
    assert run <= set(modules_behind(module, LEARNER))


def _module(file: Path, here: Path) -> str:
    parts = ("relgym", *file.relative_to(here).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def test_the_learner_itself_is_left_out() -> None:
    behind = modules_behind(f"{CHAPTER}.lesson", LEARNER)
    assert not [
        m for m in behind if m.startswith(("relgym.laws", "relgym.logic", "relgym.model.world_model"))
    ]
    assert "relgym.thesis.foil" in behind
