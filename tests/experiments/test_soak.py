"""Long lives and wrong numbers, in small."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from relgym.experiments.benchmark import main
from relgym.experiments.outliers import errors_on, learned
from relgym.experiments.soak import LARGER, SLOWER, SUITE, Course, course, soak


def test_a_soak_tells_memory_cost_and_worst_step() -> None:
    rows = soak("cart", 60, every=25)
    assert [row[0] for row in rows] == [25, 50]
    assert all(row[2] > 10.0 and 0.0 < row[3] <= row[4] for row in rows)


def test_quarters_after_the_bound_are_compared() -> None:
    rows = [[10_000 * k, 0.0, 50.0 + k, 1.0 + k, 9.0] for k in range(1, 13)]
    rows[8][2] = 99.0  # a moment
    assert course(rows, 50_000) == Course((55.5, 61.5), (3.0, 12.5))
    assert course(rows, 100_000) is None  # too short
    finer = [[5_000 * k, 0.0, 50.0, 2.0 if k in (3, 4) else 9.0, 9.0] for k in range(1, 13)]
    assert course(finer, 40_000) == Course((50.0, 50.0), (2.0, 9.0))


def test_a_life_is_told_as_a_benchmark(tmp_path: Path) -> None:
    main(SUITE, ["cart", "--steps", "200", "--history", "100", "--out", str(tmp_path)])
    made = json.loads((tmp_path / "cart.json").read_text())
    assert [figure["limit"] for figure in made["figures"]] == [LARGER, SLOWER]
    assert made["text"].count("\n") > 10
    assert "MB at most, and" in made["text"]


def test_wrong_numbers_cost_nothing() -> None:
    dirty = learned("cart", 150, 0, share=1 / 50)
    assert dirty.get_wrapper_attr("replaced") > 2
    assert dirty.model.set_aside + dirty.skipped > 2
    errors = errors_on(dirty.model, "cart", 60, 7)
    assert np.median(errors["self.x0"]) < 1e-3
