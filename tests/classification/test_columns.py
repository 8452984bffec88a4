"""Growing arrays."""

from __future__ import annotations

import copy
import json
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from relgym.classification.columns import Column, Columns
from relgym.classification.rows import RowPool

_SPEC = {
    "flags": Column("bool", ("K",)),
    "numbers": Column("float64", ("K", "F"), float("nan")),
    "id": Column("int64"),
}


def _filled(lengths: list[int]) -> Columns:
    columns = Columns(_SPEC, {"K": 1, "F": 2})
    for number, k in enumerate(lengths):
        row = columns.append()
        columns.write(
            row, {"flags": np.ones(k, bool), "numbers": np.full((k, 2), float(number)), "id": number}
        )
    return columns


def test_smaller_values_are_padded_with_the_fill() -> None:
    columns = _filled([3, 1])
    np.testing.assert_array_equal(columns["flags"], [[True, True, True], [True, False, False]])
    np.testing.assert_array_equal(columns["numbers"][1], [[1.0, 1.0], [np.nan, np.nan], [np.nan, np.nan]])


def test_values_written_earlier_survive_growth_in_rows_and_axes() -> None:
    columns = _filled([1] * 200 + [4])
    assert columns["numbers"].shape == (201, 4, 2)
    np.testing.assert_array_equal(columns["id"], np.arange(201))
    np.testing.assert_array_equal(columns["numbers"][:200, 0, 0], np.arange(200.0))


def test_overwriting_leaves_nothing_of_a_larger_value() -> None:
    columns = _filled([3])
    columns.write(0, {"flags": np.ones(1, bool), "numbers": np.zeros((1, 2)), "id": 7})
    np.testing.assert_array_equal(columns["flags"], [[True, False, False]])
    assert np.isnan(columns["numbers"][0, 1:]).all()


def test_replaced_arrays_may_change_width() -> None:
    columns = _filled([2, 2])
    columns["numbers"] = np.zeros((2, 2, 5))
    assert columns["numbers"].shape == (2, 2, 5)
    columns.append()
    assert np.isnan(columns["numbers"][2]).all()


def test_kept_rows_move_up() -> None:
    columns = _filled([1, 1, 1, 1])
    columns.keep(np.array([1, 3]))
    np.testing.assert_array_equal(columns["id"], [1, 3])


def test_json_round_trip_is_exact() -> None:
    columns = _filled([3, 1, 2])
    again = Columns(_SPEC, {"K": 1, "F": 2})
    again.load(json.loads(json.dumps(columns.to_dict())))
    for name in _SPEC:
        np.testing.assert_array_equal(again[name], columns[name])
    again.append()
    assert len(again) == 4


_OWN = {"own": Column("float64", ("A",), float("nan")), "id": Column("int64")}


def _pooled(pool: RowPool, values: list[list[float]]) -> Columns:
    columns = Columns(_OWN, {"A": 3}, {"own": pool})
    for number, value in enumerate(values):
        columns.write(columns.append(), {"own": np.array(value), "id": number})
    return columns


def test_a_pool_behind_an_array_is_not_seen() -> None:
    pool = RowPool(2)
    values = [[1.0, 2.0, 3.0], [1.0, 2.0, 4.0], [5.0, 6.0, 7.0]]
    columns, others = _pooled(pool, values), _pooled(pool, values[:1])
    assert columns["own"].tolist() == values
    assert columns.gathered("own", slice(1, 2))[0].tolist() == values[1]
    assert len(pool) == 2
    columns.write(0, {"own": np.array([8.0, 9.0, 0.0]), "id": 7})
    columns.keep(np.array([0, 1]))
    assert columns["own"].tolist() == [[8.0, 9.0, 0.0], values[1]]
    assert (others["own"].tolist(), len(pool)) == (values[:1], 2)
    columns["own"] = np.array([[1.0, 2.0], [3.0, 4.0]])
    assert columns["own"].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    columns.keep(np.empty(0, dtype=np.intp))
    others.keep(np.empty(0, dtype=np.intp))
    assert len(pool) == 0


def test_rows_in_a_pool_survive_growth() -> None:
    pool = RowPool(2)
    values = [[float(k), 1.0, float(-k)] for k in range(600)]
    assert _pooled(pool, values)["own"].tolist() == values


def test_what_is_written_does_not_tell_of_a_pool() -> None:
    values = [[1.0, 2.0, 3.0], [1.0, 2.0, float("nan")]]
    plain = Columns(_OWN, {"A": 3})
    for number, value in enumerate(values):
        plain.write(plain.append(), {"own": np.array(value), "id": number})
    pool = RowPool(2)
    columns = _pooled(pool, values)
    assert columns.to_dict() == plain.to_dict()
    assert columns.row_bytes({}) == plain.row_bytes({})
    columns.load(json.loads(json.dumps(plain.to_dict())))
    assert columns.to_dict() == plain.to_dict()
    assert len(pool) == 1
    columns.keep(np.empty(0, dtype=np.intp))
    assert len(pool) == 0


@pytest.mark.parametrize("rows", [0, 1, 300, 3000])  # of 3000 some arrays are large, others small
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda columns: pickle.loads(pickle.dumps(columns))])
def test_copies_are_equal_and_go_on(rows: int, copied: Callable[[Columns], Columns]) -> None:
    columns = _filled([1 + k % 2 for k in range(rows)])
    again = copied(columns)
    for number in range(300):
        for each in (columns, again):
            each.write(each.append(), {"flags": np.ones(3, bool), "numbers": np.ones((3, 2)), "id": -number})
    assert again.to_dict() == columns.to_dict()
    assert not any(np.shares_memory(again[name], columns[name]) for name in _SPEC)


def test_a_pool_is_copied_with_all_who_share_it() -> None:
    values = [[float(k % 7), 1.0, float(k)] for k in range(2000)]
    pool = RowPool(2)
    pair = _pooled(pool, values), _pooled(pool, values[::2])
    first, second = pickle.loads(pickle.dumps(pair))
    assert [first.to_dict(), second.to_dict()] == [each.to_dict() for each in pair]
    first.keep(np.array([0]))
    assert second["own"].tolist() == values[::2]
    second.keep(np.array([0]))
    assert first["own"].tolist() == values[:1]
    assert [len(pool), len(first._pools["own"])] == [7, 1]
