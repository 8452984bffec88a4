from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.envs.truck_push import TruckPushEnv
from relgym.envs.truck_scenes import layouts, partitions, stacks_of
from relgym.errors import ActionError, ConfigError, ObservationError

FULL = np.array([1.0], dtype=np.float32)  # 500
NONE = np.array([-1.0], dtype=np.float32)  # 0


def speed(env: TruckPushEnv) -> float:
    return env.scene["truck"]["vx"]


def test_layouts_are_numbered_as_in_figure_3_1() -> None:
    assert layouts(3) == ((3,), (2, 1), (1, 2), (1, 1, 1))
    assert partitions(3) == ((3,), (2, 1), (1, 1, 1))
    assert [len(layouts(n)) for n in (1, 2, 4, 5)] == [1, 2, 8, 16]


@pytest.mark.parametrize("layout", [1, 2, 3, 4])
def test_layout_is_as_asked_and_touches(layout: int) -> None:
    env = TruckPushEnv(task=None)
    order = ("box2", "box3", "box1")
    for seed in range(20):
        _, info = env.reset(seed=seed, options={"layout": layout, "order": order})
        assert info["layout"] == layout
        assert tuple(name for stack in info["stacks"] for name in stack) == order
        assert tuple(map(len, info["stacks"])) == layouts(3)[layout - 1]
        assert stacks_of(info["scene"]) == info["stacks"]
        for _ in range(40):
            env.step(FULL)
            assert_touching(env)


def assert_touching(env: TruckPushEnv) -> None:
    scene = env.scene
    left = scene["truck"]
    for stack in env.stacks:
        base = scene[stack[0]]
        assert abs(base["px"] - base["sx"] / 2 - left["px"] - left["sx"] / 2) < 1e-11
        for low, high in ((scene[a], scene[b]) for a, b in pairwise(stack)):
            assert abs(high["py"] - high["sy"] / 2 - low["py"] - low["sy"] / 2) < 1e-11
            assert high["px"] == low["px"] and high["sx"] <= low["sx"]
        left = base


@given(st.integers(1, 6), st.integers(0, 3), st.integers(0, 10**6))
def test_any_number_of_boxes(n_boxes: int, bystanders: int, seed: int) -> None:
    env = TruckPushEnv(n_boxes=n_boxes, bystanders=bystanders, task=None)
    _, info = env.reset(seed=seed)
    scene = info["scene"]
    assert stacks_of(scene) == info["stacks"]
    assert set(info["configuration"]) == set(env.reset_options)
    assert env.reset(options=info["configuration"])[1]["scene"] == scene
    boxes = [o for o in scene if o.type.name == "box"]
    assert len(boxes) == n_boxes + bystanders
    assert all(3 <= box[p] <= 5 for box in boxes for p in ("sx", "sy", "sz"))
    assert scene["truck"]["sy"] <= min(box["sy"] for box in boxes)
    off_track = [box for box in boxes if abs(box["pz"]) - box["sz"] / 2 > 2.5]
    assert [box.name for box in off_track] == [f"bystander{k + 1}" for k in range(bystanders)]


@pytest.mark.parametrize(
    ("layout", "friction"),
    # Table 3.1 with constants 0.1, 0.2, 0.4 of box1, box2, box3, stack by stack from the bottom up.
    [(1, 7.5 * 0.1), (2, 5.0 * 0.1 + 2.5 * 0.4), (3, 2.5 * 0.1 + 5.0 * 0.2), (4, 2.5 * 0.7)],
)
def test_hand_worked_step(layout: int, friction: float) -> None:
    env = TruckPushEnv(task=None)
    options = {"layout": layout, "order": ("box1", "box2", "box3"), "speed": 3.0}
    env.reset(options={**options, "box1_friction": 0.1, "box2_friction": 0.2, "box3_friction": 0.4})
    before = env.scene
    env.step(np.array([0.6]))  # 400
    assert speed(env) == pytest.approx(3.0 + 0.025 * 400 - friction, abs=1e-13)
    for name in ("truck", "box1", "box2", "box3"):
        assert env.scene[name]["px"] - before[name]["px"] == pytest.approx(speed(env), abs=1e-12)
        assert env.scene[name]["py"] == before[name]["py"]


def test_friction_stops_the_truck_and_never_reverses_it() -> None:
    env = TruckPushEnv(task=None)
    env.reset(seed=0)
    for _ in range(3):
        env.step(FULL)
    speeds = []
    for _ in range(37):
        env.step(NONE)
        speeds.append(speed(env))
    stopped = speeds.index(0.0)
    assert speeds[:stopped] == sorted(speeds[:stopped], reverse=True) and stopped > 0
    assert set(speeds[stopped:]) == {0.0}


