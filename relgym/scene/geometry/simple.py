"""Pairs whose distance has a closed form, in the plane and in space: spheres, and boxes along the axes."""

from __future__ import annotations

import numpy as np

from relgym.scene.geometry.vectors import FloatArray, norm

__all__ = ["aligned_boxes", "spheres"]


def spheres(offset: FloatArray, reach: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Signed distance and normal of spheres; the last axis (up, in the plane) where centres coincide.

    Parameters
    ----------
    offset
        First centre minus second, shape ``(d, P, n)``.
    reach
        Sum of the radii, shape ``(P, n)``.
    """
    length = norm(offset)
    apart = length > 0.0
    normal = offset / np.where(apart, length, 1.0)
    normal[-1] = np.where(apart, normal[-1], 1.0)
    return length - reach, normal


def aligned_boxes(offset: FloatArray, reach: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Signed distance and normal of boxes that aren't rotated.

    Parameters
    ----------
    offset
        First position minus second, shape ``(d, P, n)``.
    reach
        Sum of the half extents along each axis, shape ``(d, P, n)``.
    """
    gaps = np.abs(offset) - reach
    depth = gaps.max(axis=0)
    between = np.maximum(gaps, 0.0)
    apart = depth > 0.0
    distance = np.where(apart, norm(between), depth)
    axes = np.arange(len(gaps)).reshape(-1, *(1 for _ in depth.shape))
    # Where they overlap, the way out is along the axis of least overlap; else towards the nearest part.
    out = np.where(apart, between / np.where(apart, distance, 1.0), axes == gaps.argmax(axis=0))
    return distance, np.where(offset < 0.0, -out, out)
