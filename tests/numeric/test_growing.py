"""Tests of arrays that rows are appended to."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.config.constants import FIRST_ROOM, MORE_ROOM
from relgym.numeric.growing import grown, thin


@pytest.mark.parametrize(
    ("rows", "most", "room"),
    [
        (0, None, FIRST_ROOM),
        (FIRST_ROOM, None, 2 * FIRST_ROOM),
        (16 * FIRST_ROOM, None, int(16 * FIRST_ROOM * (1.0 + MORE_ROOM))),
        (FIRST_ROOM, FIRST_ROOM + 3, FIRST_ROOM + 3),
        (FIRST_ROOM, FIRST_ROOM, FIRST_ROOM),
    ],
)
def test_rows(rows: int, most: int | None, room: int) -> None:
    for shape in ((rows,), (rows, 3)):
        full = np.arange(float(np.prod(shape))).reshape(shape)
        found = grown(full, most)
        assert found.shape == (room, *shape[1:])
        np.testing.assert_array_equal(found[:rows], full)
        assert not found[rows:].any()
        assert grown(full.astype(np.int16), most).dtype == np.int16


def test_appending_copies_few_rows() -> None:
    rows, copied = np.zeros(FIRST_ROOM, dtype=np.uint8), 0
    while len(rows) < 200_000:
        copied, rows = copied + len(rows), grown(rows)
    assert copied <= 10 * len(rows)


@pytest.mark.parametrize("rows", [0, 1, FIRST_ROOM, 3 * FIRST_ROOM + 7])
def test_thinned(rows: int) -> None:
    kept = np.random.default_rng(rows).random(rows) < 0.6
    for shape in ((rows + 2,), (rows + 2, 3)):
        array = np.arange(float(np.prod(shape))).reshape(shape)
        before = array.copy()
        thin(array, kept)
        n = int(kept.sum())
        np.testing.assert_array_equal(array[:n], before[:rows][kept])
        np.testing.assert_array_equal(array[rows:], before[rows:])
