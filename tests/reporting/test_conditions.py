"""Conditions are text that is read back."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.errors import ConfigError
from relgym.logic.clause import ANY, Clause, Literal
from relgym.reporting.conditions import as_tests, condition_text, equal_to, parse_condition, parts_of

TOUCHES = Literal("intersect", (0, 1))
STEEP = Literal("normal-y", (0, 1), False, "<=", 0.8)


@pytest.mark.parametrize(
    ("clause", "context", "negated", "text"),
    [
        (
            Clause((TOUCHES, STEEP)),
            "touching",
            False,
            "some close B [intersect(A, B) and normal-y(A, B) <= 0.8]",
        ),
        (Clause((TOUCHES,)), "approached", True, "no struck B [intersect(A, B)]"),
        (Clause((Literal("ramp", (ANY,), True),)), "all", False, "no B [ramp(B)]"),
        (Clause((Literal("ramp", (ANY,), True),)), "approached", True, "some struck B [ramp(B)]"),
        (Clause((Literal("y-greater-than", (ANY, 0), True),)), "all", False, "no B [y-greater-than(B, A)]"),
        (Clause((Literal("v", (), False, "<=", 0.5),)), "all", False, "v <= 0.5"),
        (Clause((Literal("v", (), False, "<=", 0.5),)), "touching", True, "v > 0.5"),
        (Clause((Literal("-x - v'", (), False, "<=", -1.5),)), "all", False, "x + v' >= 1.5"),
        (Clause((equal_to("v", 0.0),)), "all", False, "v = 0"),
        (Clause((equal_to("v", -2.0),)), "all", True, "v != -2"),
        (Clause((equal_to("v'", 0.5, 1e-7),)), "all", False, "v' = 0.5 within 1e-07"),
        (Clause((Literal("ball", (0,)),)), "all", True, "not ball(A)"),
        (Clause((Literal("action.left?", (), False, ">", 0.5),)), "all", False, "action.left"),
        (Clause((Literal("action.left?", (), False, ">", 0.5),)), "all", True, "not action.left"),
        (
            Clause((TOUCHES, Literal("intersect", (1, ANY), True))),
            "touching",
            False,
            "some close B [intersect(A, B) and no close C [intersect(B, C)]]",
        ),
    ],
)
def test_a_clause_as_text_and_back(clause: Clause, context: str, negated: bool, text: str) -> None:
    found = as_tests(clause, context, negated=negated)
    assert condition_text(found) == text
    assert parse_condition(text) == found
    assert condition_text(parse_condition(text)) == text


def test_what_shares_no_variable_is_told_apart() -> None:
    clause = Clause((TOUCHES, Literal("v", (), False, ">", 0.0)))
    found = as_tests(clause, "touching")
    assert condition_text(found) == "some close B [intersect(A, B)] and v > 0"
    assert [len(part) for part in parts_of(clause)] == [1, 1]


def test_an_opposite_is_told_as_one() -> None:
    (test,) = as_tests(Clause((TOUCHES, STEEP)), "touching")
    assert str(test.opposite) == "no close B [intersect(A, B) and normal-y(A, B) <= 0.8]"
    assert test.opposite.opposite == test


@pytest.mark.parametrize(
    "text", ["some close B [", "some B [ramp(C)]", "v <= fast", "what is this", "some B [some C [ramp(C)]]"]
)
def test_what_says_nothing_is_refused(text: str) -> None:
    with pytest.raises(ConfigError):
        parse_condition(text)


_names = st.sampled_from(["on-top", "intersect", "ramp"])
_numbers = st.floats(-1e6, 1e6).map(lambda x: float(f"{x:.6g}"))


@st.composite
def _literals(draw: st.DrawFn) -> Literal:
    kind = draw(st.integers(0, 2))
    if kind == 0:
        return Literal("v", (), False, draw(st.sampled_from(["<=", ">"])), draw(_numbers))
    if kind == 1:
        return Literal("normal-y", (0, 1), draw(st.booleans()), "<=", draw(_numbers))
    args = draw(st.permutations([0, 1, 2]))[:2]
    return Literal(draw(_names), tuple(args), draw(st.booleans()))


@given(st.lists(_literals(), min_size=1, max_size=4), st.sampled_from(["approached", "touching", "all"]))
def test_any_clause_is_read_back(literals: list[Literal], context: str) -> None:
    for part in parts_of(Clause.of(literals)):
        for negated in (False, True):
            found = as_tests(part, context, negated=negated)
            text = condition_text(found)
            assert condition_text(parse_condition(text)) == text
            if not text.startswith("not ["):
                assert parse_condition(text) == found
