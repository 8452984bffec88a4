"""What the learners see of scenes: rows, relations and numbers, the same alone and in a batch."""

from __future__ import annotations

import numpy as np
from worlds import ROOM_TARGETS, Raw, room, scene, schema_of

from relgym.model.perception import Percept, Perception
from relgym.scene.objects import ObjectType, Scene, SceneSchema
from relgym.scene.shapes import Box, Sphere

BALL = ObjectType("ball", ("px", "py", "vx", "mass"), Sphere(), velocity=("vx", None, None))
BOX = ObjectType("box", ("px", "py", "friction"), Box())
ACTION = ObjectType("action", ("force",))
SCHEMA = SceneSchema(
    (BALL, BOX, ACTION),
    (("left", "box"), ("ball", "ball"), ("action", "action"), ("right", "box")),
)


def looked(scene: Scene, given: tuple[tuple[str, str], ...] = ()) -> Percept:
    return Perception(scene.schema, given).percept(scene.layout, scene.vector[None])


def world(ball: float = 0.0) -> Scene:
    """A ball of diameter 1 between two boxes of width 1, the left one touching it."""
    return SCHEMA.scene(
        {
            "left": [-0.995, 0.0, 0.1],
            "ball": [ball, 0.0, -0.02, 5.0],
            "action": [3.0],
            "right": [4.0, 0.0, 0.9],
        }
    )


def test_a_row_lines_up_own_properties_actions_and_others_as_they_touch() -> None:
    percept = looked(world())
    ball = SCHEMA.layout().index("ball")
    place = percept.situation(ball)
    columns = [f"{c.slot}.{c.property}" for c in place.signature.columns]
    row = dict(zip(columns, percept.rows(ball, world().vector[None])[0].tolist(), strict=True))
    assert row["0.vx"] == -0.02
    assert row["0.mass"] == 5.0
    assert row["1.force"] == 3.0
    assert row["2.friction"] == 0.1  # the box that touches the ball leads
    assert row["3.friction"] == 0.9
    assert columns.index("0.vx") < columns.index("1.force") < columns.index("2.friction")


def test_given_next_values_are_read_from_the_scene_that_follows() -> None:
    percept = looked(world(), given=(("ball", "vx"),))
    box = SCHEMA.layout().index("right")
    signature = percept.situation(box).signature
    following = world().replace({("ball", "vx"): 0.7}).vector
    columns = [c.property for c in signature.columns]
    assert percept.rows(box, following[None])[0, columns.index("vx'")] == 0.7


def test_contact_facts_are_facts_of_touching_pairs() -> None:
    percept = looked(world())
    example = percept.situation(SCHEMA.layout().index("ball")).examples
    names = percept.perception.vocabulary(BALL).pair
    contact = [k for k, name in enumerate(names) if name.startswith("normal")]
    left, right = (SCHEMA.layout().bodies.index(SCHEMA.layout().index(n)) for n in ("left", "right"))
    assert np.isfinite(example.pair[0, left][contact]).all()
    assert np.isnan(example.pair[0, right][contact]).all()


def test_positions_are_no_numbers_for_thresholds() -> None:
    vocabulary = looked(world()).perception.vocabulary(BALL)
    assert set(vocabulary.own) == {"vx", "mass", "action.force"}
    assert not {"px", "py"} & {*vocabulary.own, *vocabulary.pair}
    assert {"vx", "mass", "friction"} <= {name.removeprefix("other-") for name in vocabulary.pair}


def test_an_object_without_a_body_stands_alone() -> None:
    place = looked(world()).situation(SCHEMA.layout().index("action"))
    assert place.examples.table.shape[2:] == (1, 1)
    assert not place.examples.table.any()
    assert place.signature.types[0] is ACTION


def test_a_batch_gives_the_rows_and_keys_of_its_scenes() -> None:
    steps = room(0, 60)
    schema = schema_of(steps, ROOM_TARGETS)
    scenes = [scene(schema, before) for before, _ in steps]
    layout, vectors = scenes[0].layout, np.stack([s.vector for s in scenes])
    perception = Perception(schema)
    many = perception.percept(layout, vectors)
    ball = layout.index("ball0")
    rows = many.rows(ball, vectors)
    for k, each in enumerate(scenes):
        one = perception.percept(layout, each.vector[None])
        assert one.rows(ball, each.vector[None])[0].tobytes() == rows[k].tobytes()
        assert one.situation(ball).keys[0] == many.situation(ball).keys[k]
        alone, among = one.situation(ball).examples[0], many.situation(ball).examples[k]
        assert (alone.table == among.table).all()
        assert np.array_equal(alone.pair, among.pair, equal_nan=True)
        assert np.array_equal(alone.own, among.own, equal_nan=True)


def test_exchanging_boxes_changes_no_row() -> None:
    raw: Raw = room(0, 1)[0][0]
    swapped = raw | {"box0": raw["box1"], "box1": raw["box0"]}
    schema = schema_of(room(0, 1), ROOM_TARGETS)
    rows, keys = [], []
    for each in (raw, swapped):
        whole = scene(schema, each)
        percept = looked(whole)
        ball = whole.layout.index("ball0")
        rows.append(percept.rows(ball, whole.vector[None])[0].tolist())
        keys.append(percept.situation(ball).keys)
    assert rows[0] == rows[1]
    assert keys[0] == keys[1]
