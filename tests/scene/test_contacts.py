"""Contact features and `approaching`: hand-worked in the plane and in space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import random_vectors, schema_of

from relgym.scene import CONTACT_FEATURES, Extractor, ObjectType, SceneSchema, Sphere, contact_features
from relgym.scene.shapes import Box, Wedge
from relgym.scene.types import POSE


def ball_over(
    shape: Box | Wedge, ball: list[float], velocity: tuple[float, float]
) -> tuple[SceneSchema, np.ndarray]:
    types = (
        ObjectType("ball", (*POSE, "vx", "vy"), Sphere(), velocity=("vx", "vy", None)),
        ObjectType("thing", POSE, shape),
    )
    schema = SceneSchema(types, (("b", "ball"), ("t", "thing")))
    scene = schema.scene({"b": [*ball, 0, 0, 0, 0, 1, 1, 1, *velocity], "t": [0, 0, 0, 0, 0, 0, 2, 2, 1]})
    return schema, scene.vector[None]


def features(schema: SceneSchema, vectors: np.ndarray, body: int = 0) -> np.ndarray:
    return Extractor(schema).extract(schema.layout(), vectors).contacts(body)[0]


def test_names_follow_the_used_axes() -> None:
    assert contact_features(schema_of(())) == CONTACT_FEATURES
    assert contact_features(schema_of((), up="z"))[1:3] == ("normal-x", "normal-z")
    assert contact_features(schema_of((), planar=False))[1:4] == ("normal-x", "normal-y", "normal-z")


def test_ball_on_a_floor() -> None:
    # Falls at 2 and moves right at 3: it approaches, and slips backwards along t = (-1, 0).
    schema, vectors = ball_over(Box(), [0.0, 1.5], (3.0, -2.0))
    np.testing.assert_array_equal(features(schema, vectors)[1], [0.0, 0.0, 1.0, -2.0, -3.0])
    assert np.isnan(features(schema, vectors)[0]).all()
    # Seen from the floor: the normal and the relative velocity turn round, so approach and slip stay.
    np.testing.assert_array_equal(features(schema, vectors, body=1)[0], [0.0, 0.0, -1.0, -2.0, -3.0])


def test_offsets_are_told_where_they_are_asked_for() -> None:
    schema, vectors = ball_over(Box(), [0.5, 1.5], (3.0, -2.0))
    asked = replace(schema, offsets=True)
    assert contact_features(asked) == (*CONTACT_FEATURES, "offset-x", "offset-y")
    np.testing.assert_array_equal(features(asked, vectors)[1], [*features(schema, vectors)[1], 0.5, 1.5])
    np.testing.assert_array_equal(features(asked, vectors, body=1)[0, -2:], [-0.5, -1.5])


def test_ball_on_a_slope() -> None:
    # The slope descends to the right at 45 degrees; straight down is half towards it, half along it.
    schema, vectors = ball_over(Wedge(), [1.0, 1.0], (0.0, -1.0))
    half = np.sqrt(0.5)
    expected = [2 * half - 0.5, half, half, -half, -half]
    np.testing.assert_allclose(features(schema, vectors)[1], expected, atol=1e-15)


@pytest.mark.parametrize(
    ("height", "velocity", "approaches"),
    [
        (1.5, (0.0, -1.0), True),
        (1.5, (5.0, 0.0), True),  # slides
        (1.5, (5.0, 0.9e-9), True),
        (1.5, (5.0, 1.1e-9), False),  # leaves
        (1.4, (0.0, 1.0), False),  # sunk, but leaves
        (1.6, (0.0, -1.0), False),  # doesn't touch
    ],
)
def test_approaching_is_touching_and_not_separating(
    height: float, velocity: tuple[float, float], approaches: bool
) -> None:
    schema, vectors = ball_over(Box(), [0.0, height], velocity)
    found = Extractor(schema).extract(schema.layout(), vectors).relation("approaching")[0]
    assert found.tolist() == [[False, approaches], [approaches, False]]


def test_bodies_without_velocity_do_not_approach() -> None:
    thing = ObjectType("thing", POSE, Box())
    schema = SceneSchema((thing,), (("a", "thing"), ("b", "thing")))
    vectors = np.tile([0.0, 0, 0, 0, 0, 0, 1, 1, 1], 2)[None]
    found = Extractor(schema).extract(schema.layout(), vectors)
    assert found.relation("intersect").any() and not found.relation("approaching").any()


def test_in_space_slip_is_a_magnitude() -> None:
    schema = schema_of(("ball", "box"), planar=False)
    ball = [0, 0, 2.5, 0, 0, 0, 1, 1, 1, 3.0, 4.0, -1.0]
    box = [0, 0, 0, 0, 0, 0, 4, 4, 4, 0, 0, 0.5]
    found = features(schema, schema.scene({"o0": ball, "o1": box}).vector[None])
    np.testing.assert_allclose(found[1], [0.0, 0.0, 0.0, 1.0, -1.5, 5.0], atol=1e-15)


def test_features_agree_with_the_relations() -> None:
    kinds = ("ball", "box", "ramp", "ball")
    schema = schema_of(kinds)
    found = Extractor(schema).extract(
        schema.layout(), random_vectors(schema.layout(), 300, np.random.default_rng(0))
    )
    for body in range(len(kinds)):
        contacts, others = found.contacts(body), np.arange(len(kinds)) != body
        np.testing.assert_array_equal(contacts[:, others, 0], found.distance[:, body, others])
        np.testing.assert_array_equal(contacts[..., 1:3], found.normals(body))
        approaches = found.relation("intersect")[:, body] & (contacts[..., 3] <= 1e-9)
        np.testing.assert_array_equal(approaches[:, others], found.relation("approaching")[:, body, others])
        # Either body of a pair sees the same approach and slip, and the opposite normal.
        for other in np.flatnonzero(others):
            back = found.contacts(int(other))[:, body]
            np.testing.assert_array_equal(back[:, 1:3], -contacts[:, other, 1:3])
            np.testing.assert_array_equal(back[:, 3:], contacts[:, other, 3:])


def test_of_several_contacts_the_one_approached_fastest_is_told_apart() -> None:
    schema = schema_of(("ball", "box", "box"))
    still = [0, 0, 0]
    floor, wall = [0, -1, 0, 0, 0, 0, 4, 2, 1, *still], [1, 0.5, 0, 0, 0, 0, 1, 4, 1, *still]
    for velocity, fastest in (
        ((0.3, -0.1), [False, False, True]),
        ((0.1, -0.3), [False, True, False]),
        ((0.2, -0.2), [False, True, True]),  # neither is faster
        ((-0.1, 0.0), [False, True, False]),  # leaves the wall, slides on the floor
        ((-0.1, 0.2), [False, False, False]),  # leaves both
    ):
        ball = [0, 0.5, 0, 0, 0, 0, 1, 1, 1, *velocity, 0]
        scene = schema.scene({"o0": ball, "o1": floor, "o2": wall})
        found = Extractor(schema).extract(schema.layout(), scene.vector[None])
        assert found.relation("approaching-fastest")[0, 0].tolist() == fastest
        assert (found.relation("approaching") >= found.relation("approaching-fastest")).all()
