"""What a layout means for laws, and who touches whom, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.laws.columns import Sources, vector_types
from relgym.laws.touching import Cast, Contacts
from relgym.scene.objects import POSE, Kinematics, ObjectType, Target
from relgym.scene.relations import Extractor
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere

BALL = ObjectType("ball", (*POSE, "vx", "vy", "spin"), Sphere(), velocity=("vx", "vy", None))
BLOCK = ObjectType("block", (*POSE, "vx", "vy", "spin"), Box(), velocity=("vx", "vy", None))
WALL = ObjectType("wall", POSE, Box())
OBJECTS = (("one", "ball"), ("wall", "wall"), ("two", "ball"), ("block", "block"))


def cast_of(*learned: str) -> Cast:
    """Of a ball, a wall, another ball and a block; velocity and spin of some types are learned."""
    targets = tuple(Target(t, v) for t in learned for v in ("vx", "vy", "spin"))
    rates = tuple(
        Kinematics(t, p, v) for t in learned for p, v in (("px", "vx"), ("py", "vy"), ("rz", "spin"))
    )
    schema = SceneSchema((BALL, BLOCK, WALL), OBJECTS, planar=True, kinematics=rates, targets=targets)
    sources = {t.name: Sources.of(schema, t, targets) for t in vector_types(schema, targets)}
    return Cast.of(schema, schema.layout(), sources)


def placed(x: float, y: float, size: float, *moving: float) -> list[float]:
    return [x, y, 0.0, 0.0, 0.0, 0.0, size, size, 1.0, *moving]


VECTOR = np.array(
    [
        *placed(0.0, 0.5, 1.0, 0.3, -0.4, 7.0),
        *placed(0.0, -5.0, 10.0),
        *placed(3.0, 4.0, 2.0, 0.0, 0.0, 8.0),
        *placed(0.9, 0.5, 1.0, -0.6, 0.8, 9.0),
    ]
)


def test_who_moves_and_which_pairs_may_meet() -> None:
    cast = cast_of("ball", "block")
    assert cast.bodies == {"one": 0, "wall": 1, "two": 2, "block": 3}
    assert cast.movers == (0, 2, 3)
    # Of two that move the first is the one whose type comes first, of one type the one whose number does.
    assert cast.pairs == ((0, 1), (0, 2), (0, 3), (2, 1), (2, 3), (3, 1))
    assert cast.kinds[:3] == (("ball", "wall"), ("ball", "ball"), ("ball", "block"))
    assert cast.both.tolist() == [False, True, True, False, True, False]
    assert cast.spins.tolist() == [True, False, True, True]
    balls = cast_of("ball")
    assert balls.movers == (0, 2)
    assert balls.pairs == ((0, 1), (0, 2), (0, 3), (2, 1), (2, 3))  # a block is a wall to them
    assert balls.spins.tolist() == [True, False, True, False]


def test_velocities_are_found_by_body_and_those_of_walls_are_none() -> None:
    cast = cast_of("ball", "block")
    state = cast.padded(VECTOR[None])
    expected = [[0.3, 0.0, 0.0, -0.6], [-0.4, 0.0, 0.0, 0.8], [7.0, 0.0, 8.0, 9.0]]
    assert state[cast.velocities][..., 0].tolist() == expected
    assert cast.dimensions == 2
    one = cast_of("ball").padded_one(VECTOR)
    assert np.isnan(one[-2]) and one[-1] == 0.0 and one[:-2].tolist() == VECTOR.tolist()


@pytest.mark.parametrize("learned", [(), ("ball",), ("ball", "block")])
def test_one_vector_is_padded_as_many(learned: tuple[str, ...]) -> None:
    cast, rng = cast_of(*learned), np.random.default_rng(0)
    vectors = rng.normal(size=(5, len(VECTOR)))
    many = cast.padded(vectors)
    for k, vector in enumerate(vectors):
        assert cast.padded_one(vector).tobytes() == np.ascontiguousarray(many[:, k]).tobytes()
    for _, places in cast.sources.values():
        assert places.max() < len(many)


def test_where_bodies_turn_drag_and_places_are_read_too() -> None:
    cast = cast_of("ball", "block")
    state = cast.padded(np.stack([VECTOR, 2.0 * VECTOR]))
    read = {
        body: dict(zip(s.names, state[places], strict=True)) for body, (s, places) in cast.sources.items()
    }
    # |v| of the first ball is 0.5, of the block 1; at twice the speed drag is four times as large.
    np.testing.assert_allclose(read[0]["|v|*vx"], [0.15, 0.6])
    np.testing.assert_allclose(read[0]["|v|*vy"], [-0.2, -0.8])
    np.testing.assert_allclose(read[2]["|v|*vx"], [0.0, 0.0])
    np.testing.assert_allclose(read[3]["|v|*vy"], [0.8, 3.2])
    assert read[3]["px"].tolist() == [0.9, 1.8]
    round_only = cast_of("ball")
    assert round_only.manifolds is None and round_only.padded(VECTOR[None]).shape == (len(VECTOR) + 2, 1)
    assert round_only.sources[0][0].names == ("vx", "vy", "spin")


@pytest.mark.parametrize("learned", [("ball",), ("ball", "block")])
def test_who_touches_whom(learned: tuple[str, ...]) -> None:
    """The first ball lies on the wall and overlaps the block, which lies on the wall; the other one is far off."""
    cast = cast_of(*learned)
    schema = SceneSchema((BALL, BLOCK, WALL), OBJECTS, planar=True)
    contacts = Contacts.of(cast, Extractor(schema).extract(cast.layout, VECTOR[None]), VECTOR[None])
    touching = {cast.pairs[k] for k in np.flatnonzero(contacts.hits[0])}
    assert touching == {(0, 1), (0, 3)} | ({(3, 1)} if "block" in learned else set())
    if contacts.points is not None:
        counts = np.bincount(contacts.points.pair, minlength=len(cast.pairs))
        assert counts[cast.pairs.index((3, 1))] == 2  # its face lies on the wall
        assert counts[cast.pairs.index((0, 1))] == 1


def test_groups_and_their_directions() -> None:
    cast = cast_of("ball")
    apart = VECTOR.copy()
    apart[cast.layout.places["one", "py"]] = 9.0
    vectors = np.stack([apart, VECTOR, VECTOR])
    schema = SceneSchema((BALL, BLOCK, WALL), OBJECTS, planar=True)
    contacts = Contacts.of(cast, Extractor(schema).extract(cast.layout, vectors), vectors)
    for k in range(len(vectors)):
        alone = Contacts.of(
            cast, Extractor(schema).extract(cast.layout, vectors[k : k + 1]), vectors[k : k + 1]
        )
        assert np.array_equal(contacts.scene(k).hits, alone.hits)
        assert np.array_equal(contacts.scene(k).pose, alone.pose)
    (group,) = contacts.groups()  # scenes without contacts are left out
    assert group.scenes.tolist() == [1, 2]
    assert [cast.pairs[k] for k in group.pairs[0].tolist()] == [(0, 1), (0, 3)]
    np.testing.assert_allclose(group.bearings.normal[:, 0], [[0.0, -1.0], [1.0, 0.0]], atol=1e-12)
    centres = np.array([[0.0, 5.5], [-0.9, 0.0]])
    np.testing.assert_allclose(
        group.bearings.centres[:, 0].T, centres / np.linalg.norm(centres, axis=1)[:, None]
    )
    arms = contacts.arms(np.array([0, 0, 0]), np.array([0, 1, 2]))
    assert arms.tolist() == [0.5, 0.0, 1.0]  # walls don't spin
