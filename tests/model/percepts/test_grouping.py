"""Rows that are alike are found whatever their parts hold."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from relgym.model.percepts.grouping import distinct, members


@given(seed=st.integers(0, 10_000), n=st.integers(1, 40), width=st.integers(1, 20))
def test_groups_are_those_of_equal_rows(seed: int, n: int, width: int) -> None:
    rng = np.random.default_rng(seed)
    flags, numbers = rng.random((n, width, 2)) < 0.1, rng.integers(-1, 2, (n, 2))
    first, which = distinct(flags, numbers)
    for i in range(n):
        for j in range(n):
            alike = bool((flags[i] == flags[j]).all() and (numbers[i] == numbers[j]).all())
            assert (which[i] == which[j]) == alike
    assert sorted(which[first].tolist()) == list(range(len(first)))
    parts = list(members(which))
    assert len(parts) == len(first)
    for number, part in enumerate(parts):
        assert (which[part] == number).all()
    assert sorted(np.concatenate(parts).tolist()) == list(range(n))
