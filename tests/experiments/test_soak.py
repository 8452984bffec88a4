"""Long lives and wrong numbers, in small."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.experiments.outliers import errors_on, learned
from relgym.experiments.soak import soak, summary


def test_a_soak_tells_memory_cost_and_worst_step(capsys: pytest.CaptureFixture[str]) -> None:
    rows = soak("cart", 60, every=25)
    assert [row[0] for row in rows] == [25, 50]
    assert all(row[2] > 10.0 and 0.0 < row[3] <= row[4] for row in rows)
    assert "memory MB" in capsys.readouterr().out
    assert len(soak("cart", 60, every=50, hours=0.0)) == 1


def test_a_summary_compares_quarters_after_the_bound() -> None:
    rows = [[10_000 * k, 0.0, 50.0 + k, 1.0 + k, 9.0] for k in range(1, 13)]
    rows[8][2] = 99.0  # a moment
    said = summary(rows, 50_000)
    assert "55.5 MB in the first quarter, 61.5 in the last (+10.8 %), 99.0 at most" in said
    assert "3.000 ms up to 20,000, 12.500 in the last quarter (4.17 times)" in said
    assert summary(rows, 100_000).startswith("too short")
    finer = [[5_000 * k, 0.0, 50.0, 2.0 if k in (3, 4) else 9.0, 9.0] for k in range(1, 13)]
    assert "2.000 ms up to 20,000, 9.000 in the last quarter (4.50 times)" in summary(finer, 40_000)


def test_wrong_numbers_cost_nothing() -> None:
    dirty = learned("cart", 150, 0, share=1 / 50)
    assert dirty.get_wrapper_attr("replaced") > 2
    assert dirty.model.set_aside + dirty.skipped > 2
    errors = errors_on(dirty.model, "cart", 60, 7)
    assert np.median(errors["self.x0"]) < 1e-3
