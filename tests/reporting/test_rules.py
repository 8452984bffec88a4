"""A rule list is text that is read back and asked, and says what it says."""

from __future__ import annotations

import math

import pytest

from relgym.errors import ConfigError
from relgym.reporting.conditions import parse_condition
from relgym.reporting.functions import parse_sum
from relgym.reporting.parser import parse_rules
from relgym.reporting.rules import Bound, Branch, Derivation, Experience, PropertyRules, RuleList, RuleRole
from relgym.scene.objects import ACTION, ObjectType, Scene
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box

POSE = ("px", "py", "pz", "rx", "ry", "rz", "sx", "sy", "sz")
TYPES = (
    ObjectType("cart", (*POSE, "v"), shape=Box(), velocity=("v", None, None)),
    ObjectType("crate", (*POSE, "mass"), shape=Box()),
    ObjectType(ACTION, ("push", "brake"), flags=("brake",)),
)
OBJECTS = (("cart", "cart"), ("one", "crate"), ("two", "crate"), (ACTION, ACTION))
SCHEMA = SceneSchema(TYPES, OBJECTS)


def scene(x: float, v: float, push: float = 0.0, brake: float = 0.0) -> Scene:
    """A cart beside two crates at 10 and, higher up, at 20; all have sides of 2."""

    def at(x: float, y: float, last: float) -> list[float]:
        return [x, y, 0.0, 0.0, 0.0, 0.0, 2.0, 2.0, 2.0, last]

    return SCHEMA.scene(
        {"cart": at(x, 0.0, v), "one": at(10.0, 0.0, 3.0), "two": at(20.0, 5.0, 7.0), ACTION: [push, brake]}
    )


RULES = RuleList(
    1234,
    (("cart", 1, 1), ("crate", 1, 2)),
    (
        PropertyRules(
            "cart",
            "v",
            (
                Branch((parse_condition("v > 8"),), None, reason="unexplained there"),
                Branch((parse_condition("action.brake"),), parse_sum("0"), steps=4),
                Branch(
                    (
                        parse_condition("some struck B [crate(B)]"),
                        parse_condition("some close B [intersect(A, B) and mass(A, B) > 5]"),
                    ),
                    parse_sum("-0.5 v + 0.1 crate_a.mass"),
                    "hitting a crate",
                    steps=30,
                    spread=0.25,
                ),
                Branch((), parse_sum("v + 0.1 action.push"), steps=1200),
            ),
            (Bound("at least", -3.0, steps=2), Bound("if", 5.0, tests=parse_condition("px + v' >= 100"))),
            (RuleRole(("crate_a",), "crate", (parse_condition("intersect(A, B)", arity=2),)),),
            1240,
            6,
            advice="an approximation; ModelConfig(features=('trig',)) explains it",
        ),
    ),
    kinematics=(Derivation("cart", "px", "v", 0.5),),
)
TEXT = """\
Learned from 1,234 transitions.
Scenes held cart × 1, crate × 1 to 2; other numbers of objects were never seen.

cart.v'  (1,240 steps)
  if   v > 8:            no prediction (unexplained there)
  elif action.brake:     v' = 0                              4 steps  ± 0
  elif hitting a crate:  v' = -0.5 v + 0.1 crate_a.mass     30 steps  ± 0.25
  else:                  v' = v + 0.1 action.push        1,200 steps  ± 0
  then at least -3  (2 steps)
  then if px + v' >= 100: 5
  6 of these steps (0.48 %) follow none of these functions

  crate_a := the crate B where intersect(A, B)
  hitting a crate := some struck B [crate(B)]
                   | or some close B [intersect(A, B) and mass(A, B) > 5]

  advice: an approximation; ModelConfig(features=('trig',)) explains it

Declared kinematics
  cart.px' = px + 0.5 v'

# A: the object whose property is predicted.
# close: A and all that touches it, or else what is nearest.
# struck: A and what it approaches fastest of all that it touches.
# Branches are tried in order; steps: training steps that go by it; ±: what it leaves there."""


def test_word_for_word() -> None:
    assert str(RULES) == TEXT


