"""Checks that the envs share: what is accepted comes back as it is meant, what isn't is named."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from relgym.envs.agents import AgentsSpace
from relgym.envs.arguments import (
    action_numbers,
    action_parts,
    check_options,
    checked_action,
    checked_actions,
    checked_function,
    checked_least,
    checked_mask,
    checked_options,
    checked_range,
    counted,
    numbered,
    per_object,
    physical_action,
    refuse_vector_env,
    takes,
)
from relgym.errors import ActionError, ConfigError
from relgym.scene.objects import ACTION, ObjectType
from relgym.scene.schema import SceneSchema

BOX = spaces.Box(np.array([-1.0, 0.0], np.float32), np.array([1.0, 2.0], np.float32))


@pytest.mark.parametrize("value", [0, 0.5, np.float32(2.0), np.int64(3)])
def test_numbers_of_at_least_something(value: Any) -> None:
    found = checked_least("friction", value, 0.0)
    assert found == float(value) and type(found) is float


@pytest.mark.parametrize("value", [-1e-9, math.inf, math.nan, True, "1", None])
def test_and_what_is_none(value: Any) -> None:
    with pytest.raises(ConfigError, match=r"friction=.*: expected a finite number of at least 0"):
        checked_least("friction", value, 0.0)


def test_ranges() -> None:
    assert checked_range("size", (0, 2)) == (0.0, 2.0)
    assert checked_range("size", [1.5, 1.5]) == (1.5, 1.5)  # type: ignore[arg-type]
    for bad in ((2.0, 1.0), (-1.0, 1.0), (0.0, math.inf), (0.0, 1.0, 2.0), (math.nan, 1.0)):
        with pytest.raises(ConfigError, match="expected two finite numbers with 0 <= low <= high"):
            checked_range("size", bad)  # type: ignore[arg-type]


def test_names_of_several_of_a_kind() -> None:
    assert numbered("ball", 3) == ("ball", "ball2", "ball3")
    assert numbered("ball", 0) == ()
    kinds = ("ball", "box")
    assert counted({"box": 2, "ball": 1}, kinds) == {"box": "box", "box2": "box", "ball": "ball"}
    assert counted(("ball", "box", "ball"), kinds) == {"ball": "ball", "ball2": "ball", "box": "box"}
    assert counted({"ball": 0}, kinds) == {}
    for bad, problem in (
        ("ball", "expected a sequence such as"),
        (("ball", "disc"), r"unknown kinds \['disc'\]"),
        ({"ball": -1}, r"objects\['ball'\]"),
        ({"ball": 101}, r"objects\['ball'\]"),
        ({"ball": 1.5}, r"objects\['ball'\]"),
    ):
        with pytest.raises(ConfigError, match=problem):
            counted(bad, kinds)  # type: ignore[arg-type]


def test_a_number_for_each_object() -> None:
    kinds = {"ball": "ball", "ball2": "ball", "box": "box"}
    assert per_object("e", 0.5, kinds, 0.9, (0.0, 1.0)) == dict.fromkeys(kinds, 0.5)
    # Its own entry, else its kind's, else the default; "ball" is an object and a kind.
    assert per_object("e", {"ball2": 0.25}, kinds, 0.75, (0.0, 1.0)) == {
        "ball": 0.75,
        "ball2": 0.25,
        "box": 0.75,
    }
    assert per_object("e", {"ball": 0.1, "ball2": 0.2}, kinds, 0.5, (0.0, 1.0)) == {
        "ball": 0.1,
        "ball2": 0.2,
        "box": 0.5,
    }
    assert per_object("e", {"box": 0.0}, {"box1": "box", "box2": "box"}, 0.5, (0.0, 1.0)) == {
        "box1": 0.0,
        "box2": 0.0,
    }
    with pytest.raises(ConfigError, match=r"unknown objects \['disc'\]"):
        per_object("e", {"disc": 0.1}, kinds, 0.5, (0.0, 1.0))
    for bad in (1.1, math.nan, "x", True):
        with pytest.raises(ConfigError, match=r"expected a number from 0 to 1"):
            per_object("e", {"box": bad}, kinds, 0.5, (0.0, 1.0))


def test_functions_take_so_many_arguments() -> None:
    def two(a: int, b: int) -> int:
        return a + b

    assert takes(two, 2) and not takes(two, 3) and not takes(two, 1)
    assert takes(lambda *some: some, 7) and takes(lambda a, b=1: a, 1)
    assert checked_function("reward", None, "scene") is None
    assert checked_function("reward", two, "before", "after") is two
    with pytest.raises(ConfigError, match="reward=5: expected a function, or None"):
        checked_function("reward", 5, "scene")
    with pytest.raises(ConfigError, match=r"expected a function of \(scene\)"):
        checked_function("reward", two, "scene")


def test_options() -> None:
    assert checked_options(None) == {} and checked_options({"a": 1}) == {"a": 1}
    with pytest.raises(ConfigError, match="expected a dict"):
        checked_options([("a", 1)])
    check_options({"a": 1}, ("a", "b"))
    with pytest.raises(ConfigError, match=r"unknown reset options \['c'\]; this env has \['a', 'b'\]"):
        check_options({"c": 1, "a": 0}, ("b", "a"))


def test_actions_of_a_box_are_clipped_by_rounding_alone() -> None:
    found = checked_action(BOX, [1.0 + 5e-7, 2.0 + 1e-6])
    assert found.dtype == np.float64 and found.tolist() == [1.0, 2.0]
    assert checked_action(BOX, np.array([0.25, 1.0])).tolist() == [0.25, 1.0]
    for bad in ([1.1, 1.0], [0.0, -0.1], [0.0], [[0.0, 1.0]], [math.nan, 1.0], "left", None, [1, 10**400]):
        with pytest.raises(ActionError, match="expected"):
            checked_action(BOX, bad)


def test_actions_of_other_spaces_lie_in_them() -> None:
    assert checked_action(spaces.Discrete(3), 2) == 2
    with pytest.raises(ActionError, match="action 3 lies outside"):
        checked_action(spaces.Discrete(3), 3)


ARM = spaces.Dict({"grip": spaces.Discrete(2), "move": BOX})
PAIR = spaces.Tuple((spaces.Discrete(2), BOX))


def test_actions_of_parts_are_checked_part_by_part() -> None:
    found = checked_action(ARM, {"move": [1.0 + 5e-7, 1.0], "grip": 1})
    assert list(found) == ["grip", "move"] and found["grip"] == 1 and found["move"].tolist() == [1.0, 1.0]
    chosen, moved = checked_action(PAIR, [0, np.array([0.5, 1.0], np.float32)])
    assert chosen == 0 and moved.dtype == np.float64 and moved.tolist() == [0.5, 1.0]
    with pytest.raises(ActionError, match="action 2 lies outside"):
        checked_action(ARM, {"grip": 2, "move": [0.0, 1.0]})
    for bad in ({"grip": 1}, {"grip": 1, "move": [0.0, 1.0], "look": 0}, (1, [0.0, 1.0]), 1, None):
        with pytest.raises(ActionError, match=r"expected a dict with the keys \['grip', 'move'\]"):
            checked_action(ARM, bad)
    for bad in ((1,), (1, [0.0, 1.0], 0), {0: 1, 1: [0.0, 1.0]}, 1, None):
        with pytest.raises(ActionError, match="expected a tuple of 2 parts"):
            checked_action(PAIR, bad)


def test_agents_that_are_gone_do_not_act() -> None:
    space = AgentsSpace({"a": spaces.Discrete(2), "b": spaces.Discrete(2)})
    assert action_parts(space, {"b": 1}) == [("b", spaces.Discrete(2), 1)]
    assert action_parts(space, {}) == []
    with pytest.raises(ActionError, match=r"expected a dict with the keys \['a', 'b'\]"):
        action_parts(space, {"c": 1})


@given(st.integers(1, 4), st.data())
def test_many_actions_are_checked_as_each_would_be(count: int, data: st.DataObject) -> None:
    number = st.sampled_from((-1.0, -0.5, 0.0, 1.0, 1.0 + 5e-7, 1.5, 2.0, 2.5))
    actions = [[data.draw(number), data.draw(number)] for _ in range(count)]
    wrong = None
    for k, action in enumerate(actions):
        try:
            checked_action(BOX, action)
        except ActionError:
            wrong = k if wrong is None else wrong
    if wrong is None:
        many = checked_actions(BOX, actions, count)
        assert many.tolist() == [checked_action(BOX, action).tolist() for action in actions]
    else:
        with pytest.raises(ActionError, match=f"action {wrong} of {count} lies outside"):
            checked_actions(BOX, actions, count)


def test_many_actions_of_other_spaces() -> None:
    assert checked_actions(spaces.Discrete(3), [0, 2], 2).tolist() == [0, 2]
    assert checked_actions(spaces.MultiBinary(2), [[0, 1], [1, 1]], 2).tolist() == [[0, 1], [1, 1]]
    for space, bad in (
        (spaces.Discrete(3), [0, 3]),
        (spaces.Discrete(3), [0]),
        (spaces.MultiBinary(2), [[0, 2], [1, 1]]),
        (spaces.MultiBinary(2), [[0, 1]]),
        (BOX, [[0.0, 0.0]]),
        (BOX, "left"),
    ):
        with pytest.raises(ActionError, match="expected"):
            checked_actions(space, bad, 2)


def test_masks() -> None:
    assert checked_mask(None, 3).tolist() == [True, True, True]
    assert checked_mask(np.array([True, False, True]), 3).tolist() == [True, False, True]
    for bad in (np.zeros(3, bool), np.array([1, 0, 1]), np.ones(2, bool), [True, True, True]):
        with pytest.raises(ConfigError, match="marks at least one env"):
            checked_mask(bad, 3)


def test_an_actions_numbers() -> None:
    assert action_numbers([[1, 2], [3, 4]]).tolist() == [1.0, 2.0, 3.0, 4.0]
    assert action_numbers(5, 1).tolist() == [5.0]
    for bad, count in (([1.0], 2), ([math.inf], 1), ("left", None), ([math.nan], None)):
        with pytest.raises(ActionError, match="expected"):
            action_numbers(bad, count)


def test_actions_in_physical_units() -> None:
    schema = SceneSchema(
        (ObjectType("cart", ("x",)), ObjectType(ACTION, ("push", "turn"))),
        (("cart", "cart"), (ACTION, ACTION)),
        action_scale=(("push", 0.0, 10.0), ("turn", -4.0, 4.0)),
    )
    assert physical_action(schema, [-1.0, -1.0]).tolist() == [0.0, -4.0]
    assert physical_action(schema, [1.0, 0.5]).tolist() == [10.0, 2.0]
    with pytest.raises(ActionError, match="expected an action of 2 finite numbers"):
        physical_action(schema, [0.0])


def test_wrappers_of_single_envs_refuse_vector_envs() -> None:
    many = gym.make_vec("CartPole-v1", num_envs=2, vectorization_mode="sync")
    with pytest.raises(ConfigError, match="expected a single env, got a vector env"):
        refuse_vector_env(many)
    refuse_vector_env(many.envs[0])  # type: ignore[attr-defined]
    many.close()
