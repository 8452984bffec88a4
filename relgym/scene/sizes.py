"""Whether the bodies of a scene can be: extents are positive, and spheres round."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.scene.axes import Axes
from relgym.scene.geometry.arrays import Bodies, check_extents
from relgym.scene.objects import Scene, pose_columns
from relgym.scene.shapes import Sphere

__all__ = ["check_sizes"]

_Plan: TypeAlias = tuple[
    Axes, Bodies, NDArray[np.intp], NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]
]


def check_sizes(scene: Scene) -> None:
    """Raise `ShapeError`, naming the object, where an extent isn't positive or a sphere isn't round.

    Cost O(bodies), some microseconds.
    """
    axes, bodies, columns, constants, spheres, scaled = _plan(scene)
    fine = f"_sizes-fine-{scene.schema.up}-{scene.schema.planar}"
    if len(bodies.names):
        sizes = scene.vector[scaled]
        if sizes.tobytes() != scene.layout.__dict__.get(fine):
            padded = np.concatenate([scene.vector, constants])
            check_extents(bodies, axes, padded[columns][:, :, None], spheres)
            scene.layout.__dict__[fine] = sizes.tobytes()  # sizes rarely change


def _plan(scene: Scene) -> _Plan:
    """What must be known of a layout; cached on it."""
    layout, key = scene.layout, f"_sizes-{scene.schema.up}-{scene.schema.planar}"
    known: _Plan | None = layout.__dict__.get(key)
    if known is None:
        columns, constants = pose_columns(layout)
        shapes = tuple(shape for i in layout.bodies if (shape := layout.types[i].shape) is not None)
        spheres = np.flatnonzero([isinstance(shape, Sphere) for shape in shapes])
        bodies = Bodies(tuple(layout.names[i] for i in layout.bodies), shapes)
        extents = columns[:, 6:9]
        scaled = np.unique(extents[extents < layout.width])
        known = layout.__dict__[key] = (
            Axes.of(scene.schema),
            bodies,
            columns.T.copy(),
            constants,
            spheres,
            scaled,
        )
    return known
