from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.envs.ball_box_ramp import BallBoxRampEnv, configurations
from relgym.envs.physics import Contact
from relgym.errors import ActionError, ConfigError, ObservationError
from relgym.scene.objects import Scene

QUIET = {"shift_x": 0.0, "shift_y": 0.0, "ball_radius": 0.1, "room_width": 6.0, "room_height": 3.0}


def run(env: BallBoxRampEnv, steps: int) -> np.ndarray:
    rows = [env.vector]
    for _ in range(steps):
        env.step(0)
        rows.append(env.vector)
    return np.stack(rows)


def column(env: BallBoxRampEnv, name: str, prop: str) -> int:
    layout = env.schema.layout()
    return layout.column(layout.index(name), prop)


def edges(scene: Scene, name: str) -> tuple[float, float]:
    o = scene[name]
    return o["px"] - o["sx"] / 2, o["px"] + o["sx"] / 2


def first_contact(env: BallBoxRampEnv) -> Contact:
    while not env.contacts:
        env.step(0)
    return env.contacts[0]


def test_there_are_40_configurations() -> None:
    assert len(configurations()) == 40
    assert len({tuple(sorted(c.items())) for c in configurations()}) == 40


@pytest.mark.parametrize("options", configurations(), ids=lambda c: "-".join(map(str, c.values())))
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_configuration_is_as_asked(options: Mapping[str, Any], seed: int) -> None:
    env = BallBoxRampEnv()
    _, info = env.reset(seed=seed, options=dict(options))
    scene, ball = info["scene"], info["scene"]["ball"]
    left, right = ("ramp", "box") if options["ramp"] == "left" else ("box", "ramp")
    (l0, l1), (r0, r1) = edges(scene, left), edges(scene, right)
    radius = ball["sx"] / 2
    if options["touching"]:
        assert abs(r0 - l1) < 1e-12
    else:
        assert 4 * radius - 1e-12 <= r0 - l1 <= 8 * radius + 1e-12
    assert (ball["vx"] > 0) == (options["direction"] == "right")
    x, bottom = ball["px"], ball["py"] - radius
    floor = scene["floor"]["py"] + scene["floor"]["sy"] / 2
    tops = {name: scene[name]["py"] + scene[name]["sy"] / 2 for name in (left, right)}
    on_floor = -0.010 - 1e-12 <= bottom - floor <= -0.001 + 1e-12
    match options["ball"]:
        case "leftmost":
            assert on_floor and x < l0
        case "rightmost":
            assert on_floor and x > r1
        case "above-left":
            assert l0 <= x <= l1 and 0.1 - 1e-12 <= bottom - tops[left] <= 0.8 + 1e-12
        case "above-right":
            assert r0 <= x <= r1 and 0.1 - 1e-12 <= bottom - tops[right] <= 0.8 + 1e-12
        case "between":
            assert l1 - radius <= x <= r0 + radius
            assert (on_floor and not options["touching"]) or 0.05 <= bottom - max(tops.values()) <= 0.6


def test_sizes_follow_the_documented_distribution() -> None:
    env = BallBoxRampEnv(incline=60)
    for seed in range(50):
        scene = env.reset(seed=seed)[1]["scene"]
        width = edges(scene, "right_wall")[0] - edges(scene, "left_wall")[1]
        assert 4.5 - 1e-9 <= width <= 6 + 1e-9
        assert 2.5 <= scene["left_wall"]["sy"] <= 3.5
        assert 0.16 <= scene["ball"]["sx"] <= 0.3
        assert 0.6 <= scene["box"]["sx"] <= 1.0 and 0.4 <= scene["box"]["sy"] <= 0.9
        assert scene["ramp"]["sx"] <= 1.5 and scene["ramp"]["sy"] <= 1.0 + 1e-12
        slope = scene["ramp"]["sy"] / scene["ramp"]["sx"]
        assert math.isclose(slope, math.tan(math.radians(60)), rel_tol=1e-12)
        assert scene["floor"]["sy"] == scene["left_wall"]["sx"] == 0.5


@given(st.integers(0, 10**6))
def test_the_drawn_configuration_gives_the_same_scene_again(seed: int) -> None:
    env = BallBoxRampEnv()
    _, info = env.reset(seed=seed)
    _, again = env.reset(seed=seed + 1, options=info["configuration"])
    assert again["scene"] == info["scene"]
    assert again["configuration"] == info["configuration"]


