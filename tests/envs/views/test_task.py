"""Reward and termination beside what a view shows."""

from __future__ import annotations

import json

import numpy as np
import pytest
from gymnasium import spaces

from relgym.envs.views import NumbersView, TaskView, view_from_json
from relgym.errors import ConfigError, ObservationError

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


@pytest.mark.parametrize("reward", [float("nan"), None, "much", np.array([1.0, 2.0]), np.zeros(0)])
def test_a_reward_that_is_no_number_is_bad_only_where_it_is_shown(reward: object) -> None:
    scene = TaskView(VIEW).scene(SEEN)
    with pytest.raises(
        ObservationError, match=r"the reward: expected a finite number.*leave out learn_reward"
    ):
        TaskView(VIEW).with_outcome(scene, reward, False)
    view = TaskView(VIEW, reward=False)
    assert view.with_outcome(view.scene(SEEN), reward, True)["task"].values.tolist() == [1.0]


def test_a_reward_may_be_an_array_of_one_number() -> None:
    view = TaskView(VIEW)
    assert view.with_outcome(view.scene(SEEN), np.array([2.5], np.float32), False)["task"]["reward"] == 2.5


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
