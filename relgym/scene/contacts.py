"""A pair of bodies' contact as numbers: distance, normal and relative velocity.

A ball that bounces and a ball that leaves have the same spatial relations; the sign of the relative
velocity along the contact normal tells them apart (§4.8's main failure). None of the features names an
axis's or a surface's meaning: they hold for any pair of bodies. They are beyond the thesis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing
from relgym.errors import QueryError
from relgym.scene.axes import Axes
from relgym.scene.geometry.vectors import FloatArray, dot, norm
from relgym.scene.objects import SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = ["APPROACH_EPS", "CONTACT_FEATURES", "contact_features", "motion", "velocity_columns"]

CONTACT_FEATURES = ("distance", "normal-x", "normal-y", "approach", "slip")
"""Contact features of the pair (A, B) in a planar schema with y up; `contact_features` gives any schema's.

========== ==================================================================================================
distance   signed distance; negative by the penetration depth
normal-*   components of the unit normal from B to A
approach   (v_A - v_B) . n, in length per step: negative while A and B approach
slip       tangential relative velocity: along t = (-n_y, n_x) in the plane, its magnitude in space
offset-*   components of A's position minus B's, if the schema asks for them (`SceneSchema.offsets`)
========== ==================================================================================================
"""

APPROACH_EPS = 1e-9
"""Normal velocities up to this, in length per step, count as approaching.

A sliding body's normal velocity is 0 up to rounding (1e-18), a leaving one's is of the order of the
velocities (> 1e-4 in the envs here). Resting and sliding contacts must count, since they too decide the
next velocity.
"""


@refusing(QueryError)
def contact_features(schema: SceneSchema) -> tuple[str, ...]:
    """Names of a schema's contact features, in the order of `Relations.contacts`."""
    axes = Axes.of(schema).names
    offsets = [f"offset-{axis}" for axis in axes] if schema.offsets else []
    return ("distance", *(f"normal-{axis}" for axis in axes), "approach", "slip", *offsets)


def velocity_columns(layout: SceneLayout, axes: Axes) -> NDArray[np.intp]:
    """Column of every body's velocity along the used axes, shape ``(d, K)``; -1 where it has none."""
    columns = np.full((len(axes.used), len(layout.bodies)), -1, dtype=np.intp)
    for k, i in enumerate(layout.bodies):
        own = layout.types[i].velocity_columns()
        for d, axis in enumerate(axes.used):
            columns[d, k] = -1 if own[axis] < 0 else layout.offsets[i] + own[axis]
    return columns


def motion(relative: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Approach and slip of pairs, from relative velocities and unit normals of shape ``(d, ...)``."""
    approach = dot(relative, normal)
    if len(normal) == 2:
        return approach, normal[0] * relative[1] - normal[1] * relative[0]
    return approach, norm(relative - approach * normal)
