"""Rows that are alike: what is worked out for one of them holds for all."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["distinct", "members"]


def distinct(*parts: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Group rows that are equal in all parts.

    Parameters
    ----------
    parts
        Arrays of booleans or integers with a common leading axis of length n >= 1.

    Returns
    -------
    One row of each group, and the number of every row's group, shape ``(n,)``. Cost: sorting n short strings.
    """
    flat = [part.reshape(len(part), -1) for part in parts]
    packed = [
        np.packbits(each, axis=1) if each.dtype == np.bool_ else np.ascontiguousarray(each).view(np.uint8)
        for each in flat
    ]
    whole = np.ascontiguousarray(np.concatenate(packed, axis=1))
    # Strings of equal length: numpy sorts them fast, and pads none of them.
    text = whole.view(f"S{whole.shape[1]}").reshape(-1)
    _, first, which = np.unique(text, return_index=True, return_inverse=True)
    return first, which.reshape(-1)


def members(which: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Rows of every group, by its number; `which` is what `distinct` gave."""
    order = np.argsort(which, kind="stable")
    return iter(np.split(order, np.flatnonzero(np.diff(which[order])) + 1))
