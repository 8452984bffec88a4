"""Spatial relations: every definition worked by hand, and what batching, order and shifts leave alone."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import KINDS, random_vectors, schema_of

from relgym.errors import ConfigError, ObservationError, SchemaError, ShapeError
from relgym.scene import (
    Box,
    Extractor,
    ObjectType,
    Relations,
    Scene,
    SceneSchema,
    Sphere,
    relational_state,
    unary,
)
from relgym.scene.types import POSE

EVERY_KIND = ("ball", "box", "ramp", "ball", "pentagon", "box", "hull")


def boxes(**placed: tuple[float, ...]) -> Scene:
    """A planar scene of boxes, each given by x, y, width and height; a fifth number makes it a ball."""
    schema = schema_of(())
    kinds = {name: "ball" if len(numbers) > 4 else "box" for name, numbers in placed.items()}
    schema = SceneSchema(schema.types, tuple(kinds.items()))
    return schema.scene(
        {name: [x, y, 0, 0, 0, 0, w, h, w, 0, 0, 0] for name, (x, y, w, h, *_) in placed.items()}
    )


def holds(scene: Scene, relation: str, *objects: str) -> bool:
    return objects in relational_state(scene).tuples(relation)


def test_names_are_alphabetical_and_leave_out_a_planar_depth_axis() -> None:
    names = Extractor(schema_of(())).names
    assert list(names) == sorted(names)
    assert set(names) == {
        "approaching", "approaching-fastest", "intersect", "on-top", "smaller-than",
        "x-aligned", "x-greater-than", "x-less-than", "y-aligned", "y-greater-than", "y-less-than",
    }  # fmt: skip
    assert {n[0] for n in Extractor(schema_of((), up="z")).names if n[1] == "-"} == {"x", "z"}
    assert len(Extractor(schema_of((), planar=False)).names) == 14


def test_direction_has_a_margin_of_five_percent_of_the_smaller_extent() -> None:
    # a is 2 wide, b is 1 wide: they may overlap by 0.05 and still count as beside each other.
    for overlap, beside in ((-0.3, True), (0.0, True), (0.0499, True), (0.0501, False), (0.7, False)):
        scene = boxes(a=(0, 0, 2, 1), b=(1.5 - overlap, 0, 1, 1))
        assert holds(scene, "x-less-than", "a", "b") == beside
        assert holds(scene, "x-greater-than", "b", "a") == beside
        assert holds(scene, "x-aligned", "a", "b") != beside
        assert holds(scene, "x-aligned", "b", "a") != beside
        assert not holds(scene, "x-greater-than", "a", "b")
        assert holds(scene, "y-aligned", "a", "b")


def test_on_top_needs_contact_height_and_overlap() -> None:
    floor = (0.0, 0.0, 10.0, 1.0)
    assert holds(boxes(a=(0, 1.0, 1, 1), f=floor), "on-top", "a", "f")
    assert not holds(boxes(a=(0, 1.0, 1, 1), f=floor), "on-top", "f", "a")
    # Above, but in the air.
    assert not holds(boxes(a=(0, 1.01, 1, 1), f=floor), "on-top", "a", "f")
    # Only a twentieth of it is over the floor; then more than a tenth.
    assert not holds(boxes(a=(5.45, 1.0, 1, 1), f=floor), "on-top", "a", "f")
    assert holds(boxes(a=(5.35, 1.0, 1, 1), f=floor), "on-top", "a", "f")
    # The fraction is of the upper one's extent: a wide box on a narrow one must cover it widely.
    assert not holds(boxes(a=(0, 1.0, 10, 1), f=(0, 0, 0.9, 1)), "on-top", "a", "f")


def test_a_ball_sunk_by_more_than_five_percent_is_aligned_instead_of_on_top() -> None:
    # The thinner height counts: the ball's 0.2, then the floor's 0.1.
    for sunk, thickness, on_top in (
        (0.009, 1, True),
        (0.011, 1, False),
        (0.004, 0.1, True),
        (0.006, 0.1, False),
    ):
        scene = boxes(b=(0, 0.1 - sunk, 0.2, 0.2, 1), f=(0, -thickness / 2, 10, thickness))
        assert holds(scene, "intersect", "b", "f")
        assert holds(scene, "on-top", "b", "f") == on_top
        assert holds(scene, "y-aligned", "b", "f") != on_top


def test_on_top_looks_at_both_horizontal_axes_in_space() -> None:
    schema = schema_of(("box", "box"), planar=False)
    for depth, on_top in ((0.85, True), (0.95, False)):
        lower, upper = np.zeros(12), np.zeros(12)
        lower[6:9] = upper[6:9] = 1.0
        upper[1:3] = 1.0, depth
        scene = schema.scene({"o0": lower, "o1": upper})
        assert holds(scene, "intersect", "o0", "o1")
        assert holds(scene, "on-top", "o1", "o0") == on_top


def test_smaller_than_compares_diagonals() -> None:
    # Diagonal of a 3 x 4 box: 5.
    for side, smaller in ((4.54 / np.sqrt(2), True), (4.55 / np.sqrt(2), False)):
        scene = boxes(a=(0, 0, side, side), b=(9, 0, 3, 4))
        assert holds(scene, "smaller-than", "a", "b") == smaller
        assert not holds(scene, "smaller-than", "b", "a")


def test_boxes_on_each_other_intersect_whatever_their_coordinates() -> None:
    heights = np.random.default_rng(0).uniform(3, 5, (200, 2))
    for lower, upper in heights:
        scene = boxes(a=(0.3, lower + upper / 2, 4, upper), b=(0, lower / 2, 4, lower))
        assert holds(scene, "intersect", "a", "b")
        assert holds(scene, "on-top", "a", "b")


def test_touching_ends_a_billionth_away() -> None:
    for gap, touches in ((0.0, True), (0.9e-9, True), (1.1e-9, False)):
        scene = boxes(a=(0, 0, 1, 1), b=(0, 0.5 + 0.25 + gap, 0.5, 0.5))
        assert holds(scene, "intersect", "a", "b") == touches
        wide = Extractor(scene.schema, eps=1e-6).extract(scene.layout, scene.vector[None])
        assert wide.relation("intersect")[0, 0, 1]


def test_bounding_box_of_a_ball_comes_from_its_radius() -> None:
    # Turned by 45 degrees, a box gets wider, a ball doesn't.
    scene = boxes(a=(0, 0, 1, 1, 1), b=(1.0, 3.0, 1, 1))
    turned = scene.replace({("a", "rz"): np.pi / 4})
    assert holds(turned, "x-less-than", "a", "b")
    assert not holds(scene.replace({("b", "rz"): np.pi / 4}), "x-less-than", "a", "b")


def test_types_and_their_ancestors_are_unary_relations() -> None:
    parts = (
        ObjectType("ramp_0.3_0.8_60", POSE, Box(), parent="ramp"),
        ObjectType("ramp", POSE, Box(), parent="obstacle"),
        ObjectType("ball", POSE, Sphere()),
        ObjectType("action", ("force",)),
    )
    schema = SceneSchema(parts, (("r", "ramp_0.3_0.8_60"), ("u", "action"), ("b", "ball"), ("s", "ramp")))
    assert {name: found.tolist() for name, found in unary(schema, schema.layout()).items()} == {
        "ball": [False, True, False],
        "obstacle": [True, False, True],
        "ramp": [True, False, True],
        "ramp_0.3_0.8_60": [True, False, False],
    }
    # Every layout of a schema has the same names.
    assert list(unary(schema, schema.layout(["b"]))) == list(unary(schema, schema.layout()))


def test_relational_state_is_for_people() -> None:
    state = relational_state(boxes(a=(0, 1, 1, 1), f=(0, 0, 10, 1)))
    assert state.tuples("box") == {("a",), ("f",)}
    assert state.tuples("hull") == frozenset()
    assert "on-top(a, f)" in str(state).splitlines()
    with pytest.raises(LookupError, match="unknown relation 'under'"):
        state.tuples("under")


def same(a: Relations, b: Relations, body: int = 0) -> bool:
    return (
        np.array_equal(a.table, b.table)
        and np.array_equal(a.distance, b.distance)
        and np.array_equal(a.contacts(body), b.contacts(body), equal_nan=True)
        and np.array_equal(a.context(body), b.context(body))
    )


@pytest.mark.parametrize("planar", [True, False])
@given(seed=st.integers(0, 10**6), n=st.integers(1, 40))
def test_a_scene_has_the_same_bits_alone_and_in_any_batch(planar: bool, seed: int, n: int) -> None:
    schema = schema_of(EVERY_KIND, planar=planar)
    layout = schema.layout()
    vectors = random_vectors(layout, n, np.random.default_rng(seed))
    extractor = Extractor(schema)
    batch = extractor.extract(layout, vectors)
    for i in {0, n // 2, n - 1}:
        alone = extractor.extract(layout, vectors[i : i + 1])
        assert same(alone, batch.rows(slice(i, i + 1)), body=i % len(EVERY_KIND))


def test_chunks_leave_no_trace() -> None:
    schema = schema_of(EVERY_KIND)
    vectors = random_vectors(schema.layout(), 700, np.random.default_rng(0))
    extractor = Extractor(schema)
    whole = extractor.extract(schema.layout(), vectors)
    parts = [extractor.extract(schema.layout(), vectors[i : i + 77]) for i in range(0, 700, 77)]
    np.testing.assert_array_equal(whole.table, np.concatenate([p.table for p in parts]))
    np.testing.assert_array_equal(whole.contacts(3), np.concatenate([p.contacts(3) for p in parts]))


@pytest.mark.parametrize("planar", [True, False])
def test_what_stood_still_is_remembered_to_the_bit(planar: bool) -> None:
    schema = schema_of(EVERY_KIND, planar=planar)
    layout, rng = schema.layout(), np.random.default_rng(1)
    vector = random_vectors(layout, 1, rng)
    remembering = Extractor(schema)
    for step in range(60):
        vector = vector.copy()
        for k in rng.choice(len(EVERY_KIND), step % 3, replace=False):
            vector[0, 12 * k : 12 * k + 6] += rng.uniform(-0.1, 0.1, 6)
        assert same(remembering.extract(layout, vector), Extractor(schema).extract(layout, vector), step % 7)


@pytest.mark.parametrize("planar", [True, False])
def test_order_of_objects_changes_nothing(planar: bool) -> None:
    rng = np.random.default_rng(2)
    layout = schema_of(EVERY_KIND, planar=planar).layout()
    vectors = random_vectors(layout, 400, rng)
    order = rng.permutation(len(EVERY_KIND))
    other = schema_of([EVERY_KIND[k] for k in order], planar=planar)
    moved = vectors.reshape(400, len(EVERY_KIND), 12)[:, order].reshape(400, -1)
    a = Extractor(schema_of(EVERY_KIND, planar=planar)).extract(layout, vectors)
    b = Extractor(other).extract(other.layout(), moved)
    # In the plane to the last bit; in space, edges that pass each other are looked at from one of the two.
    tolerance = 0.0 if planar else 1e-14
    np.testing.assert_allclose(b.distance, a.distance[:, order][:, :, order], rtol=0, atol=tolerance)
    np.testing.assert_array_equal(b.table, a.table[:, :, order][:, :, :, order])
    np.testing.assert_allclose(b.contacts(0), a.contacts(order[0])[:, order], atol=1e-9)


@pytest.mark.parametrize("planar", [True, False])
def test_shifting_everything_changes_nothing(planar: bool) -> None:
    schema = schema_of(EVERY_KIND, planar=planar)
    layout = schema.layout()
    vectors = random_vectors(layout, 500, np.random.default_rng(3))
    shifted = vectors.copy().reshape(500, -1, 12)
    shifted[..., :3] += [1e3, -1e3, 1e3]
    extractor = Extractor(schema)
    a, b = extractor.extract(layout, vectors), extractor.extract(layout, shifted.reshape(500, -1))
    np.testing.assert_allclose(b.distance, a.distance, atol=1e-11)
    np.testing.assert_array_equal(b.table, a.table)
    np.testing.assert_allclose(b.contacts(0), a.contacts(0), atol=1e-8)


@pytest.mark.parametrize("planar", [True, False])
def test_every_axis_relation_holds_one_way(planar: bool) -> None:
    schema = schema_of(EVERY_KIND, planar=planar)
    found = Extractor(schema).extract(
        schema.layout(), random_vectors(schema.layout(), 500, np.random.default_rng(4))
    )
    pairs = ~np.eye(len(EVERY_KIND), dtype=bool)
    for axis in Extractor(schema).axes.names:
        less, greater, aligned = (
            found.relation(f"{axis}-{k}") for k in ("less-than", "greater-than", "aligned")
        )
        assert (less ^ greater ^ aligned)[:, pairs].all() and not (less & greater).any()
        np.testing.assert_array_equal(less, greater.swapaxes(1, 2))
        np.testing.assert_array_equal(aligned, aligned.swapaxes(1, 2))
    np.testing.assert_array_equal(found.relation("intersect"), found.relation("intersect").swapaxes(1, 2))
    assert not found.table[:, :, np.arange(7), np.arange(7)].any()
    assert np.isposinf(found.distance[:, np.arange(7), np.arange(7)]).all()
    np.testing.assert_array_equal(found.distance, found.distance.swapaxes(1, 2))


@pytest.mark.parametrize("planar", [True, False])
def test_both_geometries_give_the_same_relations(planar: bool) -> None:
    schema = schema_of(EVERY_KIND, planar=planar)
    layout = schema.layout()
    vectors = random_vectors(layout, 150, np.random.default_rng(5))
    arrays = Extractor(schema).extract(layout, vectors)
    by_fcl = Extractor(schema, geometry="fcl").extract(layout, vectors)
    assert np.abs(arrays.distance - 1e-9).min() > 1e-9
    np.testing.assert_array_equal(by_fcl.table, arrays.table)
    np.testing.assert_array_equal(by_fcl.context(0), arrays.context(0))


def test_extractor_pickles_without_its_caches() -> None:
    for geometry in ("arrays", "fcl"):
        schema = schema_of(EVERY_KIND)
        vectors = random_vectors(schema.layout(), 3, np.random.default_rng(6))
        extractor = Extractor(schema, geometry=geometry)  # type: ignore[arg-type]
        fresh = pickle.dumps(extractor)
        expected = extractor.extract(schema.layout(), vectors)
        assert pickle.dumps(extractor) == fresh
        assert same(pickle.loads(fresh).extract(schema.layout(), vectors), expected)


def test_inputs_are_left_alone_and_empty_batches_are_fine() -> None:
    schema = schema_of(EVERY_KIND)
    vectors = random_vectors(schema.layout(), 5, np.random.default_rng(7))
    before = vectors.copy()
    found = Extractor(schema).extract(schema.layout(), vectors)
    np.testing.assert_array_equal(vectors, before)
    assert len(found.rows(slice(0, 0))) == 0
    empty = Extractor(schema).extract(schema.layout(), vectors[:0])
    assert empty.table.shape == (0, 11, 7, 7) and empty.contacts(2).shape == (0, 7, 5)


@pytest.mark.parametrize("planar", [True, False])
@pytest.mark.parametrize("kinds", [(), ("ball",), ("box",), ("ball", "ball")])
def test_scenes_of_few_objects(kinds: tuple[str, ...], planar: bool) -> None:
    schema = schema_of(kinds, planar=planar)
    vectors = random_vectors(schema.layout(), 4, np.random.default_rng(8))
    found = Extractor(schema).extract(schema.layout(), vectors)
    assert found.distance.shape == (4, len(kinds), len(kinds))
    if len(kinds) == 1:
        assert found.context(0).all() and np.isnan(found.contacts(0)).all()


def test_bad_input_is_refused() -> None:
    schema = schema_of(("ball", "box"))
    layout, extractor = schema.layout(), Extractor(schema)
    vector = random_vectors(layout, 1, np.random.default_rng(9))
    for width in (5, 25):
        with pytest.raises(ObservationError, match=r"expected state vectors of shape \(n, 24\)"):
            extractor.extract(layout, np.zeros((1, width)))
    extractor.extract(layout, vector)
    for bad in (0.0, -1.0, np.nan):
        flat = vector.copy()
        flat[0, 12 + 7] = bad
        with pytest.raises(ShapeError, match=f"object 'o1': extent sy must be positive, got {bad}"):
            extractor.extract(layout, flat)
    oval = vector.copy()
    oval[0, 7] *= 1.0 + 1e-8
    with pytest.raises(ShapeError, match="object 'o0' is a sphere, but its extents are"):
        extractor.extract(layout, oval)
    deep = vector.copy()
    deep[0, 8] *= 2.0  # the depth axis doesn't count in the plane
    assert len(extractor.extract(layout, deep)) == 1
    with pytest.raises(ConfigError, match="geometry must be 'arrays' or 'fcl', got 'bullet'"):
        Extractor(schema, geometry="bullet")  # type: ignore[arg-type]
    with pytest.raises(SchemaError, match="type name 'on-top' is the name of a spatial relation"):
        Extractor(SceneSchema((ObjectType("on-top", POSE, Box()),), ()))


def test_every_kind_is_among_the_test_scenes() -> None:
    assert set(EVERY_KIND) == set(KINDS)


@pytest.mark.parametrize("kinds", [("box", "ball"), ("box", "box"), ("hull", "pentagon")])
def test_coarse_numbers_touch_within_their_precision_alone_and_in_batches(kinds: tuple[str, str]) -> None:
    precision = 0.1  # far coarser than any float, so that many pairs are near enough
    exact = schema_of(kinds)
    coarse = replace(exact, precision=precision)
    layout = coarse.layout()
    vectors = random_vectors(layout, 400, np.random.default_rng(0))
    fine, rough = (
        Extractor(exact).extract(exact.layout(), vectors),
        Extractor(coarse).extract(layout, vectors),
    )
    lengths = vectors.reshape(400, 2, 12)[:, :, [0, 1, 2, 6, 7, 8]]  # places and sizes
    limit = 1e-9 + precision * np.abs(lengths).max(axis=(1, 2), initial=1.0)
    near = fine.distance[:, 0, 1] <= limit
    assert 20 < int((near & ~fine.relation("intersect")[:, 0, 1]).sum()) < 380
    np.testing.assert_array_equal(rough.relation("intersect")[:, 0, 1], near)
    np.testing.assert_array_equal(rough.touched(0)[:, 1], near)
    for k in range(0, 400, 37):
        one = Extractor(coarse).extract(layout, vectors[k : k + 1])
        for name in rough.names:
            np.testing.assert_array_equal(one.relation(name)[0], rough.relation(name)[k])
        np.testing.assert_array_equal(rough.rows(slice(k, k + 1)).touched(0)[0], one.touched(0)[0])


def test_how_coarse_a_pair_is_is_its_own_affair() -> None:
    """Something that is parked far away makes no neighbours touch."""
    for far in (3.0, 1e6):
        scene = boxes(a=(0, 0, 1, 1), b=(0, 1.002, 1, 1), c=(far, 0, 1, 1))
        coarse = replace(scene.schema, precision=4.8e-7)
        for copies in (1, 3):
            found = Extractor(coarse).extract(coarse.layout(), np.repeat(scene.vector[None], copies, axis=0))
            assert not found.relation("intersect").any() and not found.touched(0).any()


def test_float32_leaves_a_gap_that_is_none() -> None:
    scene = boxes(a=(0, -0.4, 9, 1), b=(0, float(np.float32(0.6)), 1, 1))
    assert not holds(scene, "intersect", "a", "b")
    coarse = replace(scene.schema, precision=4.8e-7)
    assert holds(Scene(coarse, coarse.layout(), scene.vector.copy()), "intersect", "a", "b")
    apart = boxes(a=(0, -0.4, 9, 1), b=(0, 0.601, 1, 1))
    assert not holds(Scene(coarse, coarse.layout(), apart.vector.copy()), "intersect", "a", "b")
    with pytest.raises(SchemaError, match=r"precision must lie in \[0, 1\), got 2"):
        replace(scene.schema, precision=2.0)
