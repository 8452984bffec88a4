"""Arithmetic on arrays of vectors, components first, written out so that no bit depends on the batch.

Geometry keeps components first and scenes last: ``(d, ..., n)``. Every sum is written out element by
element. A BLAS product, `einsum` or `sum` may group terms differently for different batch sizes, and then a
scene's result would depend on its company (single and batched prediction agree bit for bit).
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["FloatArray", "Matrix", "cross", "dot", "norm", "pick", "rotate", "rotation"]

FloatArray: TypeAlias = NDArray[np.float64]
"""A float64 array of any rank."""

Matrix: TypeAlias = tuple[tuple[FloatArray, ...], ...]
"""Rows of a square matrix per body and scene."""


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Inner product over the leading axis of 2 or 3 components."""
    total: FloatArray = a[0] * b[0] + a[1] * b[1]
    return total if len(a) == 2 else total + a[2] * b[2]


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product over the leading axis of 3 components."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    return np.stack([x, y, a[0] * b[1] - a[1] * b[0]])


def norm(a: FloatArray) -> FloatArray:
    """Euclidean length over the leading axis."""
    length: FloatArray = np.sqrt(dot(a, a))
    return length


def rotation(angles: FloatArray) -> Matrix:
    """Return the rotation R = Rz Ry Rx for angles about x, y and z, shape ``(3, ...)``."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    return (
        (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        (sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        (-sy, cy * sx, cy * cx),
    )


def rotate(matrix: Matrix, vectors: FloatArray) -> FloatArray:
    """Apply a rotation to vectors of shape ``(d, m, B, n)``; the matrix' entries have shape ``(B, n)``."""
    out = np.empty(np.broadcast_shapes(vectors.shape, matrix[0][0].shape))
    for k, row in enumerate(matrix):
        out[k] = row[0] * vectors[0] + row[1] * vectors[1]
        if len(row) == 3:
            out[k] += row[2] * vectors[2]
    return out


def pick(choice: NDArray[np.intp], *arrays: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """From arrays ``([d,] m, P, n)``, take the entry of the m axis that `choice`, ``(P, n)``, names."""
    size = choice.size
    flat = choice.ravel() * size + np.arange(size)
    out = []
    for array in arrays:
        lead = array.shape[: -1 - choice.ndim]
        taken = array.reshape(*lead, -1).take(flat, axis=-1)
        out.append(taken.reshape(lead + choice.shape))
    return tuple(out)
