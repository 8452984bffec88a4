"""Rows and the relational states that they were seen in."""

from __future__ import annotations

import numpy as np
from streams import ALONE

from relgym.clustering.examples import ExampleTable


def test_states_differ_in_so_many_facts() -> None:
    table = ExampleTable()
    for state in (b"\x00\x01", b"\x00\x03", b"\x00\x01", b"\xff\x01", b"\x00"):
        table.add(ALONE, np.zeros(2), state, [-1])
    rows = np.array([0, 1, 2, 3])
    assert table.differences(rows).tolist() == [[0, 1, 0, 8], [1, 0, 1, 9], [0, 1, 0, 8], [8, 9, 8, 0]]
    assert table.differences(np.array([3, 1])).tolist() == [[0, 9], [9, 0]]
    assert table.differences(np.array([0, 4])).tolist() == [[0, 1], [1, 0]]  # a shorter key ends in nothing


def test_a_world_without_relations_has_one_state() -> None:
    table = ExampleTable()
    for _ in range(3):
        table.add(ALONE, np.zeros(2), b"", [-1])
    assert not table.differences(np.arange(3)).any()


def test_nothing_is_left_of_rows_that_are_gone() -> None:
    """Equal tables are equal bytes, whether or not other rows stood there once."""
    fresh, used = ExampleTable(), ExampleTable()
    for k in range(3):
        used.add(ALONE, np.full(2, 7.0 + k), b"", [5])
    used.keep(np.array([False, False, True]))
    fresh.add(ALONE, np.full(2, 9.0), b"", [5])
    for table in (used, fresh):
        table.add(ALONE, np.zeros(1), b"", [])
    for name, array in fresh.to_arrays().items():
        if name != "serial":
            np.testing.assert_array_equal(used.to_arrays()[name], array)
