"""Agents as objects."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from runners import Runners

from relgym.envs import AgentsEnv
from relgym.envs.views import AgentsView, TaskView, view_from_json
from relgym.errors import ConfigError, ObservationError

RUNNERS = AgentsEnv(Runners(2))
SEEN = {"runner_1": np.array([3.0, 0.5]), "door": np.array([0.1])}


def view_of(**options: Any) -> AgentsView:
    return AgentsView(RUNNERS.observation_space, RUNNERS.action_space, **options)


def of(seen: dict[str, Any], done: dict[str, Any] | None = None, **options: Any) -> AgentsView:
    acts = done or dict.fromkeys(seen, spaces.Discrete(3))
    return AgentsView(spaces.Dict(seen), spaces.Dict(acts), **options)


def test_agents_of_a_kind_are_of_a_type() -> None:
    view = view_of()
    assert dict(view.schema.objects) == {"runner_0": "runner", "runner_1": "runner", "door": "door"}
    assert view.schema.type("runner").properties == ("x0", "x1", "a")
    assert view.schema.type("runner").exogenous == ("a",)
    assert view.schema.type("door").optional
    assert view.precision == 0.0


def test_scenes_and_back() -> None:
    view = view_of()
    scene = view.scene(SEEN)
    assert scene.layout.names == ("door", "runner_1")  # Gymnasium sorts the keys of a Dict
    acting = view.with_action(scene, {"door": 1, "runner_0": np.ones(1), "runner_1": np.array([-0.5])})
    assert acting["runner_1"].values.tolist() == [3.0, 0.5, -0.5]
    assert acting["door"].values.tolist() == [0.1, 1.0]
    assert scene["door"].values.tolist() == [0.1, 0.0]  # stays as it was
    shown = view.observation(acting)
    assert {agent: seen.tolist() for agent, seen in shown.items()} == {"runner_1": [3.0, 0.5], "door": [0.1]}
    idle = view.with_action(acting, {})
    assert idle == scene


def test_with_a_task_around() -> None:
    view = TaskView(view_of())
    acting = view.with_action(view.scene(SEEN), {"door": 1, "runner_1": np.zeros(1)})
    assert acting["task"].values.tolist() == [0.0, 0.0]
    assert acting["door"]["a"] == 1.0
    assert view.observation(view.with_outcome(acting, 2.0, True)).keys() == SEEN.keys()


def test_names_and_choices() -> None:
    view = view_of(names={"runner": ("x", "v")}, actions={"door": ("shut", "open")})
    assert view.schema.type("runner").properties == ("x", "v", "a")
    assert view.schema.type("door").properties == ("x", "a", "shut", "open")
    assert view.schema.type("door").flags == ("shut", "open")
    again = view_from_json(json.loads(json.dumps(view.to_json())))
    assert isinstance(again, AgentsView)
    assert again.schema == view.schema
    assert again.scene(SEEN) == view.scene(SEEN)


def test_agents_that_see_different_things_are_kinds_of_their_own() -> None:
    view = of(
        {
            "a_0": spaces.Discrete(2),
            "a_1": spaces.Discrete(3),
            "b_0": spaces.Discrete(2),
            "b_1": spaces.Discrete(2),
        }
    )
    assert view.kinds == {"a_0": "a_0", "a_1": "a_1", "b_0": "b", "b_1": "b"}
    assert of({"a": spaces.Discrete(2), "b": spaces.Discrete(2)}, kinds={"a": "one", "b": "one"}).kinds == {
        "a": "one",
        "b": "one",
    }


def test_what_an_agent_sees_may_have_parts() -> None:
    parts = spaces.Dict(observation=spaces.Box(-1, 1, (2,), np.float32), action_mask=spaces.MultiBinary(3))
    view = of({"p_0": parts, "p_1": parts})
    names = view.schema.type("p").properties
    assert set(names[:5]) == {
        "observation_x0",
        "observation_x1",
        "action_mask_x0",
        "action_mask_x1",
        "action_mask_x2",
    }
    assert view.precision > 0.0
    pair = spaces.Tuple((spaces.Discrete(2), spaces.Discrete(2)))
    assert of({"p_0": pair}).schema.type("p").properties[:2] == ("part0_x", "part1_x")


@pytest.mark.parametrize(
    ("seen", "message"),
    [
        ([1.0], "expected an observation by agent, got list"),
        ({"cow": np.zeros(2)}, r"unknown agents \['cow'\]"),
        ({"runner_0": np.zeros(3)}, "agent 'runner_0': expected 2 numbers"),
        ({"runner_0": np.array([np.nan, 1.0])}, "'runner_0', property 'x0'"),
    ],
)
def test_bad_observations(seen: Any, message: str) -> None:
    with pytest.raises(ObservationError, match=message):
        view_of().scene(seen)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: AgentsView(spaces.Discrete(2), spaces.Discrete(2)), "a part for each agent"),
        (lambda: of({"a": spaces.Discrete(2)}, {"b": spaces.Discrete(2)}), "of the same agents"),
        (lambda: of({"first one": spaces.Discrete(2)}), "Python identifiers"),
        (lambda: view_of(names={"cow": ("x",)}), r"no agents are of kinds \['cow'\]"),
        (lambda: view_of(names={"runner": ("x", "a")}), r"\['a'\] name both"),
        (lambda: view_of(kinds={"door": "door"}), "a kind for each of"),
        (lambda: view_of(kinds=dict.fromkeys(("door", "runner_0", "runner_1"), "one")), "name them apart"),
        (lambda: of({"a": spaces.Text(3)}), "pass view="),
        (lambda: view_of().check_actions(spaces.Discrete(2)), "the view was made for actions of"),
    ],
)
def test_declarations_that_do_not_fit(make: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make()
