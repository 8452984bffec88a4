"""Names of conditions tell what happens where they hold."""

from __future__ import annotations

import pytest

from relgym.errors import ConfigError
from relgym.reporting.conditions import parse_condition
from relgym.reporting.functions import parse_sum
from relgym.reporting.naming import SHORT, named, named_text, word_for
from relgym.reporting.rules import Branch, PropertyRules, RuleList

LONG = "some struck B [intersect(A, B) and normal-y(A, B) <= 0.8]"


@pytest.mark.parametrize(
    ("function", "word"),
    [
        ("0", "at rest"),
        ("0.5", "held"),
        ("v", "steady"),
        ("v + 0.1", "drifting"),
        ("1.0000000001 v - 0.1", "drifting"),  # that is 1 but for rounding
        ("-0.9 v", "bouncing"),
        ("0.9 v", "changing"),
        ("0.9 v + 3", "changing"),
        ("v + 0.1 action.push", "driven"),
        ("0.9 v + 0.1 action.push", "deflected"),
        ("-0.5 v + crate_a.mass", "deflected"),
        ("action.push", "led"),
        ("0 v", "changing"),
    ],
)
def test_a_word_for_a_function(function: str, word: str) -> None:
    assert word_for(parse_sum(function), "v") == word


def branch(condition: str, function: str | None) -> Branch:
    cases = (parse_condition(condition),) if condition else ()
    return Branch(cases, None if function is None else parse_sum(function))


def test_long_conditions_alone_get_names_and_each_its_own() -> None:
    other = LONG.replace("0.8", "0.5")
    short = "v > 0.125"
    assert len(short) < SHORT <= len(LONG)
    found = named(
        [
            branch(LONG, "-0.9 v"),
            branch(short, "-0.8 v"),
            branch(other, "-0.7 v"),
            branch(LONG, None),
            branch("", "v"),
        ],
        "v",
    )
    assert [b.name for b in found] == ["bouncing", "", "bouncing b", "", ""]


def test_the_limit_is_told_in_place() -> None:
    name = "w" * (SHORT - len(" > 1"))
    assert [b.name for b in named([branch(f"{name} > 1", "0"), branch(f"{name[1:]} > 1", "0")], "v")] == [
        "at rest",
        "",
    ]


def rules() -> RuleList:
    cart = PropertyRules(
        "cart", "v", named([branch(LONG, "-0.9 v"), branch("v > 2", "0"), branch("", "v")], "v")
    )
    ball = PropertyRules(
        "ball", "v", named([branch(LONG.replace("0.8", "0.1"), "-0.9 v"), branch("", "v")], "v")
    )
    return RuleList(1, (), (cart, ball))


@pytest.mark.parametrize(
    ("condition", "text"),
    [
        ("cart.v: bouncing", LONG),
        ("ball.v: bouncing", LONG.replace("0.8", "0.1")),
        ("v > 2", "v > 2"),
        (LONG, LONG),
    ],
)
def test_a_condition_is_found_by_name_or_text(condition: str, text: str) -> None:
    assert named_text(rules(), condition) == text


@pytest.mark.parametrize(
    ("condition", "problem"),
    [
        ("bouncing", "several conditions are called 'bouncing'"),
        ("rolling", "no condition is called 'rolling'; there are .*'cart.v: bouncing'"),
        ("ball.v: v > 2", "no condition is called"),
    ],
)
def test_what_is_meant_must_be_one_condition(condition: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        named_text(rules(), condition)
