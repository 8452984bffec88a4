"""Contact points: against pymunk's own, by hand, and what symmetry and rigid motions demand."""

from __future__ import annotations

import numpy as np
import pymunk
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from relgym.scene.axes import Axes
from relgym.scene.geometry.manifolds import Manifold, Manifolds
from relgym.scene.shapes import Box, Compound, Prism, Shape, Sphere, Wedge, outlines

AXES = Axes((0, 1), (0, 1, 2), 1.0)
Array = NDArray[np.float64]


def regular(corners: int) -> Prism:
    angles = 2.0 * np.pi * np.arange(corners) / corners
    return Prism(tuple((0.5 * float(np.cos(a)), 0.5 * float(np.sin(a))) for a in angles))


BEAMS = Compound(
    (
        ((-0.5, 0.1), (0.5, 0.1), (0.5, 0.4), (-0.5, 0.4)),
        ((-0.15, -0.6), (0.15, -0.6), (0.15, 0.1), (-0.15, 0.1)),
    )
)
SHAPES: tuple[Shape, ...] = (Sphere(), Box(), Wedge(), regular(3), regular(6), BEAMS)
ROUND, BOX = 0, 1


def poses(count: int, shapes: NDArray[np.intp], rng: np.random.Generator) -> Array:
    found = np.zeros((9, count))
    found[:2] = rng.uniform(-0.5, 0.5, (2, count))
    found[5] = rng.uniform(-9.0, 9.0, count)
    found[6:] = rng.uniform(0.3, 1.0, (3, count))
    found[7] = np.where(shapes == ROUND, found[6], found[7])
    return found


def pose(x: float, y: float, angle: float = 0.0, width: float = 1.0, height: float = 1.0) -> Array:
    return np.array([x, y, 0.0, 0.0, 0.0, angle, width, height, 1.0])[:, None]


def touch(a: Array, kind_a: int, b: Array, kind_b: int) -> Manifold:
    return Manifolds(AXES, SHAPES).touch(a, np.array([kind_a]), b, np.array([kind_b]))


def engine_shapes(pose_: Array, kind: int) -> list[pymunk.Shape]:
    body = pymunk.Body(1.0, 1.0)
    body.position, body.angle = (float(pose_[0]), float(pose_[1])), float(pose_[5])
    if kind == ROUND:
        found: list[pymunk.Shape] = [pymunk.Circle(body, 0.5 * float(pose_[6]))]
    else:
        found = [pymunk.Poly(body, (o * pose_[6:8]).tolist()) for o in outlines(SHAPES[kind])]
    for shape in found:
        shape.cache_bb()
    return found


def engine_points(pose_a: Array, kind_a: int, pose_b: Array, kind_b: int) -> list[tuple[float, ...]]:
    """The engine's points: position on a, position on b, normal from b to a."""
    found = []
    for one in engine_shapes(pose_a, kind_a):
        for other in engine_shapes(pose_b, kind_b):
            try:
                contacts = one.shapes_collide(other)
            except AssertionError:  # a pair without any point
                continue
            n = contacts.normal
            found += [(*p.point_a, *p.point_b, -n.x, -n.y) for p in contacts.points]
    return found


def rounded(row: tuple[float, ...]) -> list[float]:
    return [round(value, 9) for value in row]


def test_as_the_engine_finds_them(rng: np.random.Generator) -> None:
    count = 3_000
    a, b = (rng.integers(0, len(SHAPES), count) for _ in range(2))
    pose_a, pose_b = poses(count, a, rng), poses(count, b, rng)
    found = Manifolds(AXES, SHAPES).touch(pose_a, a, pose_b, b)
    on_a, on_b = found.first + pose_a[:2, found.pair], found.second + pose_b[:2, found.pair]
    rows = np.concatenate([on_a, on_b, found.normal]).T
    total = 0
    for k in range(count):
        expected = sorted(engine_points(pose_a[:, k], int(a[k]), pose_b[:, k], int(b[k])), key=rounded)
        mine = sorted(rows[found.pair == k].tolist(), key=rounded)
        assert len(mine) == len(expected)
        if expected:
            assert np.abs(np.array(mine) - np.array(expected)).max() < 1e-12
        total += len(expected)
    assert total > 3_000
    assert np.allclose(found.distance, ((on_a - on_b) * found.normal).sum(axis=0), atol=1e-15)


def test_a_box_lies_flat_on_another_one() -> None:
    found = touch(pose(0.25, 0.9), BOX, pose(0.0, 0.0), BOX)
    assert found.normal.T == pytest.approx(np.array([[0.0, 1.0], [0.0, 1.0]]))
    assert sorted(found.first.T.tolist()) == pytest.approx(np.array([[-0.5, -0.5], [0.25, -0.5]]))
    assert sorted(found.second.T.tolist()) == pytest.approx(np.array([[-0.25, 0.5], [0.5, 0.5]]))
    assert found.distance == pytest.approx(np.array([-0.1, -0.1]))


