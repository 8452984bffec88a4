"""Nearest points of two sets of segments in space."""

from __future__ import annotations

import numpy as np

from relgym.scene.geometry.vectors import FloatArray, cross, dot, norm, pick

__all__ = ["nearest_edges"]

_PARALLEL = 1e-20
"""Squared sine below which two segments count as parallel: then either of them may supply the nearest end."""

_SKEW = 1e-6
"""Sine above which two edges' cross product is a better normal than the line between nearest points."""


def nearest_edges(
    offset: FloatArray, starts_a: FloatArray, edges_a: FloatArray, starts_b: FloatArray, edges_b: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Distance and normal between the nearest of a's edges and b's, which must not meet.

    Parameters
    ----------
    offset
        Position of a minus that of b, shape ``(3, P, n)``.
    starts_a, edges_a, starts_b, edges_b
        Ends relative to the positions and vectors along the edges, shape ``(3, E, P, n)``.

    Returns
    -------
    Distance ``(1, P, n)`` and unit normal from b to a ``(3, 1, P, n)``.

    Notes
    -----
    Ericson, Real-Time Collision Detection (2005), §5.1.9. Cost: E_a E_b segment pairs.
    """
    u, v = edges_a[:, :, None], edges_b[:, None]
    apart = offset[:, None, None] + (starts_a[:, :, None] - starts_b[:, None])
    uu, vv, uv = dot(u, u), dot(v, v), dot(u, v)
    ua, va = dot(u, apart), dot(v, apart)
    span = uu * vv - uv * uv
    skew = span > _PARALLEL * uu * vv
    s = np.where(skew, _unit((uv * va - ua * vv) / np.where(skew, span, 1.0)), 0.0)
    t = _unit((uv * s + va) / vv)
    s = _unit((uv * t - ua) / uu)
    spoke = (apart + s * u) - t * v
    lengths = norm(spoke)
    every = (-1, *lengths.shape[2:])
    flat = lengths.reshape(every)
    distance, spoke, s, t, normal = pick(
        flat.argmin(axis=0),
        flat,
        spoke.reshape(3, *flat.shape),
        s.reshape(flat.shape),
        t.reshape(flat.shape),
        (cross(u, v) / np.sqrt(uu * vv)).reshape(3, *flat.shape),
    )
    # Between the insides of two edges the direction is their cross product; exact even when the gap is tiny.
    sine = norm(normal)
    inner = (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0) & (sine > _SKEW)
    length = np.where(inner, sine, 1.0)
    signed = np.where(dot(normal, spoke) < 0.0, -normal, normal) / length
    straight = spoke / np.where(distance > 0.0, distance, 1.0)
    return distance[None], np.where(inner, signed, straight)[:, None]


def _unit(a: FloatArray) -> FloatArray:
    clipped: FloatArray = np.minimum(np.maximum(a, 0.0), 1.0)
    return clipped
