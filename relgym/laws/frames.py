"""Frames that a scene offers to a contact of two bodies: directions along which a law may be stated.

=========  ================================================================================================
contact    the contact's normal (from B to A), and the direction in which the free motion slips along it
point      the same, for the velocities of the points that touch: surfaces slip, not centres (bodies that spin)
turned     the normal, and the normal turned by 90 degrees (in the plane only)
centres    the line from B's centre to A's, and the slip direction across it
world      the world's axes
own        A's own axes
=========  ================================================================================================

Slip is that of the velocities which the bodies would have without this contact. Where nothing slips, the
direction across is the turned normal in the plane, and none in space: the law holds either way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relgym.scene.geometry.vectors import FloatArray, dot, norm, rotation

__all__ = ["FRAMES", "NORMAL_FRAMES", "POINT", "Bearings", "axes_of", "axis_names", "turned"]

POINT = "point"
"""Name of the frame in which velocities are those of the points that touch."""

FRAMES = ("contact", POINT, "turned", "centres", "own", "world")
"""All frames; of two that explain equally well the earlier is preferred."""

NORMAL_FRAMES = ("contact", "turned")
"""Frames along contact normals for the velocities of centres."""

_LETTERS = {"contact": "nt", POINT: "nt", "turned": "ns", "centres": "ct", "own": "abc", "world": "xyz"}


@dataclass(frozen=True, slots=True)
class Bearings:
    """Directions at n contacts (any shape for n).

    Attributes
    ----------
    normal, centres
        Unit vectors from B to A, shape ``(d, n)``.
    angles
        A's rotation about x, y, z, shape ``(3, n)``; in the plane about the depth axis, thrice.
    """

    normal: FloatArray
    centres: FloatArray
    angles: FloatArray

    def take(self, chosen: object) -> Bearings:
        """Bearings of some of the contacts: any index into the axes after the components."""
        index = (slice(None), *(chosen if isinstance(chosen, tuple) else (chosen,)))
        return Bearings(self.normal[index], self.centres[index], self.angles[index])


def axis_names(frame: str, dimensions: int) -> tuple[str, ...]:
    """How a frame's axes are called: ``("n", "t")``."""
    letters = _LETTERS[frame]
    return tuple(letters[: dimensions if frame in ("own", "world") else 2])


def axes_of(frame: str, bearings: Bearings, slipping: FloatArray) -> list[FloatArray]:
    """Unit vectors of a frame's axes at n contacts, each of shape ``(d, n)``.

    Parameters
    ----------
    frame
        One of `FRAMES`; ``"turned"`` in the plane only.
    bearings
        Directions at the contacts.
    slipping
        Relative velocity whose slip counts, shape ``(d, n)``.
    """
    if frame in ("contact", POINT):
        return [bearings.normal, _across(bearings.normal, slipping)]
    if frame == "centres":
        return [bearings.centres, _across(bearings.centres, slipping)]
    if frame == "turned":
        return [bearings.normal, turned(bearings.normal)]
    d = len(slipping)
    if frame == "world":
        return [np.broadcast_to(_unit(k, slipping), slipping.shape) for k in range(d)]
    if d == 2:
        cos, sin = np.cos(bearings.angles[2]), np.sin(bearings.angles[2])
        return [np.stack([cos, sin]), np.stack([-sin, cos])]
    matrix = rotation(bearings.angles)
    return [np.stack([matrix[i][k] for i in range(d)]) for k in range(d)]


def _unit(k: int, like: FloatArray) -> FloatArray:
    axis = np.zeros((len(like), *(1 for _ in like.shape[1:])))
    axis[k] = 1.0
    return axis


def turned(normal: FloatArray) -> FloatArray:
    """Normals in the plane, turned by 90 degrees."""
    return np.stack([-normal[1], normal[0]])


def _across(normal: FloatArray, velocity: FloatArray) -> FloatArray:
    """Direction of the part of a velocity across a normal."""
    if len(normal) == 2:  # exactly across, whatever rounding does to a slow slip
        side = turned(normal)
        return np.where(dot(velocity, side) < 0.0, -side, side)
    part = velocity - dot(velocity, normal) * normal
    length = norm(part)
    return part / np.where(length > 0.0, length, 1.0)
