"""Small schemas and random scenes that several test modules use."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from relgym.scene.objects import SceneLayout
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, ConvexPolyhedron, Prism, Shape, Sphere, Wedge
from relgym.scene.types import POSE, ObjectType

PENTAGON = Prism(tuple((math.cos(a) / 2, math.sin(a) / 2) for a in np.arange(5) * 2 * math.pi / 5))
HULL = ConvexPolyhedron(
    ((0.5, 0, 0), (-0.4, 0.1, 0), (0, 0.5, 0.1), (0, -0.5, 0), (0.1, 0.2, 0.5), (0, 0, -0.5))
)
KINDS: Mapping[str, Shape] = {
    "ball": Sphere(),
    "box": Box(),
    "hull": HULL,
    "pentagon": PENTAGON,
    "ramp": Wedge(),
}


def schema_of(kinds: Sequence[str], *, planar: bool = True, up: str = "y") -> SceneSchema:
    """Objects `o0`, `o1`, … of these kinds; all have a full pose and a velocity, balls a parent type."""
    types = tuple(
        ObjectType(
            name,
            (*POSE, "vx", "vy", "vz"),
            shape,
            parent="round" if name == "ball" else None,
            velocity=("vx", "vy", "vz"),
        )
        for name, shape in KINDS.items()
    )
    return SceneSchema(types, tuple((f"o{k}", kind) for k, kind in enumerate(kinds)), up=up, planar=planar)


def random_vectors(
    layout: SceneLayout, n: int, rng: np.random.Generator, *, spread: float = 1.5, turned: float = 4.0
) -> np.ndarray:
    """State vectors of n scenes, shape ``(n, layout.width)``; a third of the rotations are zero."""
    values = np.empty((n, len(layout.names), 12))
    size = values.shape[:2]
    values[..., :3] = rng.uniform(-spread, spread, (*size, 3))
    values[..., 3:6] = rng.uniform(-turned, turned, (*size, 3)) * (rng.random((*size, 1)) > 1 / 3)
    values[..., 6:9] = rng.uniform(0.2, 1.5, (*size, 3))
    values[..., 9:] = rng.uniform(-1.0, 1.0, (*size, 3))
    round_ = [isinstance(t.shape, Sphere) for t in layout.types]
    values[:, round_, 6:9] = values[:, round_, 6:7]
    return values.reshape(n, -1)
