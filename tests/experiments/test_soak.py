"""Long lives and wrong numbers, in small."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.experiments.outliers import errors_on, learned
from relgym.experiments.soak import soak


def test_a_soak_tells_memory_cost_and_worst_step(capsys: pytest.CaptureFixture[str]) -> None:
    rows = soak("cart", 60, every=25)
    assert [row[0] for row in rows] == [25, 50]
    assert all(row[2] > 10.0 and 0.0 < row[3] <= row[4] for row in rows)
    assert "memory MB" in capsys.readouterr().out
    assert len(soak("cart", 60, every=50, hours=0.0)) == 1


def test_wrong_numbers_cost_nothing() -> None:
    dirty = learned("cart", 150, 0, share=1 / 50)
    assert dirty.get_wrapper_attr("replaced") > 2
    assert dirty.model.set_aside + dirty.skipped > 2
    errors = errors_on(dirty.model, "cart", 60, 7)
    assert np.median(errors["self.x0"]) < 1e-3
