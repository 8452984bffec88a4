"""Which batch stands for a learner in the tables of modes."""

from __future__ import annotations

from typing import Any

from relgym.experiments.chapter4.tables_modes import best_run

FLY = {"weights": {"vx": 1.0}, "intercept": 0.0, "others": 0}
BOUNCE = {"weights": {"vx": -0.9}, "intercept": 0.0, "others": 0}
NONE = {"weights": {"vx": 0.3}, "intercept": 0.0, "others": 0}


def run(modes: list[dict[str, Any]], wrong: int) -> dict[str, Any]:
    counted = {"wrong": wrong, "examples": 100}
    return {"modes": {"ball.vx": modes}, "scores": [{"targets": {"ball.vx": {"counted": counted}}}]}


def test_what_learned_most_rows_stands_for_all_and_of_these_who_errs_least() -> None:
    few, more, most = run([FLY, NONE], 1), run([FLY, BOUNCE], 9), run([FLY, BOUNCE], 7)
    assert best_run([few, more, most]) is most
    assert best_run([few, run([], 0)]) is few
    assert best_run([run([], 3), run([], 2)])["scores"][0]["targets"]["ball.vx"]["counted"]["wrong"] == 2
