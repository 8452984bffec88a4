"""Area and mean squares of a shape in the plane: what mass and moment of a body of uniform density follow from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relgym.scene.geometry.vectors import FloatArray
from relgym.scene.shapes import Shape, Sphere, outlines

__all__ = ["mean_squares"]


def mean_squares(shapes: Sequence[Shape], plane: tuple[int, int]) -> FloatArray:
    """Integrals over canonical shapes: area, and means of the squares of both coordinates, shape ``(3, B)``.

    Parameters
    ----------
    shapes
        The shapes, compounds as the sum of their parts.
    plane
        World axes that are first and up.

    Notes
    -----
    With extents s and t the area is ``area * s * t``, and the mean square distance from the position
    ``x2 * s^2 + y2 * t^2``: for uniform density that is moment over mass, if the position is the centroid.
    """
    found = np.zeros((3, len(shapes)))
    for b, shape in enumerate(shapes):
        if isinstance(shape, Sphere):
            found[:, b] = np.pi / 4.0, 1.0 / 16.0, 1.0 / 16.0
            continue
        for corners in outlines(shape, plane):
            after = np.roll(corners, -1, axis=0)
            twice = corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]
            squares = corners**2 + corners * after + after**2
            found[0, b] += 0.5 * float(twice.sum())
            found[1:, b] += (twice[:, None] * squares).sum(axis=0) / 12.0
        found[1:, b] /= found[0, b]
    return found
