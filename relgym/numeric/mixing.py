"""Whole numbers that look random and are the same on every machine: choices that no generator has to remember."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import SPLITMIX, SPLITMIX_STEP

__all__ = ["mixed"]

_Words = TypeVar("_Words", int, NDArray[np.uint64])

_MASK = np.iinfo(np.uint64).max


def mixed(number: _Words, start: _Words) -> _Words:
    """The number-th output of splitmix64, modulo 2^64.

    Parameters
    ----------
    number
        From 0 to 2^64 - 1, one or an array of type uint64.
    start
        State of the generator before its first output, likewise.

    References
    ----------
    Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.

    Examples
    --------
    >>> [hex(mixed(k, 0)) for k in (1, 2)]
    ['0xe220a8397b1dcdaf', '0x6e789e6aa1b965f4']
    """
    x = (start + number * SPLITMIX_STEP) & _MASK
    for shift, factor in SPLITMIX:
        x = ((x ^ (x >> shift)) * factor) & _MASK
    return x
