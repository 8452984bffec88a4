"""What a batch is asked for only in part is, bit for bit, what whole single scenes hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import random_vectors, schema_of

from relgym.scene import Extractor
from relgym.scene.measurements import Pairs

KINDS = ("ball", "box", "ramp", "hull", "box", "ball")


def worlds(planar: bool, seed: int, count: int, crowded: bool) -> tuple[Extractor, np.ndarray]:
    """Scenes of balls and polyhedra, turned; crowded ones overlap."""
    schema = schema_of(KINDS, planar=planar)
    vectors = random_vectors(schema.layout(), count, np.random.default_rng(seed))
    if crowded:
        for i in range(len(KINDS)):
            vectors[:, schema.layout().slice(i)][:, :3] *= 0.3
    return Extractor(schema), vectors


@pytest.mark.parametrize("planar", [True, False])
@settings(max_examples=40)
@given(seed=st.integers(0, 10_000), count=st.integers(2, 6), crowded=st.booleans(), first=st.integers(0, 5))
def test_parts_of_a_batch_are_parts_of_whole_scenes(
    planar: bool, seed: int, count: int, crowded: bool, first: int
) -> None:
    extractor, vectors = worlds(planar, seed, count, crowded)
    layout = extractor.schema.layout()
    alone = [extractor.extract(layout, vectors[i : i + 1]) for i in range(count)]
    table = np.concatenate([each.table for each in alone])
    distance = np.concatenate([each.distance for each in alone])

    some = extractor.extract(layout, vectors)  # asked for one thing first, then for others
    a, b = np.array([first, 2]), np.array([(first + 1) % 6, 3])
    touching = np.stack([table[:, some.names.index("intersect"), x, y] for x, y in zip(a, b, strict=True)])
    np.testing.assert_array_equal(some.touching(a, b), touching.T)
    np.testing.assert_array_equal(some.distances(first), distance[:, first])
    np.testing.assert_array_equal(
        some.normals(first), np.concatenate([each.normals(first) for each in alone])
    )
    name = some.names[seed % len(some.names)]
    np.testing.assert_array_equal(some.relation(name), table[:, some.names.index(name)])
    few = some.table_of([name, "intersect"])
    np.testing.assert_array_equal(few[:, some.names.index(name)], table[:, some.names.index(name)])
    assert few.sum() == some.relation(name).sum() + (name != "intersect") * some.relation("intersect").sum()
    np.testing.assert_array_equal(some.distance, distance)
    np.testing.assert_array_equal(some.table, table)

    every = extractor.extract(layout, vectors)  # asked for everything at once
    np.testing.assert_array_equal(every.table, table)
    np.testing.assert_array_equal(every.contacts(first), np.concatenate([x.contacts(first) for x in alone]))
    np.testing.assert_array_equal(every.rows(slice(1, None)).table, table[1:])


@pytest.mark.parametrize("planar", [True, False])
def test_touching_neighbours_are_found_among_boxes_that_do_not_meet(planar: bool) -> None:
    extractor, vectors = worlds(planar, 3, 400, crowded=True)
    found = extractor.extract(extractor.schema.layout(), vectors)
    touching = found.relation("intersect")
    assert 0.02 < touching[:, 2, 3].mean() < 0.98  # wedge and hull: some do, some don't
    np.testing.assert_array_equal(touching, found.distance <= extractor.eps)


def test_pairs_are_numbered_alike_either_way_round() -> None:
    pairs = Pairs.of(4)
    assert pairs.number[1, 3] == pairs.number[3, 1]
    assert pairs.among(2, np.arange(4)).sum() == 3  # a body has no pair with itself
    mask = pairs.among(np.array([0, 3]), np.array([1, 2]))
    assert list(zip(pairs.first[mask].tolist(), pairs.second[mask].tolist(), strict=True)) == [(0, 1), (2, 3)]
