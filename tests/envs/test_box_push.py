"""BoxPush: hand-worked rewards, what is drawn, and that its task can be done."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest

import relgym  # noqa: F401  (registers the ids)
from relgym.envs.box_goal import DeliverTask
from relgym.envs.box_push import HALF, SPEED, BoxPushEnv
from relgym.envs.physics import TIME_STEP
from relgym.envs.scripted import deliver
from relgym.errors import ConfigError


def successes(seeds: range, **arguments: object) -> float:
    env = gym.make("relgym/BoxPush-v0", **arguments)
    done = []
    for seed in seeds:
        env.reset(seed=seed)
        action, step, over = np.zeros(2, dtype=np.float32), 0, False
        while not over:
            if step % 10 == 0:
                action = deliver(env.get_wrapper_attr("scene"))
            _, _, terminated, truncated, info = env.step(action)
            step, over = step + 1, terminated or truncated
        done.append(info["is_success"])
    return float(np.mean(done))


@pytest.mark.parametrize("arguments", [{}, {"parcel": "tee"}, {"n_boxes": 4, "friction": 0.6}])
def test_the_task_can_be_done(arguments: dict[str, object]) -> None:
    assert successes(range(100, 106), **arguments) >= 0.83


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [{}, {"parcel": "tee"}, {"n_boxes": 4}])
def test_the_script_does_it_nearly_always(arguments: dict[str, object]) -> None:
    assert successes(range(1_000, 1_100), **arguments) >= 0.95


def test_hand_worked_rewards() -> None:
    env = BoxPushEnv(n_boxes=1)
    env.reset(seed=0)
    before = env.scene
    name = ("goal", "dx")
    after = before.replace({name: before["goal"]["dx"] - 0.01, ("goal", "dy"): before["goal"]["dy"]})
    way = abs(before["goal"]["dx"]) - abs(after["goal"]["dx"])
    assert DeliverTask().reward(before, np.zeros(2), after) == pytest.approx(way - 0.001)
    there = before.replace({name: 0.1, ("goal", "dy"): -0.1})
    far = before.replace({name: 1.1, ("goal", "dy"): -0.1})
    assert DeliverTask().reward(far, np.zeros(2), there) == pytest.approx(1.0 - 0.001 + 2.0)
    assert DeliverTask().terminated(far, np.zeros(2), there)
    assert not DeliverTask().terminated(there, np.zeros(2), far)


def test_the_pusher_has_the_velocity_that_is_asked_for() -> None:
    env = BoxPushEnv(n_boxes=0)
    env.reset(seed=1)
    env.step(np.array([0.5, -0.25], dtype=np.float32))
    scene = env.scene
    assert scene["pusher"]["vx"] == pytest.approx(0.5 * SPEED, abs=1e-12)
    assert scene["pusher"]["vy"] == pytest.approx(-0.25 * SPEED, abs=1e-12)


def test_as_many_boxes_as_are_asked_for_lie_on_the_table() -> None:
    env = BoxPushEnv(n_boxes=3)
    for count in range(4):
        env.reset(seed=count, options={"count": count})
        inside = [abs(env.scene[f"box{k}"]["px"]) < HALF for k in (1, 2, 3)]
        assert sum(inside) == count
    counts = {env.reset(seed=seed)[1]["configuration"]["count"] for seed in range(20)}
    assert counts == {0, 1, 2, 3}


def test_configurations_repeat_scenes() -> None:
    env = BoxPushEnv()
    _, info = env.reset(seed=5)
    again, _ = BoxPushEnv().reset(seed=5, options=info["configuration"])
    assert all(np.array_equal(again[o.name], o.values) for o in info["scene"])


def test_wrong_arguments() -> None:
    with pytest.raises(ConfigError, match=r"parcel='cube': expected one of \['box', 'tee'\]"):
        BoxPushEnv(parcel="cube")
    with pytest.raises(ConfigError, match="no room on the table for 10 boxes"):
        sizes = {f"box{k}_{s}": 0.8 for k in range(1, 11) for s in ("width", "height")}
        BoxPushEnv(n_boxes=10).reset(seed=0, options={"count": 10, **sizes})


# ---------------------------------------------------------------------- contacts by hand, without friction
DIAMETER, LENGTH, HEIGHT = 0.2, 0.4, 0.3
DISC, PARCEL = math.pi * DIAMETER**2 / 4.0, LENGTH * HEIGHT
"""Masses: bodies are of one density."""
TOUCHING = -0.3
"""Where a pusher on its left just touches a parcel at the origin: -(LENGTH + DIAMETER) / 2."""
TURNING = PARCEL * (LENGTH**2 + HEIGHT**2) / 12.0
KEPT = 0.02**TIME_STEP
"""What the table leaves of a velocity after a step."""


def laid(**places: float) -> BoxPushEnv:
    """A pusher at (-0.5, 0) and a parcel at the origin, at rest, unless other numbers are given: ``parcel__vx=0.1``."""
    env = BoxPushEnv(n_boxes=0, friction=0.0)
    sizes = {"pusher_size": DIAMETER, "parcel_width": LENGTH, "parcel_height": HEIGHT}
    env.reset(seed=0, options=sizes)
    usual = {
        f"{body}__{name}": 0.0
        for body in ("pusher", "parcel")
        for name in ("px", "py", "rz", "vx", "vy", "spin")
    }
    usual |= {"pusher__px": -0.5, "goal__dx": 1.0, "goal__dy": 0.0} | places
    env.set_state(env.scene.replace({tuple(name.split("__")): value for name, value in usual.items()}))  # type: ignore[misc]
    return env


def moved(env: BoxPushEnv, x: float = 0.0, y: float = 0.0) -> dict[str, tuple[float, float, float]]:
    """Velocities and spins after one step of an action."""
    env.step(np.array([x, y], dtype=np.float32))
    return {name: tuple(env.scene[name][p] for p in ("vx", "vy", "spin")) for name in ("pusher", "parcel")}  # type: ignore[misc]


def test_what_nothing_touches_is_slowed_down_by_the_table_alone() -> None:
    env = laid(parcel__vx=0.01, parcel__vy=-0.004, parcel__spin=0.02)
    for k in (1, 2, 3):
        found = moved(env, 0.0, 0.5)
        assert found["parcel"] == pytest.approx((0.01 * KEPT**k, -0.004 * KEPT**k, 0.02 * KEPT**k), abs=1e-12)
        assert found["pusher"] == pytest.approx((0.0, 0.5 * SPEED, 0.0), abs=1e-12)
    assert env.scene["parcel"]["px"] == pytest.approx(0.01 * (KEPT + KEPT**2 + KEPT**3), abs=1e-12)
    assert env.scene["parcel"]["rz"] == pytest.approx(0.02 * (KEPT + KEPT**2 + KEPT**3), abs=1e-12)


def test_a_push_through_the_centre_shares_the_momentum() -> None:
    """No bounce: both go on at the velocity of their centre of mass, step by step faster."""
    env = laid(pusher__px=TOUCHING)
    speed = 0.0
    for _ in range(4):
        speed = (DISC * SPEED + PARCEL * speed * KEPT) / (DISC + PARCEL)
        found = moved(env, 1.0)
        assert found["pusher"] == pytest.approx((speed, 0.0, 0.0), abs=1e-9)
        assert found["parcel"] == pytest.approx((speed, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("arm", [-0.1, 0.05, 0.1])
def test_a_push_beside_the_centre_turns(arm: float) -> None:
    """The impulse that takes the velocity of approach: speed / (1 / m + 1 / M + arm^2 / I)."""
    env = laid(pusher__px=TOUCHING, pusher__py=arm)
    impulse = SPEED / (1.0 / DISC + 1.0 / PARCEL + arm**2 / TURNING)
    found = moved(env, 1.0)
    assert found["pusher"][:2] == pytest.approx((SPEED - impulse / DISC, 0.0), abs=1e-9)
    assert found["parcel"] == pytest.approx((impulse / PARCEL, 0.0, -arm * impulse / TURNING), abs=1e-9)
    # The parcel's face goes as fast as the pusher where they touch.
    assert found["parcel"][0] - found["parcel"][2] * arm == pytest.approx(found["pusher"][0], abs=1e-9)


def test_without_friction_nothing_is_dragged_along() -> None:
    env = laid(pusher__px=TOUCHING)
    found = moved(env, 0.0, 1.0)
    assert found["pusher"] == pytest.approx((0.0, SPEED, 0.0), abs=1e-9)
    assert found["parcel"] == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_who_touches_is_told() -> None:
    env = laid(pusher__px=TOUCHING)
    *_, info = env.step(np.array([1.0, 0.0], dtype=np.float32))
    assert info["touching"] == (("pusher", "parcel"),)
    *_, info = laid().step(np.array([0.5, 0.0], dtype=np.float32))
    assert info["touching"] == ()


def test_the_way_to_the_goal_follows_the_parcel() -> None:
    env = laid(parcel__vx=0.01, parcel__vy=-0.004)
    moved(env)
    found = env.scene["goal"]["dx"], env.scene["goal"]["dy"]
    assert found == pytest.approx((1.0 - 0.01 * KEPT, 0.004 * KEPT), abs=1e-12)
