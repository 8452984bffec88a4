"""Which mode each example is assigned to, over rows that come and go."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from relgym.clustering.assignments import AssignmentLog
from relgym.clustering.mode import NOISE
from relgym.config.constants import FIRST_ROOM


def log_of(*rows: int, labels: tuple[int, ...]) -> AssignmentLog:
    """Examples of some rows of a table, whose values are ten times these."""
    log = AssignmentLog()
    for row in rows:
        log.append(row, 10.0 * row)
    log.labels[:] = labels
    return log


def test_it_grows_and_keeps_what_it_has() -> None:
    log = AssignmentLog()
    numbers = [log.append(3 * k, 0.5 * k) for k in range(FIRST_ROOM)]
    log.labels[7] = 4
    numbers += [log.append(3 * k, 0.5 * k) for k in range(FIRST_ROOM, 3 * FIRST_ROOM)]
    assert numbers == list(range(3 * FIRST_ROOM))
    assert len(log) == log.seen == 3 * FIRST_ROOM
    np.testing.assert_array_equal(log.rows, 3 * np.arange(3 * FIRST_ROOM))
    np.testing.assert_array_equal(log.y, 0.5 * np.arange(3 * FIRST_ROOM))
    assert np.flatnonzero(log.labels).tolist() == [7] and log.labels[7] == 4


def test_dropped_rows_take_their_examples_along() -> None:
    """A target has no example of every row of its type's table, here none of the second row."""
    log = log_of(0, 2, 3, 4, 5, labels=(7, NOISE, 8, 7, NOISE))
    numbers = log.keep(np.array([False, True, True, False, True, False]))
    assert numbers.tolist() == [-1, 0, -1, 1, -1]
    assert log.rows.tolist() == [1, 2]  # of the rows that stay, which are 1, 2 and 4
    assert log.y.tolist() == [20.0, 40.0]
    assert log.labels.tolist() == [NOISE, 7]
    assert log.forgotten == {7: 1, 8: 1, NOISE: 1}
    assert (len(log), log.seen) == (2, 5)
    assert log.append(9, 1.0) == 2
    assert log.labels[2] == NOISE  # another one stood there before


@given(st.lists(st.tuples(st.booleans(), st.booleans(), st.integers(0, 3)), max_size=30))
def test_none_is_lost_and_none_counted_twice(rows: list[tuple[bool, bool, int]]) -> None:
    """Rows that the target has an example of, those that stay, and modes."""
    log, kept = AssignmentLog(), np.array([stays for _, stays, _ in rows], dtype=np.bool_)
    labels = []
    for row, (known, _, mode) in enumerate(rows):
        if known:
            log.append(row, float(row))
            labels.append(mode)
    log.labels[:] = labels
    before = {mode: labels.count(mode) for mode in labels}
    log.keep(kept)
    after = dict(log.forgotten)
    for mode in log.labels.tolist():
        after[mode] = after.get(mode, 0) + 1
    assert after == before
    assert log.seen == len(labels)
    new = np.cumsum(kept) - 1
    assert log.rows.tolist() == [new[row] for row, (known, stays, _) in enumerate(rows) if known and stays]
    again = AssignmentLog.from_arrays(log.to_arrays())
    assert (again.seen, again.forgotten) == (log.seen, log.forgotten)
    for name, array in log.to_arrays().items():
        np.testing.assert_array_equal(again.to_arrays()[name], array)


def test_what_is_read_is_no_view() -> None:
    log = log_of(0, 1, labels=(1, 2))
    again = AssignmentLog.from_arrays(log.to_arrays())
    again.labels[0] = 9
    again.append(2, 20.0)
    assert log.labels.tolist() == [1, 2]
    assert again.rows.tolist() == [0, 1, 2] and again.labels.tolist() == [9, 2, NOISE]
