"""Any function the user writes as a view."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from relgym.envs.views import FunctionView, TaskView, view_from_json
from relgym.errors import ConfigError, ModelFileError, ObservationError
from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema

BALL, PADDLE = ObjectType("ball", ("y", "vy"), optional=True), ObjectType("paddle", ("y",))
SCHEMA = SceneSchema((BALL, PADDLE), (("ball", "ball"), ("paddle", "paddle")))
PUSH = spaces.Discrete(2)


def seeing(what: Any, **arguments: Any) -> FunctionView:
    return FunctionView(SCHEMA, lambda observation, info: what, PUSH, **arguments)


@pytest.mark.parametrize("ball", [[1.0, 2.0], {"vy": 2.0, "y": 1.0}, ("ball", {"y": 1.0, "vy": 2.0})])
def test_objects_are_vectors_or_mappings(ball: Any) -> None:
    scene = seeing({"ball": ball, "paddle": np.array([3.0])}).scene(None)
    np.testing.assert_array_equal(scene.vector, [1.0, 2.0, 3.0])


def test_the_function_is_shown_observation_and_info() -> None:
    view = FunctionView(SCHEMA, lambda seen, info: {"ball": [seen, info["v"]], "paddle": [0.0]}, PUSH)
    assert view.scene(5.0, {"v": 7.0})["ball"].values.tolist() == [5.0, 7.0]


def test_optional_objects_come_and_go() -> None:
    assert seeing({"ball": None, "paddle": [1.0]}).scene(None).layout.names == ("paddle",)
    with pytest.raises(
        ObservationError, match=r"left out \['paddle'\]; only objects of types declared optional"
    ):
        seeing({"ball": [1.0, 2.0]}).scene(None)


@pytest.mark.parametrize(
    ("seen", "message"),
    [
        (
            {"ball": ("paddle", [1.0]), "paddle": [1.0]},
            "'ball' changed its type: expected 'ball', got 'paddle'",
        ),
        (
            {"ball": {"y": 1.0}, "paddle": [1.0]},
            r"'ball' of type 'ball': expected the properties \('y', 'vy'\)",
        ),
        (
            {"ball": [1.0], "paddle": [1.0]},
            r"expected 2 properties \('y', 'vy'\), got an array of shape \(1,\)",
        ),
        ({"cow": [1.0], "paddle": [1.0]}, "unknown object 'cow'"),
        (
            {"ball": [1.0, np.inf], "paddle": [1.0]},
            "'ball', property 'vy': expected a finite number, got inf",
        ),
        ([1.0], "returned list"),
        ({"ball": "hello", "paddle": [1.0]}, r"'ball' of type 'ball': expected 2 numbers .* got 'hello'"),
        ({"ball": [1.0, "a"], "paddle": [1.0]}, r"expected 2 numbers .* got \[1.0, 'a'\]"),
        ({"ball": {"y": None, "vy": 1.0}, "paddle": [1.0]}, "'ball', property 'y': .* got nan"),
    ],
)
def test_what_is_wrong_is_named_with_a_remedy(seen: Any, message: str) -> None:
    with pytest.raises(ObservationError, match=message):
        seeing(seen).scene(None)


def test_actions_come_from_the_space_or_from_the_schema() -> None:
    view = seeing({"paddle": [1.0]}, actions=("up", "down"))
    assert view.with_action(view.scene(None), 1)["action"].values.tolist() == [1.0, 0.0, 1.0]
    own = SceneSchema(
        (PADDLE, ObjectType("action", ("push",))),
        (("paddle", "paddle"), ("action", "action")),
        action_scale=(("push", 0.0, 10.0),),
    )
    scaled = FunctionView(own, lambda observation, info: {"paddle": [0.0]}, spaces.Box(-1.0, 1.0, (1,)))
    assert scaled.with_action(scaled.scene(None), [0.0])["action"]["push"] == 5.0
    with pytest.raises(ConfigError, match=r"actions in \[-1, 1\]"):
        FunctionView(own, lambda observation, info: {}, PUSH)


def test_files_hold_no_functions() -> None:
    view = seeing({"paddle": [1.0]}, inverse=lambda scene: scene["paddle"]["y"])
    assert view.observation(view.scene(None)) == 1.0
    with pytest.raises(ModelFileError, match="pass the FunctionView again"):
        view_from_json(TaskView(view).to_json())
    with pytest.raises(ConfigError, match="pass inverse="):
        seeing({"paddle": [1.0]}).observation(view.scene(None))
    with pytest.raises(ModelFileError, match=r"Invalid value 'oracle' - at `\$\.kind`"):
        view_from_json({"kind": "oracle"})
