"""What is written is what may be read, however large a property's numbers are."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.errors import ModelFileError
from relgym.files.records import checked
from relgym.model.files.format import CalibrationRecord
from relgym.model.predicting.calibration import EXPERTS, Audit, Calibration, Key


def looked_back(sizes: list[float], steps: int) -> Calibration:
    """A calibration of predictions that were off by so much, one after the other."""
    known = Calibration()
    for k in range(steps):
        values = [math.nan] * len(EXPERTS)
        values[0], values[-1] = sizes[k % len(sizes)], -2.0 * sizes[(k + 1) % len(sizes)]
        known.look_back(Audit(Key(0, 1, 3), tuple(values)), 0.0, claimed=True, rounding=0.0, error=0.05)
    return known


def read(known: Calibration) -> Any:
    return checked(json.loads(json.dumps(known.to_json())), CalibrationRecord, "it")


@pytest.mark.parametrize("size", [1e8, 1e60, 1e150, 1e300])
def test_calibrations_of_any_scale_are_read(size: float) -> None:
    """Squares of errors are sums of squares: of a property in the millions more than any count."""
    known = looked_back([size, -0.5 * size], 3_000)
    (squares,) = {tuple(cell.squares[0][:1]) for cell in read(known).cells if cell.heard}
    assert 0 < squares[0] <= 1025
    again = Calibration.from_json(known.to_json(), 0.9)
    again.look_back(Audit(Key(0, 1, 3), (size,) * len(EXPERTS)), 0.0, claimed=True, rounding=0.0, error=0.05)
    read(again)


@given(
    st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20), st.integers(1, 60)
)
def test_whatever_came_is_read(sizes: list[float], steps: int) -> None:
    read(looked_back(sizes, steps))


@pytest.mark.parametrize("bad", [-1.0, 1e305, math.inf])
def test_sums_that_no_squares_have_are_refused(bad: float) -> None:
    plain = looked_back([1.0], 3).to_json()
    plain["cells"][0]["squares"][0][1] = bad
    with pytest.raises(ModelFileError, match=r"squares\[0\]\[1\]"):
        checked(plain, CalibrationRecord, "it")


def test_what_the_largest_sums_leave_is_a_number() -> None:
    plain = looked_back([1.0], 3).to_json()
    for cell in plain["cells"]:
        for sums in cell["squares"]:
            sums[1:] = [1e304, 1e304]
    known = Calibration.from_json(plain, 0.9)
    told = known.assess(Key(0, 1, 3), (1.0,) * len(EXPERTS))
    assert np.isfinite(told.spread)
