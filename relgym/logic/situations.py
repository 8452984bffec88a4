"""Numbers that stand for situations: what some relations say of a target and the objects around it.

An object is described by its own relations, those to the target, and which described objects it stands in which
relation to. A situation is the *set* of these descriptions: ten more boxes beside the track make no new one.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.mixing import GOLDEN, mixed

__all__ = ["situation"]

_Hashes: TypeAlias = NDArray[np.uint64]
_Bools: TypeAlias = NDArray[np.bool_]

_GOLDEN: Final = np.uint64(GOLDEN)


def situation(table: _Bools, unary: _Bools, target: NDArray[np.int64], exists: _Bools) -> _Hashes:
    """A number per world, equal for equal situations; shape ``(n,)``.

    Parameters
    ----------
    table, unary
        Binary and unary relations in a fixed order, shapes ``(n, r, K, K)`` and ``(n, u, K)``.
    target
        The target object of each world, shape ``(n,)``.
    exists
        Which objects count, shape ``(n, K)``.

    Notes
    -----
    Cost: O(n K^2 log K).
    """
    n, k = exists.shape
    rows = np.arange(n)
    table = np.moveaxis(table, 1, -1)  # (n, K, K, r)
    towards, back = table[rows, :, target], table[rows, target]
    self_ = np.arange(k) == target[:, None]
    own = np.moveaxis(unary, 1, -1)
    described = _hash_bits(np.concatenate([own, towards, back, self_[:, :, None]], axis=-1))
    among = _hash_bits(table)  # (n, K, K): how each object stands to each other one
    pairs = mixed(among + described[:, None, :])
    neighbours = _set_hash(np.where(exists[:, None, :], pairs, np.uint64(0)))
    return _set_hash(np.where(exists, mixed(described + neighbours), np.uint64(0)))


def _hash_bits(bits: _Bools) -> _Hashes:
    """One number per row of the last axis."""
    weights = mixed(np.arange(1, bits.shape[-1] + 1, dtype=np.uint64) * _GOLDEN)
    return mixed((bits * weights).sum(axis=-1, dtype=np.uint64) + _GOLDEN)


def _set_hash(members: _Hashes) -> _Hashes:
    """Hash of the set of non-zero numbers along the last axis."""
    ordered = np.sort(members, axis=-1)
    ordered[..., 1:][ordered[..., 1:] == ordered[..., :-1]] = 0
    total: _Hashes = ordered.sum(axis=-1, dtype=np.uint64)
    return total
