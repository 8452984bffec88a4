"""From observations and actions to scenes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from carts import SCHEMA, CartEnv
from gymnasium import spaces

from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Sphere
from relgym.wrappers.views import SceneView, view_of

UNIT = spaces.Box(-1.0, 1.0, (2,), np.float32)
BALL = ObjectType("ball", ("px",), Sphere())
GUEST = ObjectType("guest", ("px",), Sphere(), optional=True)
JET = ObjectType("action", ("along", "across"))
# The action stands between other objects, and its ranges in another order than its properties.
JETS = SceneSchema(
    (BALL, GUEST, JET),
    (("ball", "ball"), ("action", "action"), ("guest", "guest")),
    action_scale=(("across", 0.0, 4.0), ("along", -8.0, 8.0)),
)
SEEN = {"ball": np.array([1.0]), "guest": np.array([2.0])}


def space_of(*names: str) -> spaces.Dict:
    return spaces.Dict({name: spaces.Box(-9.0, 9.0, (1,), np.float64) for name in names})


def test_scenes_are_what_the_ball_env_says_they_are() -> None:
    env = gym.make("relgym/BallBoxRamp-v0")
    observation, info = env.reset(seed=0)
    view = view_of(env)
    assert view.scene(observation) == info["scene"]
    assert view.with_action(info["scene"], 0) == info["scene"]  # nobody acts


def test_actions_get_physical_units_by_name_wherever_they_stand() -> None:
    view = SceneView(JETS, space_of("ball", "guest"), UNIT)
    scene = view.scene(SEEN)
    assert scene.layout.names == ("ball", "guest")
    acting = view.with_action(scene, np.array([-0.5, 0.25], np.float32))
    assert acting.layout.names == ("ball", "action", "guest")
    np.testing.assert_array_equal(acting.vector, [1.0, 2.0, 1.0, 2.0])  # ball, along, across, guest
    again = view.with_action(acting, np.array([1.0, 1.0]))
    np.testing.assert_array_equal(again.vector, [1.0, 8.0, 4.0, 2.0])
    np.testing.assert_array_equal(scene.vector, [1.0, 2.0])


def test_numbered_actions_are_taken_as_they_are() -> None:
    schema = SceneSchema((BALL, ObjectType("action", ("gear",))), (("ball", "ball"), ("action", "action")))
    view = SceneView(schema, space_of("ball"), spaces.Discrete(3))
    scene = view.with_action(view.scene({"ball": np.array([1.0])}), np.int64(2))
    assert scene["action"]["gear"] == 2.0


def test_only_optional_objects_may_be_absent() -> None:
    view = SceneView(JETS, space_of("ball", "guest"), UNIT)
    assert view.scene({"ball": np.array([1.0])}).layout.names == ("ball",)
    with pytest.raises(ObservationError, match=r"lacks the objects \['ball'\]"):
        view.scene({"guest": np.array([1.0])})


def test_unknown_objects_are_refused_also_when_the_rest_is_known() -> None:
    view = SceneView(JETS, space_of("ball", "guest"), UNIT)
    view.scene(SEEN)
    with pytest.raises(ObservationError, match=r"unknown objects \['cow'\]"):
        view.scene({**SEEN, "cow": np.array([1.0])})


def test_float32_observations_become_float64() -> None:
    view = SceneView(JETS, space_of("ball", "guest"), UNIT)
    assert view.scene({"ball": np.array([0.1], np.float32)}).vector.dtype == np.float64


@pytest.mark.parametrize(
    ("observation_space", "action_space", "message"),
    [
        (spaces.Box(-1.0, 1.0, (2,)), UNIT, "expected a Dict observation space"),
        (space_of("ball", "cow"), UNIT, "'cow', which the schema doesn't show"),
        (space_of("ball", "action"), UNIT, "'action', which the schema doesn't show"),
        (spaces.Dict({"ball": spaces.Box(-1.0, 1.0, (2,))}), UNIT, r"expected a Box of shape \(1,\)"),
        (space_of("ball"), spaces.Box(0.0, 1.0, (2,)), r"actions in \[-1, 1\], 2 numbers"),
        (space_of("ball"), spaces.Box(-1.0, 1.0, (3,)), r"actions in \[-1, 1\], 2 numbers"),
        (space_of("ball"), spaces.Discrete(2), r"actions in \[-1, 1\], 2 numbers"),
    ],
)
def test_spaces_that_do_not_fit_are_refused(observation_space: Any, action_space: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        SceneView(JETS, observation_space, action_space)


def test_declarations_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ConfigError, match="give one range for each"):
        SceneView(replace(JETS, action_scale=JETS.action_scale[:1]), space_of("ball"), UNIT)
    with pytest.raises(ConfigError, match="one property for each number"):
        SceneView(replace(JETS, action_scale=()), space_of("ball"), spaces.Discrete(2))


def test_wrappers_that_change_spaces_belong_outside() -> None:
    with pytest.raises(ConfigError, match="outside the learner"):
        view_of(gym.wrappers.FlattenObservation(CartEnv()))
    with pytest.raises(ConfigError, match="outside the learner"):
        view_of(gym.wrappers.RescaleAction(CartEnv(), np.float32(0.0), np.float32(1.0)))
    assert view_of(gym.wrappers.TimeLimit(CartEnv(), 5)).schema is SCHEMA
