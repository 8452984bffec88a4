"""Pairs of numbers that are cosine and sine of an angle: found, decoded and encoded."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from relgym.scene.objects import Float1D

__all__ = ["SLACK", "candidates", "circular", "decoded", "disjoint", "on_circle", "tolerance"]

SLACK = 10.0
"""So many times the tolerance a pair that was taken for an angle may be off the circle before it is none."""


def tolerance(single: bool) -> float:
    """How far cos² + sin² may be off 1 by rounding alone (float32, or float64)."""
    return 1e-6 if single else 1e-12


def candidates(low: Float1D, high: Float1D) -> tuple[tuple[int, int], ...]:
    """Pairs of neighbouring numbers that may be (cos, sin), as far as their bounds tell.

    Both reach exactly from -1 to 1, or both are unbounded.
    """
    unit = (low == -1.0) & (high == 1.0)
    unbounded = np.isneginf(low) & np.isposinf(high)
    both = (unit[:-1] & unit[1:]) | (unbounded[:-1] & unbounded[1:])
    return tuple((int(k), int(k) + 1) for k in np.flatnonzero(both))


def on_circle(cos: float, sin: float, *, single: bool) -> bool:
    """Whether two numbers may still be cosine and sine of an angle that they were taken for."""
    return abs(cos * cos + sin * sin - 1.0) <= SLACK * tolerance(single)


def circular(values: NDArray[np.float64], pair: tuple[int, int], *, bounded: bool, single: bool) -> bool:
    """Whether a pair lies on the unit circle in every one of these observations.

    Parameters
    ----------
    values
        Some observations, shape ``(n, width)``, n >= 1.
    pair
        Two columns.
    bounded
        Whether the space says [-1, 1]. Where it doesn't, the axes' points (1, 0), (0, 1), … prove nothing:
        unbounded numbers often start at 0 or 1.
    single
        Whether the numbers were rounded to float32.
    """
    cos, sin = values[:, pair[0]], values[:, pair[1]]
    if not (np.abs(cos * cos + sin * sin - 1.0) <= tolerance(single)).all():
        return False
    return bounded or bool(((cos != 0.0) & (sin != 0.0)).any())


def disjoint(pairs: Sequence[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
    """Those of the pairs, first come first served, that share no number with an earlier one."""
    taken: set[int] = set()
    chosen = []
    for pair in pairs:
        if taken.isdisjoint(pair):
            chosen.append(pair)
            taken.update(pair)
    return tuple(chosen)


def decoded(cos: float, sin: float, *, single: bool) -> float:
    """The angle, in radians, within [-π, π]; of float32 numbers rounded to float32, so that it shows its precision."""
    angle = math.atan2(sin, cos)
    return float(np.float32(angle)) if single else angle
