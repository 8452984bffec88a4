"""What the learners see of scenes: rows, relations and numbers, the same alone and in a batch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from worlds import ROOM_TARGETS, Raw, room, scene, schema_of

from relgym.model.percepts.perception import Percept, Perception
from relgym.scene.objects import ObjectType, Scene
from relgym.scene.schema import SceneSchema
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


def test_gaps_are_told_of_all_pairs_where_they_are_asked_for() -> None:
    schema = replace(SCHEMA, offsets=True)
    ball, bodies = schema.layout().index("ball"), schema.layout().bodies
    right = bodies.index(schema.layout().index("right"))
    percept = Perception(schema, ()).percept(schema.layout(), world().vector[None])
    names = percept.perception.vocabulary(BALL).pair
    numbers = dict(zip(names, percept.situation(ball).examples.pair[0, right].tolist(), strict=True))
    assert numbers["distance"] == pytest.approx(3.0)
    assert numbers["approach"] == pytest.approx(0.02)
    assert (numbers["offset-x"], numbers["offset-y"]) == (-4.0, 0.0)
    assert np.isnan(numbers["normal-x"]) and np.isnan(numbers["slip"])
    percept = looked(world())
    plain = dict(zip(names, percept.situation(ball).examples.pair[0, right].tolist(), strict=False))
    assert np.isnan(plain["distance"]) and np.isnan(plain["approach"])


def squeezed(vx: float) -> Scene:
    """The ball touches both boxes and moves along the row."""
    return world().replace({("right", "px"): 0.995, ("ball", "vx"): vx})


@pytest.mark.parametrize(("vx", "met", "left"), [(-0.02, "left", "right"), (0.02, "right", "left")])
def test_of_a_contact_that_is_being_left_only_that_is_said(vx: float, met: str, left: str) -> None:
    percept = looked(squeezed(vx))
    example = percept.situation(SCHEMA.layout().index("ball")).examples
    names = percept.perception.vocabulary(BALL).pair
    place = {n: SCHEMA.layout().bodies.index(SCHEMA.layout().index(n)) for n in (met, left)}
    numbers = {n: dict(zip(names, example.pair[0, k].tolist(), strict=True)) for n, k in place.items()}
    assert numbers[met]["approach"] == pytest.approx(-0.02)
    assert abs(numbers[met]["normal-x"]) == 1.0 and numbers[met]["distance"] == pytest.approx(-0.005)
    assert numbers[left]["approach"] == pytest.approx(0.02)
    assert all(np.isnan(numbers[left][name]) for name in ("normal-x", "normal-y", "distance", "slip"))


def test_what_the_target_leaves_is_not_close_while_it_touches_something_else() -> None:
    ball, left, right = (SCHEMA.layout().index(n) for n in ("ball", "left", "right"))
    bodies = SCHEMA.layout().bodies

    def close(scene: Scene, parting: bool = True) -> set[int]:
        percept = Perception(SCHEMA, parting=parting).percept(scene.layout, scene.vector[None])
        return {bodies[k] for k in np.flatnonzero(percept.situation(ball).examples.close[0])}

    assert close(squeezed(-0.02)) == {ball, left}
    assert close(squeezed(0.02)) == {ball, right}
    assert close(squeezed(-0.02), parting=False) == {ball, left, right}
    leaving = world().replace({("ball", "vx"): 0.02})
    assert close(leaving) == {ball, left}  # nothing else is touched


def test_what_is_approached_fastest_is_the_narrowest_context() -> None:
    ball, left, right = (SCHEMA.layout().index(n) for n in ("ball", "left", "right"))
    bodies = SCHEMA.layout().bodies

    def struck(scene: Scene, parting: bool = True) -> set[int]:
        percept = Perception(SCHEMA, parting=parting).percept(scene.layout, scene.vector[None])
        return {bodies[k] for k in np.flatnonzero(percept.situation(ball).examples.struck[0])}

    assert struck(squeezed(-0.02)) == {ball, left}
    assert struck(squeezed(0.02)) == {ball, right}
    assert struck(squeezed(0.0)) == {ball, left, right}  # none faster than the other
    assert struck(world().replace({("ball", "vx"): 0.02})) == {ball}  # it touches one body, and leaves it
    # without contact facts there is no such context: as close
    assert struck(squeezed(-0.02), parting=False) == {ball, left, right}


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
