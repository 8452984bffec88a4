"""Every job is shown and drawn, from results of tiny tasks that stand in for the real ones."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from relgym.experiments.chapter4 import comparison, noisy, pushing, rolled
from relgym.experiments.chapter4.catalogue import JOBS
from relgym.experiments.chapter4.lesson import lesson
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.jobs.task import Task

TESTS = {"seeds": [110], "episodes": 2}
BATCH = {"seed": 100, "order": 0}
PROTOCOL = Protocol.fast(1)


@pytest.fixture(scope="module")
def stand_ins() -> Mapping[str, Any]:
    """Results by what tells tasks apart; learners with modes share one, and so do baselines."""
    points = {"checkpoints": [1, 3], "tests": TESTS}
    found: dict[str, Any] = {
        f"lesson/{name}": lesson(learner=name, experiment=1, **BATCH, **points)
        for name in ("thesis", "default")
    }
    found["pushing"] = pushing.lesson(learner="thesis", seed=100, repeats=1)
    found["imagine"] = rolled.imagine(
        learner="world",
        experiment=1,
        batches=[[100, 0]],
        episodes=2,
        chosen_on=TESTS,
        tests=[10, 11],
        trials=6,
    )
    found["noise"] = noisy.lesson(expected=1e-10, true=1e-10, **BATCH, episodes=2, tests=TESTS)
    found |= {"count/1": {"x": [1] * 4, "y": [1] * 5}, "count/2": {"x": [1] * 7, "y": [1] * 7}}
    common = {"shown": "contact", "experiment": 1, **BATCH, **points}
    found["regress"] = comparison.regress(baseline="rls", **common)
    found["classify"] = comparison.classify(baseline="knn-1", **common)
    return found


def _stand_in(task: Task, found: Mapping[str, Any]) -> Any:
    if task.name in ("regress", "classify", "imagine"):
        return found[task.name]
    room = task.function.split(":")[0].rsplit(".", 1)[1]
    if room in ("pushing", "noisy"):
        return found["noise" if room == "noisy" else room]
    if room == "frequencies":
        return found[f"count/{task.arguments['experiment']}"]
    learner = task.arguments["learner"]
    return found["lesson/default" if learner == "default" else "lesson/thesis"]


@pytest.mark.parametrize("name", sorted(JOBS))
def test_every_job_is_shown_and_drawn(name: str, stand_ins: Mapping[str, Any], tmp_path: Path) -> None:
    job = JOBS[name]
    plan = job.plan(PROTOCOL)
    shown = job.show(PROTOCOL, {g: [_stand_in(t, stand_ins) for t in tasks] for g, tasks in plan.items()})
    assert shown.text.strip() and "nan" not in shown.text
    width = len(shown.rows[0])
    assert all(len(row) == width for row in shown.rows)
    assert max(map(len, shown.text.split("\n"))) < 200
    nothing = ("No roll-out", "has not learned both modes", "without a tree")  # to draw, and the text says so
    assert name.startswith("figure") <= (
        shown.draw is not None or any(words in shown.text for words in nothing)
    )
    if shown.draw is not None:
        shown.draw(tmp_path / "figure.png")
        assert (tmp_path / "figure.png").stat().st_size > 2000
