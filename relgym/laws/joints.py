"""How a contact and its two bodies hang together: which velocity it acts on, and who takes which part of its effect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.laws.frames import turned
from relgym.scene.geometry.vectors import FloatArray, dot

__all__ = ["Joint", "Joints", "Where"]

Where = tuple[NDArray[np.intp], int]
"""Some scenes of a group, and the number of a contact in each."""


@dataclass(frozen=True, slots=True)
class Joint:
    """One contact in each of n scenes.

    Attributes
    ----------
    scenes
        Which scenes, of those whose velocities are handed in.
    first, second
        The bodies of each contact, shape ``(n,)``.
    normal
        Contact normals, shape ``(d, n)``.
    share
        The first body's part of a change of the relative velocity, shape ``(n,)``; the second one has the rest.
    grip
        Which part of a change along the slip direction velocities take, shape ``(n,)``; spins take the rest. None
        where laws are about the velocities of centres.
    arms
        How far from their centres the bodies are touched if they spin, shape ``(2, n)``.

    Notes
    -----
    A body's surface moves with its centre and turns about it: where bodies spin, the relative velocity is that of the
    points that touch. A force on a surface moves the centre and turns the body; which part does which is its `grip`.
    """

    scenes: NDArray[np.intp]
    first: NDArray[np.intp]
    second: NDArray[np.intp]
    normal: FloatArray
    share: FloatArray
    grip: FloatArray | None
    arms: FloatArray

    def relative(self, moving: FloatArray) -> FloatArray:
        """Relative velocities, shape ``(d, n)``, from those of all bodies (and spins), ``(d [+ 1], m, K)``."""
        d = len(self.normal)
        a, b = moving[:, self.scenes, self.first], moving[:, self.scenes, self.second]
        centres: FloatArray = a[:d] - b[:d]
        if self.grip is None:
            return centres
        points: FloatArray = centres - (a[d] * self.arms[0] + b[d] * self.arms[1]) * turned(self.normal)
        return points

    def apply(self, change: FloatArray, moving: FloatArray) -> None:
        """Let a change of the relative velocity, shape ``(d, n)``, act on all bodies' velocities, in place."""
        d, slides = len(self.normal), change
        if self.grip is not None:
            along = dot(change, self.normal) * self.normal
            slides = along + self.grip * (change - along)
            self._turn((1.0 - self.grip) * dot(change, turned(self.normal)), moving)
        moving[:d, self.scenes, self.first] += self.share * slides
        moving[:d, self.scenes, self.second] -= (1.0 - self.share) * slides

    def _turn(self, rest: FloatArray, moving: FloatArray) -> None:
        """Let spins take a change of the surfaces' relative velocity; of two that spin each its body's share."""
        spins = self.arms != 0.0
        both = spins.all(axis=0)
        for arm, spin, body, share in zip(
            self.arms, spins, (self.first, self.second), (self.share, 1.0 - self.share), strict=True
        ):
            part = np.where(both, share, 1.0) * rest
            moving[-1, self.scenes, body] -= np.where(spin, part / np.where(spin, arm, 1.0), 0.0)


@dataclass(frozen=True, slots=True)
class Joints:
    """What `Joint` knows of all c contacts of m scenes, bodies and normals apart.

    Attributes
    ----------
    share
        Shape ``(m, c)``.
    grip
        Shape ``(m, c)``, or None.
    arms
        Shape ``(2, m, c)``.
    """

    share: FloatArray
    grip: FloatArray | None
    arms: FloatArray

    def known(self) -> NDArray[np.bool_]:
        """Whether share and grip are known, shape ``(m, c)``."""
        known: NDArray[np.bool_] = np.isfinite(self.share)
        return known if self.grip is None else known & np.isfinite(self.grip)

    def at(
        self,
        scenes: NDArray[np.intp],
        contact: int,
        first: NDArray[np.intp],
        second: NDArray[np.intp],
        normal: FloatArray,
    ) -> Joint:
        """One contact of some of the scenes."""
        grip = None if self.grip is None else self.grip[scenes, contact]
        share, arms = self.share[scenes, contact], self.arms[:, scenes, contact]
        return Joint(scenes, first, second, normal, share, grip, arms)
