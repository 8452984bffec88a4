"""Evenly spaced rows: which of a stream are kept, whatever their number."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.errors import ConfigError
from relgym.numeric.spaced_rows import SpacedRows


def came(count: int, most: int, every: int) -> SpacedRows:
    """Rows k -> 2 k, thinned whenever so many more have come."""
    found = SpacedRows()
    for k in range(count):
        found.add(np.array([float(k), 1.0]), np.array([2.0 * k]))
        if k % every == every - 1:
            found.thin(most)
    return found


@given(count=st.integers(1, 300), most=st.integers(1, 60), every=st.integers(1, 50))
def test_every_kth_row_is_kept_and_hardly_more_than_are_asked_for(count: int, most: int, every: int) -> None:
    found = came(count, most, every)
    assert found.seen == count
    assert found.columns[:, 0].tolist() == list(range(0, count, found.every))
    assert found.responses[:, 0].tolist() == [2.0 * k for k in range(0, count, found.every)]
    assert len(found) <= most + every
    assert found.every == 1 or 2 * len(found) >= most  # no more is left out than must be


def test_a_response_that_comes_late_was_nothing_before() -> None:
    found = SpacedRows()
    found.add(np.array([1.0]), np.array([5.0]))
    found.add(np.array([2.0]), np.array([6.0, 7.0]))
    assert found.responses.tolist() == [[5.0, 0.0], [6.0, 7.0]]


@pytest.mark.parametrize("count", [0, 5, 6, 7])
def test_a_response_is_known_of_all_rows_whether_or_not_its_first_one_is_kept(count: int) -> None:
    found = came(count, 3, 3)
    found.add(np.array([0.0, 1.0]), np.array([5.0, 7.0]))
    assert found.responses.shape == (len(found), 2)
    found.widen(1)
    assert found.responses.shape == (len(found), 2)
    found.widen(3)
    assert found.responses.shape == (len(found), 3)
    assert not found.responses[: count // found.every, 1:].any()


@pytest.mark.parametrize("count", [0, 7, 40])
def test_what_was_saved_goes_on_as_if_it_had_not_been(count: int) -> None:
    one = came(count, 10, 5)
    other = SpacedRows.restored(one.to_arrays())
    for k in range(100):
        for each in (one, other):
            each.add(np.array([float(k), 1.0]), np.array([2.0 * k]))
            each.thin(10)
    assert one.columns.tobytes() == other.columns.tobytes()
    assert (one.seen, one.every) == (other.seen, other.every)


def test_at_least_one_is_kept() -> None:
    with pytest.raises(ConfigError, match="at least one row to be kept, got 0"):
        came(3, 5, 5).thin(0)
