"""Compounds: the nearest part decides distances, boxes hold all parts, and what can't be is refused."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import affinity
from shapely.geometry import Point, Polygon
from shapely.ops import unary_union

from relgym.errors import ConfigError, ShapeError
from relgym.model.files.storage import shape_from_json, shape_to_json
from relgym.scene import Compound, Extractor, ObjectType, SceneSchema
from relgym.scene.geometry.arrays import ArrayGeometry, Bodies
from relgym.scene.objects import POSE
from relgym.scene.shapes import Box, Sphere

BEAMS = Compound(
    (
        ((-0.5, 0.1), (0.5, 0.1), (0.5, 0.4), (-0.5, 0.4)),
        ((-0.15, -0.6), (0.15, -0.6), (0.15, 0.1), (-0.15, 0.1)),
    )
)


def schema(*, planar: bool = True) -> SceneSchema:
    types = (
        ObjectType("beam", POSE, BEAMS),
        ObjectType("box", POSE, Box()),
        ObjectType("disc", POSE, Sphere()),
    )
    objects = (("beam", "beam"), ("other", "beam"), ("box", "box"), ("disc", "disc"))
    return SceneSchema(types, objects, planar=planar)


def outlines_of(pose: np.ndarray, kind: int) -> object:  # type: ignore[type-arg]
    if kind == 3:
        return Point(pose[0], pose[1]).buffer(0.5 * pose[6], quad_segs=4_000)
    parts = BEAMS.parts if kind < 2 else (((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)),)
    whole = unary_union([Polygon(part) for part in parts])
    scaled = affinity.scale(whole, pose[6], pose[7], origin=(0, 0))
    turned = affinity.rotate(scaled, pose[5], origin=(0, 0), use_radians=True)
    return affinity.translate(turned, pose[0], pose[1])


def test_distances_are_those_of_the_nearest_parts(rng: np.random.Generator) -> None:
    world = schema()
    layout = world.layout()
    vectors = np.zeros((60, layout.width))
    for k in range(4):
        part = layout.slice(k)
        rows = vectors[:, part]
        rows[:, :2], rows[:, 5] = rng.uniform(-1.5, 1.5, (60, 2)), rng.uniform(-3.0, 3.0, 60)
        rows[:, 6:9] = rng.uniform(0.4, 1.0, (60, 3)) if k < 3 else 0.5
    distance = Extractor(world).extract(layout, vectors).distance
    one = np.stack([Extractor(world).extract(layout, vectors[[k]]).distance[0] for k in range(60)])
    assert np.array_equal(distance, one)
    for n in range(60):
        solids = [outlines_of(vectors[n, layout.slice(k)], k) for k in range(4)]
        for a in range(4):
            for b in range(a):
                apart = solids[a].distance(solids[b])  # type: ignore[attr-defined]
                assert max(distance[n, a, b], 0.0) == pytest.approx(apart, abs=1e-6)


def test_bounding_boxes_hold_all_parts() -> None:
    geometry = ArrayGeometry(
        Extractor(schema()).axes, Bodies(("disc", "beam", "box"), (Sphere(), BEAMS, Box()))
    )
    pose = np.zeros((9, 3, 1))
    pose[6:] = 1.0
    pose[5, 1] = np.pi / 2.0
    measured = geometry.measure(pose)
    assert measured.low[:, 1, 0] == pytest.approx([-0.4, -0.5])
    assert measured.high[:, 1, 0] == pytest.approx([0.6, 0.5])


def test_files_hold_compounds() -> None:
    assert shape_from_json(shape_to_json(BEAMS)) == BEAMS


def test_compounds_need_a_plane_and_the_array_geometry() -> None:
    world = schema(planar=False)
    with pytest.raises(ShapeError, match="'beam' is a compound of polygons: use a planar schema"):
        Extractor(world).extract(world.layout(), np.ones((1, world.layout().width)))
    flat = schema()
    with pytest.raises((ShapeError, ConfigError), match="use geometry='arrays', which measures each part"):
        Extractor(flat, geometry="fcl").extract(flat.layout(), np.ones((1, flat.layout().width)))


def test_parts_are_checked() -> None:
    with pytest.raises(ShapeError, match="a compound needs at least one part, got none"):
        Compound(())
    with pytest.raises(ShapeError, match="corner 1"):
        Compound((((0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, 1.0)),))