@pytest.mark.parametrize(("force", "moves"), [(149.0, False), (151.0, True)])
def test_at_rest_the_force_must_exceed_the_friction(force: float, moves: bool) -> None:
    env = TruckPushEnv(task=None)
    env.reset(
        options={"layout": 1, "order": ("box1", "box2", "box3"), "box1_friction": 0.5}
    )  # 300 * 0.5 = 150
    before = env.scene
    env.step(np.array([force / 250.0 - 1.0]))
    assert (speed(env) > 0.0) == moves
    assert (env.scene["truck"]["px"] > before["truck"]["px"]) == moves


def test_bystanders_stay() -> None:
    env = TruckPushEnv(bystanders=3, task=None)
    _, info = env.reset(seed=0)
    for _ in range(40):
        env.step(FULL)
    for k in (1, 2, 3):
        np.testing.assert_array_equal(
            env.scene[f"bystander{k}"].values, info["scene"][f"bystander{k}"].values
        )


def test_frictions_per_episode_or_step() -> None:
    for resample, same in (("episode", True), ("step", False)):
        env = TruckPushEnv(resample=resample, task=None)
        _, info = env.reset(seed=0)
        env.step(FULL)
        assert (env.scene["box1"]["friction"] == info["scene"]["box1"]["friction"]) == same
        assert env.schema.type("box").exogenous == (() if same else ("friction",))


@pytest.mark.parametrize("resample", ["episode", "step"])
def test_a_restored_state_goes_on_exactly(resample: str) -> None:
    env, fresh = TruckPushEnv(resample=resample, task=None), TruckPushEnv(resample=resample, task=None)
    env.reset(seed=0)
    env.step(FULL)
    fresh.set_state(env.get_state())
    for _ in range(20):
        env.step(FULL)
        fresh.step(FULL)
        np.testing.assert_array_equal(fresh.vector, env.vector)


def test_a_scene_alone_determines_what_follows() -> None:
    env, fresh = (TruckPushEnv(n_boxes=5, bystanders=2, task=None) for _ in range(2))
    for seed in range(30):
        env.reset(seed=seed)
        env.step(FULL)
        fresh.set_state(env.scene)
        assert fresh.stacks == env.stacks
        env.step(FULL)
        fresh.step(FULL)
        np.testing.assert_array_equal(fresh.vector, env.vector)


def test_a_scene_torn_apart_is_refused() -> None:
    env = TruckPushEnv(task=None)
    env.reset(seed=0, options={"layout": 4})
    last = env.stacks[-1][0]
    torn = env.scene.replace({(last, "px"): env.scene[last]["px"] + 1.0})
    with pytest.raises(ObservationError, match="touch"):
        env.set_state(torn)


def test_actions_of_other_dtypes_and_slightly_outside() -> None:
    env = TruckPushEnv(task=None)
    for action in (np.array([1.0]), np.array([1.0 + 1e-7], dtype=np.float64), [1.0], FULL):
        env.reset(seed=0)
        env.step(action)
        reached = speed(env)
        env.reset(seed=0)
        env.step(FULL)
        assert speed(env) == reached


@pytest.mark.parametrize("action", [np.array([1.001]), np.array([np.nan]), np.array([0.0, 0.0]), 0.5])
def test_actions_outside_are_refused(action: Any) -> None:
    env = TruckPushEnv(task=None)
    env.reset(seed=0)
    before = env.vector
    with pytest.raises(ActionError, match="expected an action of shape"):
        env.step(action)
    np.testing.assert_array_equal(env.vector, before)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_boxes": 0}, "n_boxes=0"),
        ({"bystanders": -1}, "bystanders=-1"),
        ({"resample": "never"}, "'never'"),
        ({"task": "fly"}, "task='fly'"),
        ({"force_range": (-5.0, 5.0)}, "force_range"),
        ({"friction_range": (0.5, 0.1)}, "friction_range"),
        ({"gravity": -1.0}, "gravity=-1"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        TruckPushEnv(**arguments)


@pytest.mark.parametrize(
    ("options", "message"),
    [({"layout": 5}, "'layout'"), ({"order": ("box1",)}, "'order'"), ({"wind": 1}, "wind")],
)
def test_bad_options_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        TruckPushEnv(task=None).reset(seed=0, options=options)


def test_the_schema_declares_the_action_in_physical_units() -> None:
    schema = TruckPushEnv(force_range=(100.0, 300.0), task=None).schema
    assert schema.order[-1] == "action"
    assert schema.action_scale == (("force", 100.0, 300.0),)
    assert not schema.type("action").has_body
    assert [str(target) for target in schema.targets or ()] == ["truck.vx", "box.px"]
