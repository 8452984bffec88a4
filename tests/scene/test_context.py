"""The close set, the canonical order of the other objects, and the keys of relational states."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import random_vectors, schema_of

from relgym.scene import Extractor, canonical_order, signature
from relgym.scene.context import close_set, relations_of
from relgym.scene.objects import poses
from relgym.scene.relations import Relations
from relgym.scene.schema import SceneSchema

KINDS = ("box", "ball", "box", "ramp", "box", "ball", "box")


def stacks(*places: tuple[float, float], names: str = "tabcdef") -> tuple[SceneSchema, Relations]:
    """Boxes of side 1 at these places; the first is a ball of diameter 1, the target."""
    objects = tuple((names[k], "box" if k else "ball") for k in range(len(places)))
    schema = SceneSchema(schema_of(()).types, objects)
    values = {
        name: [x, y, 0, 0, 0, 0, 1, 1, 1, 0, 0, 0] for (name, _), (x, y) in zip(objects, places, strict=True)
    }
    scene = schema.scene(values)
    return schema, Extractor(schema).extract(scene.layout, scene.vector[None])


def test_close_are_all_that_touch() -> None:
    _, found = stacks((0, 0), (1, 0), (0, 5), (-0.9, 0))
    assert found.context(0)[0].tolist() == [True, True, False, True]


def test_close_is_the_single_nearest_where_nothing_touches() -> None:
    _, found = stacks((0, 0), (1.3, 0), (0, 1.2), (-9, 0))
    assert found.context(0)[0].tolist() == [True, False, True, False]


def test_of_several_nearest_the_earliest_is_close() -> None:
    _, found = stacks((0, 0), (3, 0), (1.25, 0), (0, 1.25), (-1.25, 0))
    assert found.context(0)[0].tolist() == [True, False, True, False, False]


def test_scenes_of_a_batch_are_independent() -> None:
    touching = np.array([[False, True, False], [False, False, False]])
    distance = np.array([[np.inf, 0.0, 0.1], [np.inf, 2.0, 1.0]])
    before = touching.copy()
    assert close_set(touching, distance, 0).tolist() == [[True, True, False], [True, False, True]]
    np.testing.assert_array_equal(touching, before)


def test_order_goes_by_contact_then_by_what_is_around_then_by_distance() -> None:
    # c touches the target; a and b are alike to the target, but a carries d.
    _, found = stacks((0, 0), (5, 0), (3, 0), (1, 0), (5, 1))
    first, *rest = canonical_order(found, 0)[0].tolist()
    assert first == 3
    assert sorted(rest) == [1, 2, 4]
    # Nothing tells the two apart but their distance.
    _, found = stacks((0, 0), (8, 0), (3, 0))
    assert canonical_order(found, 0)[0].tolist() == [2, 1]


def test_rounding_does_not_decide_between_equally_far_objects() -> None:
    schema, found = stacks((0, 0), (3, 0), (3, 2e-13))
    pose = poses(schema.layout(), np.zeros((1, schema.layout().width)))
    pose[0, 1:, 0] = 2.0, 1.0
    assert canonical_order(found, 0, pose.__getitem__)[0].tolist() == [2, 1]
    pose[0, 1:, 0] = 1.0, 2.0
    assert canonical_order(found, 0, pose.__getitem__)[0].tolist() == [1, 2]


def test_groups_are_types_in_alphabetical_order() -> None:
    schema = schema_of(KINDS)
    vectors = random_vectors(schema.layout(), 50, np.random.default_rng(0))
    found = Extractor(schema).extract(schema.layout(), vectors)
    order = canonical_order(found, 0)
    kinds = np.array(KINDS)[order]
    assert (kinds == ["ball", "ball", "box", "box", "box", "ramp"]).all()
    assert (np.sort(order, axis=1) == np.arange(1, 7)).all()


def test_order_and_key_do_not_depend_on_names_numbers_or_company() -> None:
    rng = np.random.default_rng(1)
    schema = schema_of(KINDS)
    layout = schema.layout()
    vectors = random_vectors(layout, 300, rng)
    found = Extractor(schema).extract(layout, vectors)
    order, keys = canonical_order(found, 2), signature(found, 2)
    for i in range(0, 300, 37):
        alone = found.rows(slice(i, i + 1))
        assert canonical_order(alone, 2)[0].tolist() == order[i].tolist()
        assert signature(alone, 2) == [keys[i]]
    shuffle = rng.permutation(len(KINDS))
    other = schema_of([KINDS[k] for k in shuffle])
    moved = vectors.reshape(300, len(KINDS), 12)[:, shuffle].reshape(300, -1)
    again = Extractor(other).extract(other.layout(), moved)
    target = int(np.flatnonzero(shuffle == 2)[0])
    np.testing.assert_array_equal(shuffle[canonical_order(again, target)], order)
    assert signature(again, target) == keys


def test_equal_keys_mean_equal_tables_in_canonical_order() -> None:
    schema = schema_of(("ball", "box", "box"))
    vectors = random_vectors(schema.layout(), 2000, np.random.default_rng(2))
    found = Extractor(schema).extract(schema.layout(), vectors)
    order, keys = canonical_order(found, 0), signature(found, 0)
    assert keys == signature(found, 0, order)
    tables: dict[bytes, bytes] = {}
    for table, row, key in zip(found.table, order, keys, strict=True):
        line = [0, *row]
        seen = table[:, line][:, :, line].tobytes()
        assert tables.setdefault(key, seen) == seen
        np.testing.assert_array_equal(relations_of(key, len(found.names), 3), table[:, line][:, :, line])
    assert len(tables) == len(set(tables.values())) > 20


@pytest.mark.parametrize("kinds", [("ball", "box"), ("ball", "ramp"), ("box", "ball")])
def test_keys_tell_types_apart(kinds: tuple[str, str]) -> None:
    keys = set()
    for pair in (kinds, ("ball", "pentagon")):
        schema = schema_of(pair)
        vectors = np.zeros((1, schema.layout().width))
        vectors[:, [6, 7, 8, 18, 19, 20]] = 1.0
        vectors[0, 0] = 9.0
        keys.update(signature(Extractor(schema).extract(schema.layout(), vectors), 0))
    assert len(keys) == 2