def test_an_option_changes_nothing_else() -> None:
    env = BallBoxRampEnv()
    asked = {"touching": True, "ball": "above-left"}
    one = env.reset(seed=4, options={**asked, "direction": "left"})[1]["configuration"]
    other = env.reset(seed=4, options={**asked, "direction": "right"})[1]["configuration"]
    assert {k: v for k, v in one.items() if v != other[k]} == {"direction": "left"}


def test_same_seed_same_episode_and_other_seed_another() -> None:
    env = BallBoxRampEnv()
    env.reset(seed=7)
    first = run(env, 200)
    env.reset(seed=7)
    np.testing.assert_array_equal(run(env, 200), first)
    env.reset(seed=8)
    assert not np.array_equal(run(env, 1)[0], first[0])


def test_first_velocity_is_the_last_displacement() -> None:
    env = BallBoxRampEnv()
    env.reset(seed=0, options={"ball": "above-left", "ball_speed": 3.0, "direction": "right"})
    rows = run(env, 1)
    vx, vy, px, py = (column(env, "ball", p) for p in ("vx", "vy", "px", "py"))
    np.testing.assert_allclose(rows[0, [vx, vy]], [0.03, 0.0], atol=1e-14)
    # Free flight: the law holds from the first step on.
    np.testing.assert_allclose(rows[1, [vx, vy]], [0.03, -9.8e-4], atol=1e-14)
    np.testing.assert_allclose(rows[1, [px, py]] - rows[0, [px, py]], rows[1, [vx, vy]], atol=0)


def test_a_shifted_scene_moves_alike() -> None:
    # R2; 1.1e-12 was measured over 200 steps for shifts by 5.
    env = BallBoxRampEnv(incline=45, elasticity=0.95, friction=0.2)
    _, info = env.reset(seed=3, options={"shift_x": 0.0, "shift_y": 0.0})
    here = run(env, 200)
    env.reset(options={**info["configuration"], "shift_x": 5.0, "shift_y": -5.0})
    there = run(env, 200)
    moved = [column(env, "ball", p) for p in ("px", "py")]
    np.testing.assert_allclose(there[:, moved] - here[:, moved], np.tile([5.0, -5.0], (201, 1)), atol=1e-11)


def test_hand_worked_contacts_on_floor_ramp_and_corner() -> None:
    env = BallBoxRampEnv()
    base = {**QUIET, "ramp": "right", "touching": False, "direction": "right"}
    env.reset(seed=0, options={**base, "ball": "leftmost", "ball_sink": 0.005})
    (floor,) = env.contacts
    assert (floor.other, floor.normal, floor.corner) == ("floor", (0.0, 1.0), False)
    assert floor.depth == pytest.approx(0.005, abs=1e-14)
    assert floor.impulse == pytest.approx(9.8e-4, abs=1e-15)

    falling = {**base, "ball_speed": 0.0, "ball_drop": 0.1}
    env.reset(options={**falling, "ball": "above-right", "ball_x": 0.5})
    slope = first_contact(env)
    assert (slope.other, slope.corner) == ("ramp", False)
    np.testing.assert_allclose(slope.normal, (0.5, math.cos(math.radians(30))), atol=1e-12)

    # Falling from 0.1 over the box's right edge at 0.5 units/s: it meets the corner from the right.
    env.reset(options={**falling, "ball": "above-left", "ball_x": 1.0, "ball_speed": 0.5})
    corner = first_contact(env)
    box = env.scene["box"]
    across = env.scene["ball"]["px"] - (box["px"] + box["sx"] / 2)
    assert (corner.other, corner.corner) == ("box", True)
    assert 0.05 < across < 0.1
    np.testing.assert_allclose(corner.normal[0], across / (0.1 - corner.depth), atol=1e-12)


def test_a_state_of_six_balls_goes_on_in_a_fresh_env() -> None:
    # Contacts of several moving bodies leave hidden state in an engine with other settings (1e-4).
    made: dict[str, Any] = {"balls": 6, "objects": ("box", "ramp", "ramp"), "friction": 0.1}
    env, fresh = BallBoxRampEnv(**made), BallBoxRampEnv(**made)
    touched = 0
    for seed in range(3):
        env.reset(seed=seed)
        for _ in range(200):
            state = env.get_state()
            touched += any(c.other.startswith("ball") for c in env.contacts)
            env.step(0)
            fresh.set_state(state)
            fresh.step(0)
            np.testing.assert_allclose(fresh.vector, env.vector, rtol=0, atol=1e-12)
    assert touched > 10


