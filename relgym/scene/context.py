"""What is close to a target, and in which order to look at the other objects.

Order and names mean nothing to a model (§1.3, R3). Where other objects must be lined up, for regression or for drawing
similar examples, they are lined up by what they are to the target: an order that renaming, reordering and shifting
leave alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from relgym.scene.relations import Relations

__all__ = ["canonical_order", "close_set", "signature", "slots"]

_SAME_DISTANCE = 1e-9
"""Distances within this, in units of length, count as equal in the canonical order: rounding must not decide it."""

_Order: TypeAlias = NDArray[np.intp]


def close_set(touching: NDArray[np.bool_], distance: NDArray[np.float64], body: int) -> NDArray[np.bool_]:
    """Return which bodies are close to a target: itself, and all that touch it, or else the single nearest one.

    Parameters
    ----------
    touching, distance
        The target's rows of `intersect` and of the distances, shape ``(n, K)``.
    body
        The target's number.

    Returns
    -------
    Shape ``(n, K)``. Of several nearest bodies the earliest counts.
    """
    close = touching.copy()
    alone = ~touching.any(axis=1)
    if alone.any():
        rows = np.flatnonzero(alone)
        close[rows, distance[rows].argmin(axis=1)] = True
    close[:, body] = True
    return close


def slots(relations: Relations, body: int) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Return the other bodies' types, alphabetical, each with the numbers of its bodies: the canonical order's groups."""
    layout = relations.layout
    groups: dict[str, list[int]] = {}
    for k, i in enumerate(layout.bodies):
        if k != body:
            groups.setdefault(layout.types[i].name, []).append(k)
    return tuple((name, tuple(groups[name])) for name in sorted(groups))


def canonical_order(relations: Relations, body: int, pose: NDArray[np.float64] | None = None) -> _Order:
    """Return the other bodies in canonical order.

    Grouped by type, types alphabetical. Within a type: first by the relations to the target (those for which earlier
    relation names hold come first: what touches it leads), then by the relations to the other bodies and what these
    are to the target, then by signed distance to the target, then by pose.

    Parameters
    ----------
    relations
        Relations of n scenes.
    body
        The target's number.
    pose
        Poses of the bodies, shape ``(n, K, 9)``: the last resort between bodies that are alike in all else. Without
        it the numbers of the bodies decide.

    Returns
    -------
    Numbers of the other bodies, shape ``(n, K - 1)``. Column j belongs to the same type in all scenes.
    """
    groups = slots(relations, body)
    plain = np.array([k for _, numbers in groups for k in numbers], dtype=np.intp)
    order = np.repeat(plain[None], len(relations), axis=0)
    if all(len(numbers) == 1 for _, numbers in groups):
        return order
    toward, shape = _roles(relations, body, groups)
    at = 0
    for _, numbers in groups:
        if len(numbers) > 1:
            members = np.array(numbers, dtype=np.intp)
            apart = np.round(relations.distance[:, body, members] / _SAME_DISTANCE)
            keys = [apart, shape[:, members], ~toward[:, members]]
            if pose is not None:
                keys = [*pose[:, members].transpose(2, 0, 1)[::-1], *keys]
            order[:, at : at + len(members)] = members[np.lexsort(keys, axis=-1)]
        at += len(numbers)
    return order


def signature(relations: Relations, body: int, order: _Order | None = None) -> list[bytes]:
    """Return, for each scene, a key of its relational table in canonical order.

    Two scenes have the same key if they have the same types of objects and the same relations between them, seen
    from the target. For grouping and stratifying; the keys' order means nothing.

    Parameters
    ----------
    relations, body
        As for `canonical_order`.
    order
        `canonical_order`'s result, where the caller has it already.
    """
    order = canonical_order(relations, body) if order is None else order
    layout = relations.layout
    kinds = [layout.types[layout.bodies[body]].name]
    kinds += [name for name, numbers in slots(relations, body) for _ in numbers]
    prefix = ",".join(kinds).encode() + b":"
    whole = np.concatenate([np.full((len(order), 1), body, dtype=np.intp), order], axis=1)
    if len(whole) and (whole == whole[0]).all():
        table = relations.table[:, :, whole[0][:, None], whole[0]]
    else:
        scene = np.arange(len(whole))[:, None, None, None]
        relation = np.arange(len(relations.names))[:, None, None]
        table = relations.table[scene, relation, whole[:, None, :, None], whole[:, None, None, :]]
    bits = np.packbits(table.reshape(len(whole), -1), axis=1)
    return [prefix + row.tobytes() for row in bits]


def _roles(
    relations: Relations, body: int, groups: tuple[tuple[str, tuple[int, ...]], ...]
) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Codes of what each body is to the target, and of how the others lie about it; shape ``(n, K)`` each."""
    codes = _pair_codes(relations.table)
    toward = codes[:, :, body]
    kind = np.zeros(codes.shape[1], dtype=np.uint64)
    for number, (_, members) in enumerate(groups):
        kind[list(members)] = number + 1
    # A sum of mixed codes is the same in whatever order the others come (one round of colour refinement).
    about = _mix(_mix(codes + kind) + toward[:, None, :])
    about[:, :, body] = 0
    about[:, np.arange(len(kind)), np.arange(len(kind))] = 0
    around: NDArray[np.uint64] = about.sum(axis=2, dtype=np.uint64)
    return toward, around


def _pair_codes(table: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Which relations hold between two bodies, either way round, as bits; the first relation's are the highest."""
    codes = np.zeros((len(table), *table.shape[2:]), dtype=np.uint64)
    for r in range(table.shape[1]):
        there = table[:, r]
        codes = (codes << np.uint64(2)) | (there.astype(np.uint64) << np.uint64(1)) | there.swapaxes(1, 2)
    return codes


def _mix(a: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Scatter the bits of each number (the finaliser of SplitMix64)."""
    a = (a + np.uint64(0x9E3779B97F4A7C15)) & _ALL
    a = ((a ^ (a >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)) & _ALL
    a = ((a ^ (a >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)) & _ALL
    mixed: NDArray[np.uint64] = a ^ (a >> np.uint64(31))
    return mixed


_ALL = np.uint64(2**64 - 1)
