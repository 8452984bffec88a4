"""Bodies that can't be."""

from __future__ import annotations

import pytest

from relgym.errors import ShapeError
from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere
from relgym.scene.sizes import check_sizes

BALL = ObjectType("ball", ("px", "sx", "sy"), Sphere())
BOX = ObjectType("box", ("px", "sx"), Box())
NUMBER = ObjectType("number", ("x",))
SCHEMA = SceneSchema((BALL, BOX, NUMBER), (("a", "ball"), ("b", "box"), ("n", "number")))


def test_extents_are_positive_and_spheres_round() -> None:
    check_sizes(SCHEMA.scene({"a": [0.0, 1.0, 1.0], "b": [0.0, 2.0], "n": [-1.0]}))
    check_sizes(SCHEMA.scene({"n": [0.0]}))
    with pytest.raises(ShapeError, match=r"'b': extent sx must be positive, got -2\.0"):
        check_sizes(SCHEMA.scene({"a": [0.0, 1.0, 1.0], "b": [0.0, -2.0]}))
    with pytest.raises(ShapeError, match="'a' is a sphere"):
        check_sizes(SCHEMA.scene({"a": [0.0, 1.0, 1e300]}))
