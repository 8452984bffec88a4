from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from relgym.scheduling.renewal import due


@given(st.integers(1, 100))
def test_it_is_due_whenever_there_are_twice_as_many(first: int) -> None:
    assert [n for n in range(10 * first) if due(n, first)] == [first, 2 * first, 4 * first, 8 * first]


def test_all_fits_before_the_latest_one_cost_no_more_than_that() -> None:
    every = [n for n in range(1, 10_000) if due(n, 1)]
    assert all(sum(every[:k]) < n for k, n in enumerate(every))
