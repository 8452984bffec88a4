"""How scenes are lined up into regression columns."""

from __future__ import annotations

from relgym.clustering.columns import SlotSignature, slot_order
from relgym.scene.objects import ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere

BALL = ObjectType("ball", ("px", "vx", "mass"), Sphere())
WALL = ObjectType("wall", ("px", "friction"), Box())
ACTION = ObjectType("action", ("force",))
SCHEMA = SceneSchema(
    (BALL, WALL, ACTION), (("w", "wall"), ("a", "ball"), ("action", "action"), ("b", "ball"))
)


def names(signature: SlotSignature, chosen: list[int]) -> list[str]:
    return [f"{signature.columns[k].slot}.{signature.columns[k].property}" for k in chosen]


def test_own_properties_come_first_then_actions_then_poses() -> None:
    signature = SlotSignature((BALL, ACTION, WALL))
    columns = names(signature, list(range(len(signature.columns))))
    assert columns == ["0.vx", "0.mass", "1.force", "0.px", "2.friction", "2.px"]
    assert signature.core == 4


def test_stages_grow_from_own_to_others_to_poses() -> None:
    signature = SlotSignature((BALL, ACTION, WALL))
    order, stages = signature.preference(Target("ball", "mass"))
    assert names(signature, order.tolist()) == ["0.mass", "0.vx", "1.force", "2.friction", "0.px", "2.px"]
    assert stages == (3, 4, 6)


def test_next_values_are_columns_only_where_they_are_given() -> None:
    signature = SlotSignature((BALL, BALL, WALL), (("ball", "vx"),))
    plain, _ = signature.preference(Target("ball", "mass"))
    given, _ = signature.preference(Target("ball", "px", (("ball", "vx"),)))
    assert not [n for n in names(signature, plain.tolist()) if n.endswith("'")]
    assert [n for n in names(signature, given.tolist()) if n.endswith("'")] == ["0.vx'", "1.vx'"]


def test_gathering_reads_present_and_next_values() -> None:
    layout = SCHEMA.layout()
    signature = SlotSignature((BALL, ACTION, BALL, WALL), (("ball", "vx"),))
    order = slot_order(layout, 1, (3, 0))
    assert order == (1, 2, 3, 0)
    # State vector: w.px w.friction | a.px a.vx a.mass | force | b.px b.vx b.mass; then all of them primed.
    values = dict(
        zip(
            names(signature, list(range(len(signature.columns)))),
            signature.gather(layout, order).tolist(),
            strict=True,
        )
    )
    assert values["0.vx"] == 3
    assert values["0.vx'"] == 9 + 3
    assert values["1.force"] == 5
    assert values["2.mass"] == 8
    assert values["2.vx'"] == 9 + 7
    assert values["3.friction"] == 1


def test_bodiless_objects_stand_before_bodies_in_order_of_their_type() -> None:
    task = ObjectType("task", ("reward",))
    schema = SceneSchema(
        (BALL, ACTION, task), (("t", "task"), ("a", "ball"), ("action", "action"), ("b", "ball"))
    )
    assert slot_order(schema.layout(), 1, (3,)) == (1, 2, 0, 3)
    assert slot_order(schema.layout(), 0, (1, 3)) == (0, 2, 1, 3)


def test_slots_by_type_leave_the_target_out() -> None:
    signature = SlotSignature((BALL, ACTION, BALL, WALL, BALL))
    assert signature.slots_by_type == {"action": (1,), "ball": (2, 4), "wall": (3,)}
    assert signature.singleton(3)
    assert not signature.singleton(2)


def test_what_never_changes_is_tried_last_for_what_a_step_is_worth() -> None:
    moving, still, task = (
        ObjectType("now", ("x",)),
        ObjectType("still", ("size",)),
        ObjectType("task", ("reward",)),
    )
    signature = SlotSignature((task, moving, still))
    order, stages = signature.preference(Target("task", "reward"))
    assert names(signature, order.tolist()) == ["1.x", "2.size"] and stages == (1, 2)
    assert signature.core == len(signature.columns)  # conditions may speak of it all the same
    elsewhere = SlotSignature((ObjectType("ball", ("v",)), still))
    assert elsewhere.preference(Target("ball", "v"))[1] == (2,)