def test_a_tilted_box_stands_on_a_corner() -> None:
    found = touch(pose(0.0, 1.2, np.pi / 4.0), BOX, pose(0.0, 0.0, 0.0, 4.0, 1.0), BOX)
    assert len(found) == 1
    assert found.first[:, 0] == pytest.approx([0.0, -np.sqrt(0.5)])
    assert found.second[:, 0] == pytest.approx([0.0, 0.5])


def test_a_disc_at_a_corner() -> None:
    found = touch(pose(0.8, 0.9), ROUND, pose(0.0, 0.0), BOX)
    assert found.normal[:, 0] == pytest.approx([0.6, 0.8])
    assert found.first[:, 0] == pytest.approx([-0.3, -0.4])
    assert found.second[:, 0] == pytest.approx([0.5, 0.5])
    assert not len(touch(pose(1.2, 0.9), ROUND, pose(0.0, 0.0), BOX))


def test_parts_of_a_compound_touch_on_their_own() -> None:
    # A wide box under a T that lies on its side: the cross beam's end and the stem's end rest on it.
    found = touch(pose(0.0, 0.45, np.pi / 2.0), 5, pose(0.0, -1.0, 0.0, 4.0, 2.0), BOX)
    assert len(found) == 2
    assert sorted(found.first[0].tolist()) == pytest.approx([-0.4, -0.1])


def test_nothing_touches_nothing() -> None:
    none = np.empty(0, dtype=np.intp)
    assert not len(Manifolds(AXES, SHAPES).touch(np.empty((9, 0)), none, np.empty((9, 0)), none))


kinds = st.integers(0, len(SHAPES) - 1)
numbers = st.floats(-0.5, 0.5)


def drawn(kind: int, values: tuple[float, float, float]) -> Array:
    return pose(values[0], values[1], 6.0 * values[2], 0.7, 0.7 if kind == ROUND else 0.5)


@settings(max_examples=60, deadline=None)
@given(kinds, kinds, st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers))
def test_either_body_may_come_first(
    a: int, b: int, at_a: tuple[float, float, float], at_b: tuple[float, float, float]
) -> None:
    one, other = touch(drawn(a, at_a), a, drawn(b, at_b), b), touch(drawn(b, at_b), b, drawn(a, at_a), a)
    # Where two axes overlap equally little either may be taken: then the depths still agree.
    assert min(one.distance, default=0.0) == pytest.approx(min(other.distance, default=0.0), abs=1e-12)
    if len(one) == len(other) == 1 and one.normal[:, 0] == pytest.approx(-other.normal[:, 0], abs=1e-9):
        assert one.first == pytest.approx(other.second, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(
    kinds,
    kinds,
    st.tuples(numbers, numbers, numbers),
    st.tuples(numbers, numbers, numbers),
    st.tuples(numbers, numbers, numbers),
)
def test_rigid_motions_carry_the_points_along(
    a: int,
    b: int,
    at_a: tuple[float, float, float],
    at_b: tuple[float, float, float],
    by: tuple[float, float, float],
) -> None:
    angle = 6.0 * by[2]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def carried(p: Array) -> Array:
        q = p.copy()
        q[:2] = turn @ p[:2] + np.array(by[:2])[:, None]
        q[5] += angle
        return q

    here = touch(drawn(a, at_a), a, drawn(b, at_b), b)
    there = touch(carried(drawn(a, at_a)), a, carried(drawn(b, at_b)), b)
    if len(here) == len(there) == 1 and (turn @ here.normal) == pytest.approx(there.normal, abs=1e-9):
        assert turn @ here.first == pytest.approx(there.first, abs=1e-9)
    assert min(here.distance, default=0.0) == pytest.approx(min(there.distance, default=0.0), abs=1e-9)


def test_a_pair_s_points_do_not_depend_on_its_company(rng: np.random.Generator) -> None:
    a, b = (rng.integers(0, len(SHAPES), 40) for _ in range(2))
    pose_a, pose_b = poses(40, a, rng), poses(40, b, rng)
    geometry = Manifolds(AXES, SHAPES)
    whole = geometry.touch(pose_a, a, pose_b, b)
    for k in range(40):
        alone = geometry.touch(pose_a[:, [k]], a[[k]], pose_b[:, [k]], b[[k]])
        own = whole.pair == k
        for name in ("normal", "first", "second", "distance"):
            assert np.array_equal(getattr(whole, name)[..., own], getattr(alone, name))
