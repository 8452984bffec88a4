"""Actions as properties."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from relgym.envs.views import NumbersView
from relgym.envs.views.acts import Acts
from relgym.errors import ActionError, ConfigError


@pytest.mark.parametrize(
    ("space", "action", "properties", "values"),
    [
        (spaces.Discrete(2), 1, ("a",), [1.0]),
        (spaces.Discrete(3), np.int64(2), ("a", "a_is_0", "a_is_1", "a_is_2"), [2.0, 0.0, 0.0, 1.0]),
        (spaces.Discrete(3, start=5), 6, ("a", "a_is_5", "a_is_6", "a_is_7"), [6.0, 0.0, 1.0, 0.0]),
        (spaces.Discrete(17), 16, ("a",), [16.0]),
        (spaces.Box(-2.0, 2.0, (1,), np.float32), np.array([0.5], np.float32), ("a",), [0.5]),
        (spaces.Box(-2.0, 2.0, (2,), np.float32), np.array([0.5, -1.0]), ("a0", "a1"), [0.5, -1.0]),
        (spaces.MultiBinary(2), np.array([0, 1], np.int8), ("a0", "a1"), [0.0, 1.0]),
        (
            spaces.MultiDiscrete([2, 3]),
            np.array([1, 2]),
            ("a0", "a1", "a1_is_0", "a1_is_1", "a1_is_2"),
            [1.0, 2.0, 0.0, 0.0, 1.0],
        ),
    ],
)
def test_every_flat_action_has_properties(space: Any, action: Any, properties: Any, values: Any) -> None:
    acts = Acts(space)
    assert acts.type.properties == properties
    np.testing.assert_array_equal(acts.values(action), values)
    batch = acts.values_batch(np.array([action, action]))
    np.testing.assert_array_equal(batch, [values, values])


ARM = spaces.Dict(
    {
        "grip": spaces.Discrete(3),
        "light": spaces.MultiBinary(1),
        "move": spaces.Box(-1.0, 1.0, (2,), np.float64),
    }
)


def test_parts_of_a_dict_are_called_as_their_keys() -> None:
    acts = Acts(ARM)
    choices = ("grip_is_0", "grip_is_1", "grip_is_2")
    assert acts.type.properties == ("grip", "light", "move0", "move1", *choices)
    assert acts.type.flags == ("light", *choices)
    given = {"move": np.array([0.5, -0.5]), "grip": 2, "light": np.array([1], np.int8)}
    assert acts.values(given).tolist() == [2.0, 1.0, 0.5, -0.5, 0.0, 0.0, 1.0]
    with pytest.raises(ActionError, match="expected a dict with the keys"):
        acts.values({"grip": 2})
    with pytest.raises(ActionError, match="there is no such choice"):
        acts.values(given | {"grip": 3})
    named = Acts(ARM, ("hand", "lamp", "left", "up"))
    assert named.type.properties[:5] == ("hand", "lamp", "left", "up", "hand_is_0")
    with pytest.raises(ConfigError, match="actions: names of an action's numbers: expected 4 different"):
        Acts(ARM, ("hand", "lamp", "left"))


def test_numbers_of_a_tuple_are_numbered_throughout() -> None:
    acts = Acts(spaces.Tuple((spaces.Discrete(2), spaces.Box(-1.0, 1.0, (2,)))))
    assert acts.type.properties == ("a0", "a1", "a2") and acts.type.flags == ()
    assert acts.values((1, [0.25, 0.5])).tolist() == [1.0, 0.25, 0.5]


def test_actions_of_other_parts_are_other_actions() -> None:
    acts = Acts(ARM)
    acts.check(ARM)
    same = spaces.Dict({"grip": ARM["grip"], "light": ARM["light"], "move": spaces.Box(-9.0, 9.0, (2,))})
    acts.check(same)
    for other in (
        spaces.Dict({"hand": ARM["grip"], "light": ARM["light"], "move": ARM["move"]}),
        spaces.Tuple(tuple(ARM.spaces.values())),
        spaces.MultiDiscrete([3, 2]),
        spaces.Dict({"arm": ARM}),
    ):
        with pytest.raises(ConfigError, match="the view was made for actions of"):
            acts.check(other)


def test_choices_and_numbers_may_have_names() -> None:
    assert Acts(spaces.Discrete(2), ("left", "right")).type.properties == ("a", "left", "right")
    assert Acts(spaces.Box(-1, 1, (2,)), ("steer", "gas")).type.properties == ("steer", "gas")
    assert Acts(spaces.Discrete(2), ("left", "right")).type.flags == ("left", "right")
    assert Acts(spaces.MultiDiscrete([3, 9_999])).type.flags == ("a0_is_0", "a0_is_1", "a0_is_2")
    assert Acts(spaces.MultiBinary(2)).type.flags == ("a0", "a1")
    assert Acts(spaces.Box(-1, 1, (2,)), ("steer", "gas")).type.flags == ()
    with pytest.raises(ConfigError, match="names of the choices: expected 3"):
        Acts(spaces.Discrete(3), ("left", "right"))
    with pytest.raises(ConfigError, match="expected 2 different"):
        Acts(spaces.Box(-1, 1, (2,)), ("gas", "gas"))


def test_an_action_takes_the_place_of_another_one() -> None:
    view = NumbersView(spaces.Box(-1, 1, (1,), np.float64), spaces.Discrete(2))
    scene = view.with_action(view.with_action(view.scene(np.array([0.5])), 0), 1)
    assert scene["action"]["a"] == 1.0
    assert scene.layout.names == ("self", "action")


@pytest.mark.parametrize(
    "space",
    [
        spaces.Dict({"a": spaces.Dict({"b": spaces.Discrete(2)})}),
        spaces.Tuple([spaces.Text(3)]),
        spaces.Text(3),
    ],
)
def test_nested_actions_are_refused_with_a_remedy(space: Any) -> None:
    with pytest.raises(ConfigError, match="flatten it"):
        Acts(space)
