"""Kernel and exported Python say of any program what its records say."""

from __future__ import annotations

import math
from base64 import b64encode
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_programs import Told, by_kernel, by_records, by_source, empty, made

from relgym.model.predicting.prediction import OUTCOMES
from relgym.program import records as ir
from relgym.program.source import python_source

SENTENCES = tuple(outcome.value for outcome in OUTCOMES)


def assert_told(told: Told, known: Told, tolerance: float = 1e-12) -> None:
    for name in ("outcomes", "modes", "margins", "probabilities", "intervals"):
        np.testing.assert_array_equal(getattr(told, name), getattr(known, name), name)
    np.testing.assert_allclose(told.after, known.after, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("start", range(0, 400, 100))
def test_both_say_what_the_records_say(start: int) -> None:
    for seed in range(start, start + 100):
        program, vectors = made(seed)
        known = by_records(program, vectors)
        assert_told(by_kernel(program, vectors), known)
        assert_told(by_source(python_source(program, "", SENTENCES), vectors), known)


def named(*pairs: tuple[str, str]) -> ir.Program:
    """Answers ``p' = p + k`` of properties so called, the first one by mode 1 in k = 1 and so on."""
    n = len(pairs)
    answers = tuple(
        ir.Answer(
            o, p, k, k, (), -1, modes=(ir.Mode(1, 2 * n + 3 + k, ir.Sum(((ir.CONSTANT, k + 1.0), (k, 1.0)))),)
        )
        for k, (o, p) in enumerate(pairs)
    )
    return empty(n, 3 * n + 3, answers=answers, columns=tuple(f"{o}.{p}" for o, p in pairs))


WORDS = st.text("aAbx_1", min_size=1, max_size=4).filter(str.isidentifier)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(WORDS, WORDS), min_size=1, max_size=5, unique=True))
def test_names_that_look_alike_stay_apart(pairs: list[tuple[str, str]]) -> None:
    """`a_b.c` and `a.b_c` are two things, and so are `A.x` and `a.x`."""
    program = named(*pairs)
    told = by_source(python_source(program, "", SENTENCES), np.zeros((1, len(pairs))))
    np.testing.assert_array_equal(told.after, [np.arange(1.0, len(pairs) + 1.0)])


def test_names_are_as_they_are_where_they_differ() -> None:
    text = python_source(named(("cart", "x"), ("cart", "v")), "", SENTENCES)
    assert "def cart_v(x, scene):" in text and "CART_X = 0" in text
    text = python_source(named(("cart", "x_v"), ("cart_x", "v")), "", SENTENCES)
    assert "def a1_cart_x_v(x, scene):" in text and "C1_CART_X_V = 1" in text


def test_a_name_of_what_stands_below_is_no_answers_name() -> None:
    program = named(("disc", "and_polygon"), ("nearest", "x"))
    told = by_source(python_source(program, "", SENTENCES), np.zeros((1, 2)))
    np.testing.assert_array_equal(told.after, [[1.0, 2.0]])


def test_least_squares_by_hand() -> None:
    """z = (4 - 2) / 2 = 1 and (1 - 0) / 1 = 1: 0.5 + z_1 + 2 z_2 = 3.5, kept to 3; with products 1.75.

    The leverage is 1/2, the squared distances are 2 and 1: by half a say of the rate 1 the first word counts for 1/6,
    and for 1/4 beside, for 5/12; by a quarter of that of 4 the second one for 1/20.
    """
    columns = ((1, 2.0, 2.0), (2, 0.0, 1.0))
    weights = ((0.5, 1.0, 2.0), (0.0, 1.0, 0.0, 0.0, 0.25, 0.5))  # 1, z1, z2; then z1 z1, z1 z2, z2 z2
    leverage = tuple(ir.Leverage((0.0,) * d, b64encode(bytes(2 * d * (d + 1))).decode()) for d in (2, 5))
    trusted = (
        ir.Trusted(4.0, 0.5, (0.25, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0)),
        ir.Trusted(2.0, 0.5, (0.0, 0.0, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0)),
    )
    squares = ir.Regression(0, 0, weights, -3.0, 3.0, trusted)
    beliefs = tuple(ir.Belief(1, 0, -2, able, 2, 0.75, 0.125, True) for able in (0, 4))
    answer = ir.Answer(
        "o", "p0", 0, 0, (), -1, state="none", trust=ir.Trust(beliefs, False), regression=squares
    )
    program = empty(3, 9, answers=(answer,), fits=(ir.Fit(columns, leverage),))
    said = by_source(python_source(program, "", SENTENCES), np.array([[10.0, 4.0, 1.0]]))
    assert (said.outcomes[0, 0], said.probabilities[0, 0], said.intervals[0, 0]) == (1, 0.75, 0.125)
    first = 3.0 * 5.0 / 12.0
    assert said.after[0, 0] == pytest.approx(10.0 + first + (1.75 - first) / 20.0)


def test_text_that_a_model_says_stands_in_the_docstring_whatever_it_is() -> None:
    odd = 'a "quote", """three""", a \\ and a newline\n'
    module: dict[str, Any] = {}
    exec(python_source(named(("o", "x")), odd, SENTENCES), module)
    assert module["__doc__"].startswith("a \"quote\", '''three''', a \\ and a newline")
    assert math.isclose(float(module["predict"]([[2.0]])[0][0, 0]), 3.0)
