from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.envs.ball_box_ramp import BallBoxRampEnv
from relgym.envs.flat import LIMIT, FlatSpec, Flattener
from relgym.envs.truck_push import TruckPushEnv
from relgym.errors import ConfigError
from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box

CAR = ObjectType("car", ("x", "y", "length", "speed"), Box(), pose={"px": "x", "py": "y", "sx": "length"})
CONE = ObjectType("cone", ("px", "colour"), Box(), optional=True)
ROAD = SceneSchema(
    (CAR, CONE, ObjectType("action", ("pedal",))),
    (("me", "car"), ("you", "car"), ("left", "cone"), ("right", "cone"), ("action", "action")),
)
NEAR = FlatSpec(actor="me", anchor=(0.5, 0, 0), scales={"x": (10.0, 1.0), "speed": (2.0,), "px": (4.0,)})


def test_hand_worked_numbers() -> None:
    flat = Flattener(ROAD, NEAR)
    scene = ROAD.scene({"me": [100, 0, 6, 1], "you": [108, 0, 2, -3], "right": [105, 7]})
    shown = dict(zip(flat.names, flat(scene.layout, scene.vector[None])[0].tolist(), strict=True))
    assert shown == {
        "me.speed/2": 0.5,
        "you.x/10": 0.5,  # 108 - 103, from the front of me
        "you.x": 5.0,
        "you.speed/2": -1.5,
        "left.px/4": 0.0,
        "left": 0.0,
        "right.px/4": 0.5,
        "right": 1.0,
    }


def test_the_action_is_not_shown_and_numbers_are_clipped() -> None:
    flat = Flattener(ROAD, NEAR)
    scene = ROAD.scene({"me": [0, 0, 0, 1e3], "you": [-1e3, 0, 2, 0], "action": [9.0]})
    shown = flat(scene.layout, scene.vector[None])[0]
    assert shown[:2].tolist() == [LIMIT, -LIMIT]
    assert shown.dtype == np.float32 and flat.space.contains(shown)


def test_spare_slots_are_padded_and_masked() -> None:
    flat = Flattener(ROAD, FlatSpec(scales={"speed": (1.0,)}, slots={"car": 4}))
    scene = ROAD.scene({"me": [0, 0, 0, 3], "you": [0, 0, 0, 4]})
    assert flat(scene.layout, scene.vector[None])[0].tolist() == [3, 1, 4, 1, 0, 0, 0, 0, 0, 0]
    assert flat.names == (
        *("me.speed", "me", "you.speed", "you"),
        *("car 1 (spare).speed", "car 1 (spare)", "car 2 (spare).speed", "car 2 (spare)"),
        *("left", "right"),
    )


@pytest.mark.parametrize("bystanders", [0, 2, 7])
def test_vectors_have_the_same_length_whatever_the_number_of_objects(bystanders: int) -> None:
    env = TruckPushEnv(task="push", bystanders=bystanders)
    flat = Flattener(env.schema, replace(env.flat_spec, slots={"box": 10}))
    assert len(flat.names) == 1 + 10 * (4 + 1) + 2
    env.reset(seed=0)
    shown = flat(env.scene.layout, env.vector[None])[0]
    masks = [value for name, value in zip(flat.names, shown.tolist(), strict=True) if "." not in name]
    assert masks == [1.0] * (3 + bystanders) + [0.0] * (7 - bystanders)


def test_an_empty_spec_shows_everything_as_it_is() -> None:
    schema = SceneSchema((CAR,), (("me", "car"),))
    scene = schema.scene({"me": [1, 2, 3, 4]})
    flat = Flattener(schema, FlatSpec())
    assert flat(scene.layout, scene.vector[None])[0].tolist() == [1, 2, 3, 4]


@given(st.integers(0, 10**6), st.floats(-40, 40), st.floats(-4, 4))
def test_where_the_world_lies_means_nothing(seed: int, x: float, y: float) -> None:
    env = TruckPushEnv(task="push", bystanders=1)
    flat = Flattener(env.schema, env.flat_spec)
    views = []
    for shift in ((0.0, 0.0), (x, y)):
        options = dict(zip(("shift_x", "shift_y"), shift, strict=True))
        _, info = env.reset(seed=seed, options={**options, "bystander1_x": 3.0 + shift[0]})
        views.append(flat(env.scene.layout, env.vector[None])[0])
    np.testing.assert_allclose(views[0], views[1], atol=1e-6)
    assert info["scene"].schema is flat.schema


def test_many_scenes_are_flattened_as_one() -> None:
    env = TruckPushEnv(task="push")
    flat = Flattener(env.schema, env.flat_spec)
    vectors = np.stack([env.reset(seed=seed)[1]["scene"].vector for seed in range(20)])
    layout = env.scene.layout
    together = flat(layout, vectors)
    for k in range(20):
        np.testing.assert_array_equal(together[k], flat(layout, vectors[k : k + 1])[0])
    with_action = env.schema.layout()
    wide = np.concatenate([vectors, np.ones((20, 1))], axis=1)
    np.testing.assert_array_equal(flat(with_action, wide), together)
    # Nothing is cut off in what an agent meets but the distance at its finest scale.
    assert flat.names[-1] == "goal.ahead/2"
    assert np.abs(together[:, :-1]).max() < LIMIT


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({"actor": "lorry"}, "actor='lorry'"),
        ({"scales": {"wind": (1.0,)}}, "wind"),
        ({"scales": {"vx": (0.0,)}}, "positive"),
        ({"scales": {"vx": ()}}, "positive"),
        ({"slots": {"floor": 0}}, "floor"),
    ],
)
def test_bad_specs_are_named(spec: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Flattener(BallBoxRampEnv().schema, FlatSpec(**spec))  # type: ignore[arg-type]
