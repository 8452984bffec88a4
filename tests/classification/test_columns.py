"""Growing arrays."""

from __future__ import annotations

import json

import numpy as np

from relgym.classification.columns import Column, Columns

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
