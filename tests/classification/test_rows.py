"""Rows that many keep are held once, as long as somebody keeps them."""

from __future__ import annotations

import copy
import pickle
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from relgym.classification.rows import Gathered, RowPool


def _row(*values: float) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64)


def _taken(pool: RowPool, *numbers: int) -> list[list[float]]:
    return pool.take(np.array(numbers, dtype=np.int64)).tolist()


def test_the_same_row_has_one_number() -> None:
    pool = RowPool(2)
    first, other, again = pool.hold(_row(1, 2)), pool.hold(_row(1, 3)), pool.hold(_row(1, 2))
    assert (first == again, first == other, len(pool)) == (True, False, 2)
    assert _taken(pool, other, first) == [[1, 3], [1, 2]]


def test_zeros_of_either_sign_differ_and_undefined_numbers_are_alike() -> None:
    pool = RowPool(1)
    assert pool.hold(_row(0.0)) != pool.hold(_row(-0.0))
    assert pool.hold(_row(np.nan)) == pool.hold(_row(np.nan))


def test_a_row_stays_as_long_as_somebody_holds_it() -> None:
    pool = RowPool(1)
    number = pool.hold(_row(5))
    assert pool.hold(_row(5)) == number
    pool.release([number])
    assert (len(pool), _taken(pool, number)) == (1, [[5]])
    pool.release([number])
    assert len(pool) == 0
    assert pool.hold(_row(7)) == number
    assert _taken(pool, number) == [[7]]


def test_rows_of_one_check_sum_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zlib, "crc32", lambda content: 0)
    pool = RowPool(1)
    first, second = pool.hold(_row(1)), pool.hold(_row(2))
    assert pool.hold(_row(1)) == first
    assert _taken(pool, first, second) == [[1], [2]]
    pool.release([second])
    assert pool.hold(_row(1)) == first
    pool.release([first] * 3)
    assert len(pool) == 0


def test_it_grows() -> None:
    pool = RowPool(3)
    numbers = [pool.hold(np.full(3, float(k))) for k in range(1000)]
    assert _taken(pool, *numbers) == [[k, k, k] for k in range(1000)]


def test_rows_without_numbers() -> None:
    pool = RowPool(0)
    assert pool.hold(_row()) == pool.hold(_row())
    assert pool.take(np.zeros(3, dtype=np.int64)).shape == (3, 0)


def test_rows_and_what_follows_them_are_put_together_once() -> None:
    pool = RowPool(1)
    numbers = np.array([pool.hold(_row(k)) for k in (4, 5)])
    found = Gathered(pool, numbers, np.array([[6.0], [7.0]]))
    assert found[:, 1].tolist() == [6, 7]
    assert found.whole.tolist() == [[4, 6], [5, 7]]
    assert found.whole is found.whole
    assert Gathered(pool, numbers, np.empty((2, 0))).whole.tolist() == [[4], [5]]


_PLANS = st.lists(st.tuples(st.booleans(), st.integers(0, 5)), max_size=60)


@given(_PLANS)
def test_as_many_rows_as_are_held(plan: list[tuple[bool, int]]) -> None:
    pool, kept = RowPool(2), dict[int, list[int]]()
    for take, value in plan:
        if take:
            kept.setdefault(value, []).append(pool.hold(np.array([value, -value], dtype=np.float64)))
        elif kept.get(value):
            pool.release([kept[value].pop()])
    held = {value: numbers for value, numbers in kept.items() if numbers}
    assert len(pool) == len(held)
    for value, numbers in held.items():
        assert _taken(pool, *numbers) == [[value, -value]] * len(numbers)
        assert len(set(numbers)) == 1


@given(_PLANS, _PLANS)
def test_copies_go_on_as_the_original_does(
    plan: list[tuple[bool, int]], later: list[tuple[bool, int]]
) -> None:
    def follow(pool: RowPool, kept: list[int], steps: list[tuple[bool, int]]) -> list[int]:
        for take, value in steps:
            if take:
                kept.append(pool.hold(np.array([float(value)])))
            elif kept:
                pool.release([kept.pop(value % len(kept))])
        return kept

    pool = RowPool(1)
    before = follow(pool, [], plan)
    copies = [copy.deepcopy(pool), pickle.loads(pickle.dumps(pool))]
    expected = follow(pool, list(before), later)
    for each in copies:
        assert follow(each, list(before), later) == expected
        assert len(each) == len(pool)
        assert _taken(each, *expected) == _taken(pool, *expected)
