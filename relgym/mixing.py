"""Whole numbers that look random and are the same on every machine: hashes, and choices that nobody has to remember.

References
----------
Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["GOLDEN", "MOST", "mixed", "mixed_one"]

GOLDEN: Final = 0x9E3779B97F4A7C15
"""What splitmix64 adds to its state for each output: 2^64 over the golden ratio."""

_FIRST, _SECOND, _LAST = 30, 27, 31
_FACTORS = 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
MOST: Final = (1 << 64) - 1
"""The largest of these numbers."""


def mixed(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Scatter the bits of each number: the output of splitmix64 in such a state. Different numbers stay different."""
    x = (x ^ (x >> np.uint64(_FIRST))) * np.uint64(_FACTORS[0])
    x = (x ^ (x >> np.uint64(_SECOND))) * np.uint64(_FACTORS[1])
    return x ^ (x >> np.uint64(_LAST))


def mixed_one(x: int) -> int:
    """The same of one whole number, modulo 2^64.

    Examples
    --------
    >>> [hex(mixed_one(k * GOLDEN)) for k in (1, 2)]
    ['0xe220a8397b1dcdaf', '0x6e789e6aa1b965f4']
    """
    x &= MOST
    x = ((x ^ (x >> _FIRST)) * _FACTORS[0]) & MOST
    x = ((x ^ (x >> _SECOND)) * _FACTORS[1]) & MOST
    return x ^ (x >> _LAST)
