"""Draws that options replace: each by itself, and all of them together."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.envs.draws import Draws, Range
from relgym.errors import ConfigError

SPAN = Range(1.0, 2.0, 0.5, 3.0)


def drawn(options: dict[str, Any], seed: int) -> dict[str, Any]:
    draws = Draws(options, np.random.default_rng(seed))
    draws.number("size", SPAN)
    draws.choice("kind", ("a", "b", "c"))
    draws.order("order", ("x", "y", "z"))
    draws.given("slope", 0.25, Range(0.0, 0.0, 0.0, 1.0))
    draws.number("speed", SPAN)
    return draws.taken


@given(
    st.integers(0, 10**6),
    st.sampled_from([("size", 2.5), ("kind", "b"), ("order", ("z", "x", "y")), ("slope", 1.0)]),
)
def test_an_option_replaces_one_draw_and_no_other(seed: int, option: tuple[str, Any]) -> None:
    name, value = option
    plain, other = drawn({}, seed), drawn({name: value}, seed)
    assert other == plain | {name: value}


@given(st.integers(0, 10**6), st.integers(0, 10**6))
def test_what_was_drawn_repeats_itself_whatever_the_generator(seed: int, later: int) -> None:
    plain = drawn({}, seed)
    assert drawn(plain, later) == plain
    assert 1.0 <= plain["size"] <= 2.0 and plain["slope"] == 0.25
    assert plain["kind"] in "abc" and sorted(plain["order"]) == ["x", "y", "z"]


@pytest.mark.parametrize("value", [0.5, 3.0, np.float32(0.75), np.int64(2), 1])
def test_options_may_go_beyond_what_is_drawn(value: Any) -> None:
    draws = Draws({"size": value}, np.random.default_rng(0))
    assert draws.number("size", SPAN) == draws.taken["size"] == float(value)
    assert type(draws.taken["size"]) is float


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"size": 3.1}, "option 'size': expected 0.5 to 3.0, got 3.1"),
        ({"size": 0.4}, "option 'size': expected 0.5 to 3.0"),
        ({"size": float("nan")}, "option 'size': expected a finite number, got nan"),
        ({"size": "big"}, "option 'size': expected a finite number, got 'big'"),
        ({"size": None}, "option 'size': expected a finite number, got None"),
        ({"kind": "d"}, r"option 'kind': expected one of \['a', 'b', 'c'\], got 'd'"),
        (
            {"order": ("x", "y")},
            r"option 'order': expected \['x', 'y', 'z'\] in some order, got \('x', 'y'\)",
        ),
        ({"order": ("x", "x", "y")}, "option 'order': expected"),
        ({"order": 5}, "option 'order': expected"),
        ({"order": (1, "x", "y")}, "option 'order': expected"),
        ({"kind": np.array(["a", "b"])}, "option 'kind': expected one of"),
        ({"slope": -0.1}, "option 'slope': expected 0.0 to 1.0, got -0.1"),
    ],
)
def test_what_an_option_may_not_be(options: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        drawn(options, 0)