def test_of_how_many_steps_a_branch_is_right_is_told_if_not_of_nearly_all() -> None:
    drawn = (
        Branch((parse_condition("action.a <= 0.5"),), parse_sum("x"), steps=957, wrong=19),
        Branch((), parse_sum("x + 1"), steps=1_043, wrong=828),
    )
    rules = RuleList(2_000, (), (PropertyRules("total", "x", drawn, steps=2_000),))
    assert (
        str(rules)
        == """\
Learned from 2,000 transitions.

total.x'  (2,000 steps)
  if   action.a <= 0.5:  x' = x                   957 steps  ± 0
  else:                  x' = x + 1  1,043 steps, 215 right  ± 0

# Branches are tried in order; steps: training steps that go by it; ±: what it leaves there.
# right: for so many of them what is said holds, if not for nearly all; ± is of these."""
    )
    read = parse_rules(str(rules))
    assert [branch.wrong for branch in read.properties[0].branches] == [0, 828]
    assert str(read) == str(rules)


def test_what_is_read_back_is_the_same() -> None:
    assert parse_rules(TEXT) == RULES


@pytest.mark.parametrize(
    ("where", "value"),
    [
        (scene(0.0, 2.0, push=5.0), 2.5),  # far from all: else
        (scene(0.0, 9.0), math.nan),
        (scene(0.0, 2.0, push=5.0, brake=1.0), 0.0),
        (scene(8.0, 2.0), -0.7),  # touches the first crate, of mass 3
        (scene(0.0, -3.0, push=-9.0), -3.0),  # -3.9 is below the limit
        (scene(98.0, 2.0), 5.0),
    ],
)
def test_values_by_hand(where: Scene, value: float) -> None:
    for rules in (RULES, parse_rules(TEXT)):
        said = rules.predict(where)
        assert said["cart", "v"] == pytest.approx(value, nan_ok=True)
        px = where["cart"]["px"] + 0.5 * value
        assert said["cart", "px"] == pytest.approx(px, nan_ok=True)


def test_batches_say_what_single_scenes_say() -> None:
    import numpy as np

    some = [scene(x, v) for x in (0.0, 8.0) for v in (-1.0, 2.0, 9.0)]
    many = RULES.predict_batch(SCHEMA, some[0].layout, np.array([s.vector for s in some]))
    for key, values in many.items():
        np.testing.assert_array_equal(values, [RULES.predict(s)[key] for s in some])


def test_two_players_for_one_role_are_no_player() -> None:
    role = RuleRole(("crate_a",), "crate")
    part = PropertyRules("cart", "v", (Branch((), parse_sum("crate_a.mass")),), roles=(role,))
    assert math.isnan(RuleList(1, (), (part,)).predict(scene(0.0, 1.0))["cart", "v"])


def test_a_branch_that_reads_what_is_not_there_is_passed_over() -> None:
    first = Branch((), parse_sum("2 lamp.light"))
    part = PropertyRules("cart", "v", (first, Branch((), parse_sum("v"))))
    assert RuleList(1, (), (part,)).predict(scene(0.0, 1.0))["cart", "v"] == 1.0


def test_situations_never_seen_have_no_prediction() -> None:
    part = PropertyRules(
        "cart",
        "v",
        (Branch((parse_condition("v > 8"),), parse_sum("0")), Branch((), parse_sum("v"))),
        experience=Experience((("touching", ("intersect",), ("crate",)),), (1, 2**24 - 1)),
    )
    rules = RuleList(1, (), (part,))
    assert parse_rules(str(rules)) == rules
    assert math.isnan(rules.predict(scene(0.0, 1.0))["cart", "v"])


def test_conditions_are_named() -> None:
    named = RULES.renamed({"hitting a crate": "crash"})
    assert "elif crash:" in str(named) and "crash := some struck B [crate(B)]" in str(named)
    assert parse_rules(str(named)) == named
    assert "elif braking:" in str(RULES.renamed({"action.brake": "braking"}))
    with pytest.raises(ConfigError, match="two conditions of"):
        RULES.renamed({"action.brake": "hitting a crate"})
    with pytest.raises(ConfigError, match="words of letters"):
        RULES.renamed({"hitting a crate": "if 3 > 2"})


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Learned from 1,234 transitions.", "Hello."),
        ("  then at least -3  (2 steps)", "  then perhaps"),
        ("v' = 0  ", "w' = 0  "),
        ("elif action.brake:", "elif some X ["),
        ("cart.v'  (1,240 steps)", "cart.v'"),
        ("cart.px' = px + 0.5 v'", "cart.px' = 3"),
    ],
)
def test_what_says_nothing_is_quoted(old: str, new: str) -> None:
    assert old in TEXT
    with pytest.raises(ConfigError):
        parse_rules(TEXT.replace(old, new))
