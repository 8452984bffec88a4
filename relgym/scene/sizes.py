"""Whether the bodies of a scene can be: extents are positive, and spheres round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.scene.axes import Axes
from relgym.scene.geometry.arrays import Bodies, check_extents
from relgym.scene.objects import Scene, pose_columns
from relgym.scene.shapes import Sphere

__all__ = ["check_sizes"]


@dataclass(slots=True)
class _Plan:
    """What must be known of a layout: axes, its bodies, the columns of their poses, which are spheres, and extents."""

    up: str
    planar: bool
    axes: Axes
    bodies: Bodies
    columns: NDArray[np.intp]
    constants: NDArray[np.float64]
    spheres: NDArray[np.intp]
    scaled: NDArray[np.intp]
    fine: bytes | None = None  # the latest extents that can be: they rarely change


def check_sizes(scene: Scene) -> None:
    """Raise `ShapeError`, naming the object, where an extent isn't positive or a sphere isn't round.

    Cost O(bodies), some microseconds.
    """
    plan = _plan(scene)
    if not plan.bodies.names:
        return
    sizes = scene.vector.take(plan.scaled).tobytes()
    if sizes != plan.fine:
        padded = np.concatenate([scene.vector, plan.constants])
        check_extents(plan.bodies, plan.axes, padded[plan.columns][:, :, None], plan.spheres)
        plan.fine = sizes


def _plan(scene: Scene) -> _Plan:
    """What must be known of a layout; cached on it."""
    layout, schema = scene.layout, scene.schema
    known: _Plan | None = layout.__dict__.get("_sizes")
    if known is None or known.up != schema.up or known.planar != schema.planar:
        columns, constants = pose_columns(layout)
        shapes = tuple(shape for i in layout.bodies if (shape := layout.types[i].shape) is not None)
        spheres = np.flatnonzero([isinstance(shape, Sphere) for shape in shapes])
        bodies = Bodies(tuple(layout.names[i] for i in layout.bodies), shapes)
        extents = columns[:, 6:9]
        scaled = np.unique(extents[extents < layout.width])
        known = layout.__dict__["_sizes"] = _Plan(
            schema.up,
            schema.planar,
            Axes.of(schema),
            bodies,
            columns.T.copy(),
            constants,
            spheres,
            scaled,
        )
    return known