def test_a_restored_state_is_exact_and_keeps_its_contacts() -> None:
    env, fresh = BallBoxRampEnv(), BallBoxRampEnv()
    env.reset(seed=0, options={"ball": "leftmost"})
    run(env, 20)
    observation = fresh.set_state(env.get_state())
    np.testing.assert_array_equal(fresh.vector, env.vector)
    assert [c.other for c in fresh.contacts] == [c.other for c in env.contacts]
    np.testing.assert_array_equal(observation["ball"], env.vector[env.schema.layout().slice(0)])
    np.testing.assert_allclose(run(fresh, 100), run(env, 100), rtol=0, atol=1e-12)


def test_a_scene_alone_determines_what_follows() -> None:
    env, fresh = BallBoxRampEnv(), BallBoxRampEnv()
    env.reset(seed=5)
    for _ in range(200):
        fresh.set_state(env.scene)
        env.step(0)
        fresh.step(0)
        np.testing.assert_allclose(fresh.vector, env.vector, rtol=0, atol=1e-12)


def test_foreign_states_are_refused() -> None:
    env, other = BallBoxRampEnv(), BallBoxRampEnv(objects=("box",))
    env.reset(seed=0)
    other.reset(seed=0)
    with pytest.raises(ObservationError, match="arguments"):
        env.set_state(other.get_state())
    with pytest.raises(ObservationError, match=r"\['ramp'\]"):
        env.set_state(other.scene)


@pytest.mark.parametrize(
    ("objects", "names"),
    [
        (("box",), ["box"]),
        (("ramp",), ["ramp"]),
        (("box", "ramp", "ramp"), ["box", "ramp", "ramp2"]),
        ({"ramp": 2, "box": 3}, ["ramp", "ramp2", "box", "box2", "box3"]),
        ((), []),
    ],
)
def test_objects_are_chosen(objects: Any, names: list[str]) -> None:
    env = BallBoxRampEnv(objects=objects, balls=2)
    assert env.schema.order == ("ball", "ball2", *names, "floor", "ceiling", "left_wall", "right_wall")
    for seed in range(10):
        _, info = env.reset(seed=seed)
        assert env.observation_space.contains({n: np.asarray(v) for n, v in info["scene"].values().items()})
        assert set(info["configuration"]) <= set(env.reset_options)
    run(env, 50)


def test_thesis_type_names_carry_the_coefficients() -> None:
    env = BallBoxRampEnv(incline=60, elasticity=0.8, friction={"ramp": 0.3, "box": 0.1}, type_names="thesis")
    ramp, box = env.schema.type_of("ramp"), env.schema.type_of("box")
    assert (ramp.name, ramp.parent) == ("ramp_0.3_0.8_60", "ramp")  # the thesis' own example (§4.2)
    assert (box.name, box.parent) == ("box_0.1_0.8", "box")
    assert env.schema.type_of("ball").name == "ball"


def test_coefficients_are_per_object() -> None:
    env = BallBoxRampEnv(elasticity={"floor": 0.5, "wall": 1.0}, objects=())
    env.reset(seed=0, options={**QUIET, "ball": "rightmost", "direction": "right", "ball_sink": 0.005})
    speeds = run(env, 100)[:, column(env, "ball", "vx")]
    np.testing.assert_allclose(speeds[-1], -speeds[0], atol=1e-14)  # the wall gives everything back


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"objects": ("cone",)}, "cone"),
        ({"objects": "box"}, "sequence"),
        ({"balls": 0}, "balls=0"),
        ({"incline": 90}, "incline=90"),
        ({"elasticity": 1.5}, "elasticity=1.5"),
        ({"friction": {"roof": 0.1}}, "roof"),
        ({"type_names": "long"}, "'long'"),
        ({"render_mode": "ascii"}, "ascii"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        BallBoxRampEnv(**arguments)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"ramps": "left"}, r"\['ramps'\]; this env has .*'ramp'"),
        ({"ramp": "middle"}, r"'ramp': expected one of \['left', 'right'\]"),
        ({"ball_radius": 5.0}, "'ball_radius': expected 0.01 to 1.0"),
        ({"ball_radius": "big"}, "'ball_radius': expected a finite number"),
        ({"room_width": 1.0}, "no room"),
    ],
)
def test_bad_options_are_named_and_change_nothing(options: dict[str, Any], message: str) -> None:
    env = BallBoxRampEnv()
    env.reset(seed=0)
    before = env.vector
    with pytest.raises(ConfigError, match=message):
        env.reset(options=options)
    np.testing.assert_array_equal(env.vector, before)
    env.step(0)


def test_there_is_one_action() -> None:
    env = BallBoxRampEnv()
    env.reset(seed=0)
    with pytest.raises(ActionError, match="Discrete"):
        env.step(1)
