"""Sines and cosines in plain arithmetic, for processors that have no library of them.

After Sun's fdlibm (`k_sin.c`, `k_cos.c`, `e_rem_pio2.c`): off by less than a unit in the last place up to 1e6 radians,
and beyond by no more than the last bit of the angle itself. Written as `relgym.program.compiling` reads it.
"""

from __future__ import annotations

import numpy as np

__all__ = ["cosine", "sine"]

QUARTERS = 6.36619772367581382433e-01
"""Quarter turns of a radian."""

FIRST, SECOND, THIRD = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
"""A quarter turn in three parts, the first two of 33 bits: their products with up to 20 bits are exact."""


def rest_of(x, turns):
    """What quarter turns leave of an angle, and what that lacks."""
    whole = x - turns * FIRST
    w = turns * SECOND
    r = whole - w
    w = turns * THIRD - ((whole - r) - w)
    y = r - w
    return y, (r - y) - w


def sine_within(x, lacks):
    """Sine of an angle within an eighth of a turn, and what that angle lacks."""
    z = x * x
    v = z * x
    r = 8.33333333332248946124e-03 + z * (
        -1.98412698298579493134e-04
        + z
        * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
    )
    return x - ((z * (0.5 * lacks - v * r) - lacks) - v * -1.66666666666666324348e-01)


def cosine_within(x, lacks):
    """Cosine of the same."""
    z = x * x
    r = z * (
        4.16666666666666019037e-02
        + z
        * (
            -1.38888888888741095749e-03
            + z
            * (
                2.48015872894767294178e-05
                + z
                * (
                    -2.75573143513906633035e-07
                    + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
                )
            )
        )
    )
    half = 0.5 * z
    w = 1.0 - half
    return w + (((1.0 - w) - half) + (z * r - x * lacks))


def turned(x, ahead):
    """Sine of an angle and so many quarter turns more."""
    turns = np.round(x * QUARTERS)
    y, lacks = rest_of(x, turns)
    quarter = (np.int64(turns) + ahead) & 3
    value = cosine_within(y, lacks) if quarter & 1 else sine_within(y, lacks)
    return -value if quarter & 2 else value


def sine(x):
    """Sine of an angle in radians."""
    return turned(x, np.int64(0))


def cosine(x):
    """Its cosine."""
    return turned(x, np.int64(1))
