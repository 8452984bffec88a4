"""Modes as records: text, comparison, JSON."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from streams import mode_of

from relgym.clustering.mode import Mode, Role


def box(weight: float) -> Role:
    return Role("box", (("friction", weight),))


@pytest.mark.parametrize(
    ("mode", "text"),
    [
        (mode_of(("v", 1.0), constant=-0.00098), "v' = v - 0.00098"),
        (
            mode_of(("v", 0.525), ("w", -0.8227241), constant=0.0004243524),
            "v' = 0.525 v - 0.8227241 w + 0.0004243524",
        ),
        (mode_of(), "v' = 0"),
        (mode_of(constant=-3.0), "v' = -3"),
        (mode_of(("v", -1.0)), "v' = -v"),
        (mode_of(("v", 1.0), others=[box(-7.5)]), "v' = v - 7.5 box.friction"),
        (mode_of(others=[box(-5.0), box(-2.5)]), "v' = -5 box_a.friction - 2.5 box_b.friction"),
        (mode_of(("v", 0.1), others=[Role("ball", (("v'", 0.9),))]), "v' = 0.1 v + 0.9 ball_a.v'"),
    ],
)
def test_functions_read_like_the_thesis_tables(mode: Mode, text: str) -> None:
    assert mode.formula() == text


def test_parameters_are_weights_and_a_constant_that_is_there() -> None:
    assert mode_of().parameters == 0
    assert mode_of(("v", 1.0), constant=2.0).parameters == 2
    assert mode_of(("v", 1.0), others=[box(1.0), box(2.0)]).parameters == 3


def test_the_same_function_to_nine_digits() -> None:
    one = mode_of(("v", 0.5), others=[box(-2.5)], constant=1.0)
    assert one.same_function(mode_of(("v", 0.5 + 1e-11), others=[box(-2.5)], constant=1.0, id=7))
    assert not one.same_function(mode_of(("v", 0.5 + 1e-6), others=[box(-2.5)], constant=1.0))
    assert not one.same_function(mode_of(("v", 0.5), constant=1.0))
    assert not one.same_function(mode_of(("v", 0.5), others=[box(-2.5)]))
    assert one.same_function(mode_of(("v", 0.5), others=[box(-2.5)]), constant=False)


def test_numbers_are_compared_by_their_own_size() -> None:
    small = mode_of(("v", 1e-12), constant=1e-12)
    assert not small.same_function(mode_of(("v", 2e-12), constant=1e-12))
    assert not small.same_function(mode_of(("v", 1e-12), constant=2e-12))
    assert small.same_function(mode_of(("v", 1e-12), constant=2e-12), slack=1e-12)
    assert not small.same_function(mode_of(("v", 2e-12), constant=1e-12), slack=1e-12)


finite = st.floats(allow_nan=False, allow_infinity=False)


@given(finite, finite, finite, st.integers(1, 10**6))
def test_json_gives_back_the_same_bits(a: float, b: float, c: float, examples: int) -> None:
    mode = mode_of(("v", a), others=[box(b)], constant=c, id=3).with_examples(examples)
    assert Mode.from_json(mode.target, json.loads(json.dumps(mode.to_json()))) == mode
