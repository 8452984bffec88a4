"""Reward and termination beside what a view shows."""

from __future__ import annotations

import json

import numpy as np
import pytest
from gymnasium import spaces

from relgym.envs.views import NumbersView, TaskView, view_from_json
from relgym.errors import ConfigError

VIEW = NumbersView(spaces.Box(-9.0, 9.0, (2,), np.float64), spaces.Discrete(2))
SEEN = np.array([1.0, 2.0])


def test_what_a_step_brings_is_unknown_before_it() -> None:
    view = TaskView(VIEW)
    scene = view.scene(SEEN)
    assert scene.layout.names == ("self",)
    before = view.with_action(scene, 1)
    assert before["task"].values.tolist() == [0.0, 0.0]
    after = view.with_outcome(scene, -2.5, True)
    assert (after["task"]["reward"], after["task"]["terminated"]) == (-2.5, 1.0)
    assert view.with_action(after, 0)["task"].values.tolist() == [0.0, 0.0]
    np.testing.assert_array_equal(view.observation(after), SEEN)


def test_either_may_be_left_out() -> None:
    view = TaskView(VIEW, terminated=False)
    assert view.schema.type("task").properties == ("reward",)
    again = view_from_json(json.loads(json.dumps(view.to_json())))
    assert again.schema == view.schema
    with pytest.raises(ConfigError, match="leave out learn_reward"):
        TaskView(view)


def test_angles_are_settled_within() -> None:
    pair = TaskView(NumbersView(spaces.Box(-1.0, 1.0, (2,), np.float32), spaces.Discrete(2)))
    assert pair.open and pair.precision > 0
    final = pair.settled([np.array([0.6, 0.8], np.float32)])
    assert final.schema.type("self").properties == ("angle_x0",)
    assert final.schema.order == ("self", "action", "task")
