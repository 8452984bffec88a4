"""Linear functions are text that is read back, and say the same then."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.errors import ConfigError
from relgym.reporting.functions import Sum, evaluated, parse_sum

COLUMNS = {"v": 2.0, "w": -3.0, "action.force": 10.0, "th": 0.5}
HERE = np.empty(1)


def column(name: str) -> np.ndarray:
    return np.array([COLUMNS.get(name, np.nan)])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("v", 2.0),
        ("-0.9 v", -1.8),
        ("v + 0.025 action.force - 1", 1.25),
        ("1e-05 v - w", 3.00002),
        ("0.75 sin(th)", 0.75 * np.sin(0.5)),
        ("2 cos(3 th) + v", 2.0 * np.cos(1.5) + 2.0),
        ("action.force cos(th)", 10.0 * np.cos(0.5)),
        ("v w", -6.0),
        ("0", 0.0),
        ("-8", -8.0),
    ],
)
def test_text_and_value(text: str, value: float) -> None:
    found = parse_sum(text)
    assert found.text() == text
    assert found.values(column, HERE)[0] == pytest.approx(value, rel=1e-15)


def test_conditions_compare_more_than_sums() -> None:
    assert evaluated("|w + 3|", column, HERE)[0] == 0.0
    assert evaluated("(v - 1) * w", column, HERE)[0] == -3.0
    assert np.isnan(evaluated("unknown", column, HERE)[0])


@pytest.mark.parametrize("text", ["v + ", "3 4", "- - v"])
def test_what_is_no_sum_is_refused(text: str) -> None:
    with pytest.raises(ConfigError):
        parse_sum(text)


_weights = st.floats(-1e9, 1e9).filter(lambda w: w != 0.0)


@given(st.lists(st.tuples(_weights, st.sampled_from(sorted(COLUMNS))), max_size=4), st.floats(-1e9, 1e9))
def test_any_sum_is_read_back_exactly(terms: list[tuple[float, str]], constant: float) -> None:
    found = parse_sum(Sum(tuple(terms), constant + 0.0).text(17))
    assert found == Sum(tuple(terms), constant + 0.0)
