"""Actions in scenes: singly, in batches and in imagination the same numbers, at the same place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from relgym.envs.actions import (
    BatchActions,
    acting,
    action_values,
    as_slice,
    check_action_space,
    without_action,
)
from relgym.errors import ActionError, ConfigError
from relgym.scene.objects import ACTION, ObjectType
from relgym.scene.schema import SceneSchema
from relgym.wrappers.dyna.acting import acting_all

TYPES = (ObjectType("cart", ("x", "v")), ObjectType("wall", ("at",)), ObjectType(ACTION, ("turn", "push")))
SCALE = (("push", 0.0, 10.0), ("turn", -4.0, 4.0))
BOX = spaces.Box(-1.0, 1.0, (2,), np.float64)


def schema_of(place: int, *, scaled: bool) -> SceneSchema:
    """The action is the first, the second or the last object; its ranges are given in another order than its names."""
    objects = [("cart", "cart"), ("wall", "wall")]
    objects.insert(place, (ACTION, ACTION))
    return SceneSchema(TYPES, tuple(objects), action_scale=SCALE if scaled else ())


NUMBERS = st.sampled_from((-1.0, -0.5, 0.0, 0.25, 1.0))


@given(st.integers(0, 2), st.booleans(), st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=4))
def test_singly_and_in_batches(place: int, scaled: bool, actions: list[tuple[float, float]]) -> None:
    schema = schema_of(place, scaled=scaled)
    bare = [schema.scene({"cart": [float(k), 2.0], "wall": [-float(k)]}) for k in range(len(actions))]
    alone = [acting(scene, np.array(action)) for scene, action in zip(bare, actions, strict=True)]
    vectors = np.array([scene.vector for scene in bare])
    many = BatchActions(schema, bare[0].layout, BOX)
    joined = many.joined(vectors, np.array(actions))
    assert many.layout is alone[0].layout
    np.testing.assert_array_equal(joined, [scene.vector for scene in alone])
    layout, dreamt = acting_all(schema, bare[0].layout, vectors, np.array(actions))
    assert layout is many.layout
    np.testing.assert_array_equal(dreamt, joined)
    np.testing.assert_array_equal(many.parted(joined), vectors)
    for scene, was in zip(alone, bare, strict=True):
        assert scene.layout.names[place] == ACTION
        np.testing.assert_array_equal(without_action(scene).vector, was.vector)
        np.testing.assert_array_equal(acting(scene, np.zeros(2)).vector, acting(was, np.zeros(2)).vector)


def test_an_action_in_physical_units_by_hand() -> None:
    """The first number is the push, from 0 to 10, the second one the turn; the action's properties: turn, push."""
    assert action_values(schema_of(0, scaled=True), [0.5, -1.0]).tolist() == [-4.0, 7.5]
    assert action_values(schema_of(0, scaled=False), [0.5, -1.0]).tolist() == [0.5, -1.0]
    with pytest.raises(ActionError, match="2 finite numbers"):
        action_values(schema_of(0, scaled=False), [0.5])


def test_worlds_without_actions_stay_as_they_are() -> None:
    schema = SceneSchema(TYPES[:2], (("cart", "cart"), ("wall", "wall")))
    scene = schema.scene({"cart": [1.0, 2.0], "wall": [3.0]})
    assert acting(scene, np.zeros(2)) is scene and without_action(scene) is scene
    vectors = scene.vector[None]
    many = BatchActions(schema, scene.layout, BOX)
    assert many.joined(vectors, np.zeros((1, 2))) is vectors and many.parted(vectors) is vectors
    assert acting_all(schema, scene.layout, vectors, np.zeros((1, 2))) == (scene.layout, vectors)


def test_imagination_needs_as_many_numbers_as_an_action_has() -> None:
    schema = schema_of(2, scaled=False)
    layout = schema.layout(("cart", "wall"))
    with pytest.raises(
        ConfigError, match="expected 2 numbers for each action, as the action object has, got 3"
    ):
        acting_all(schema, layout, np.zeros((1, 3)), np.zeros((1, 3)))


@pytest.mark.parametrize(
    ("columns", "found"),
    [([2, 3, 4], slice(2, 5)), ([7], slice(7, 8)), ([1, 3], None), ([2, 1], None), ([], None)],
)
def test_columns_side_by_side_are_a_slice(columns: list[int], found: slice | None) -> None:
    told = as_slice(np.array(columns, dtype=np.intp))
    assert told == found if found is not None else isinstance(told, np.ndarray) and told.tolist() == columns


@pytest.mark.parametrize(
    ("scaled", "space", "problem"),
    [
        (True, BOX, ""),
        (False, spaces.Box(-5.0, 5.0, (2,)), ""),
        (False, spaces.MultiDiscrete([3, 4]), ""),
        (False, spaces.Discrete(3), "declare one property for each number"),
        (False, spaces.Dict(a=BOX), "leave the action out of the schema"),
        (True, spaces.Box(-1.0, 2.0, (2,)), r"actions in \[-1, 1\], 2 numbers each"),
        (True, spaces.Box(-1.0, 1.0, (3,)), r"actions in \[-1, 1\], 2 numbers each"),
        (True, spaces.MultiBinary(2), r"actions in \[-1, 1\]"),
    ],
)
def test_spaces_that_fit_the_action_object(scaled: bool, space: Any, problem: str) -> None:
    schema = schema_of(2, scaled=scaled)
    if not problem:
        check_action_space(schema, space)
        return
    with pytest.raises(ConfigError, match=problem):
        check_action_space(schema, space)


def test_ranges_of_other_properties_are_refused() -> None:
    schema = SceneSchema(TYPES, (("cart", "cart"), (ACTION, ACTION)), action_scale=(("push", 0.0, 1.0),))
    with pytest.raises(ConfigError, match="give one range for each"):
        check_action_space(schema, spaces.Box(-1.0, 1.0, (1,)))
