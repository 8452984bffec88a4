"""What is close to a target, and in which order to look at the other objects.

Order and names mean nothing to a model (§1.3, R3). Where other objects must be lined up, for regression or
for drawing similar examples, they are lined up by what they are to the target: an order that renaming,
reordering and shifting leave alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing, whole
from relgym.errors import QueryError
from relgym.mixing import GOLDEN, mixed
from relgym.scene.objects import SceneLayout

if TYPE_CHECKING:
    from relgym.scene.relations import Relations

__all__ = ["Slots", "canonical_order", "close_set", "order_and_ties", "signature", "slots", "state_keys"]

_SAME_DISTANCE = 1e-9
"""Distances within this, in units of length, count as equal: rounding must not decide an order."""

_FEW = 512
"""Codes of fewer bodies than this are summed at once."""

Slots: TypeAlias = tuple[tuple[str, NDArray[np.intp]], ...]
"""Type names, alphabetical, each with the numbers of its bodies."""

_Order: TypeAlias = NDArray[np.intp]
_Poses: TypeAlias = Callable[[NDArray[np.intp]], NDArray[np.float64]]


def close_set(touching: NDArray[np.bool_], distance: NDArray[np.float64], body: int) -> NDArray[np.bool_]:
    """Return the bodies close to a target: itself, and all that touch it, or else the single nearest.

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


def slots(layout: SceneLayout, body: int) -> Slots:
    """Return the other bodies' types, alphabetical, each with its bodies' numbers; cached on the layout."""
    known: dict[int, Slots] = layout.__dict__.setdefault("_slots", {})
    if body not in known:
        groups: dict[str, list[int]] = {}
        for k, i in enumerate(layout.bodies):
            if k != body:
                groups.setdefault(layout.types[i].name, []).append(k)
        known[body] = tuple((name, np.array(groups[name], dtype=np.intp)) for name in sorted(groups))
    return known[body]


@refusing(QueryError)
def canonical_order(relations: Relations, body: int, pose: _Poses | None = None) -> _Order:
    """Return the other bodies in canonical order.

    Grouped by type, types alphabetical. Within a type: first by the relations to the target (those for
    which earlier relation names hold come first: what touches it leads), then by the relations to the other
    bodies and what these are to the target, then by signed distance to the target, then by pose.

    Parameters
    ----------
    relations
        Relations of n scenes.
    body
        The target's number.
    pose
        From numbers of scenes, shape ``(m,)``, to poses of the bodies, shape ``(m, K, 9)``: the last resort between
        bodies that are alike in all else. Without it the numbers of the bodies decide.

    Returns
    -------
    Numbers of the other bodies, shape ``(n, K - 1)``. Column j belongs to the same type in all scenes.
    """
    _check(relations, body)
    return order_and_ties(relations, body, pose)[0]


def _check(relations: Relations, body: int) -> None:
    if not hasattr(relations, "layout"):
        raise QueryError(f"relations={relations!r}: expected what Extractor.extract gives")
    whole("body", body, 0, len(relations.layout.bodies), QueryError)


def order_and_ties(
    relations: Relations, body: int, pose: _Poses | None = None
) -> tuple[_Order, NDArray[np.bool_]]:
    """`canonical_order`, and in which scenes more than the relations to the target decides it, shape ``(n,)``."""
    groups = slots(relations.layout, body)
    plain = np.array([k for _, members in groups for k in members], dtype=np.intp)
    order = np.repeat(plain[None], len(relations), axis=0)
    if any(len(members) > 1 for _, members in groups):
        return order, _sort_groups(relations, body, groups, order, pose)
    return order, np.zeros(len(order), dtype=np.bool_)


def _sort_groups(
    relations: Relations, body: int, groups: Slots, order: _Order, pose: _Poses | None
) -> NDArray[np.bool_]:
    """Sort the bodies of each type, in place; in which scenes their relations to the target don't decide."""
    table = relations.table
    toward = _codes(table[:, :, :, body], table[:, :, body])
    tied, spans, at = np.zeros(len(order), dtype=np.bool_), [], 0
    for _, members in groups:
        if len(members) > 1:
            codes = ~toward[:, members]  # what touches the target has the highest codes, and comes first
            spans.append((slice(at, at + len(members)), members, codes))
            order[:, spans[-1][0]] = members[np.argsort(codes, axis=1, kind="stable")]
            tied |= _ties(codes)
        at += len(members)
    rows = np.flatnonzero(tied)
    if not len(rows):
        return tied
    near = np.round(relations.distances(body)[rows] / _SAME_DISTANCE)
    around = _around(table[rows], body, groups, toward[rows])
    last = [] if pose is None else list(pose(rows).transpose(2, 0, 1)[::-1])
    for span, members, codes in spans:
        keys = [key[:, members] for key in (*last, near, around)]
        order[rows, span] = members[np.lexsort([*keys, codes[rows]], axis=-1)]
    return tied


@refusing(QueryError)
def signature(relations: Relations, body: int, order: _Order | None = None) -> list[bytes]:
    """Return, for each scene, a key of its relational table in canonical order.

    Two scenes have the same key if they have the same types of objects and the same relations between them,
    seen from the target. For grouping and stratifying; the keys' order means nothing.

    Parameters
    ----------
    relations, body
        As for `canonical_order`.
    order
        `canonical_order`'s result, where the caller has it already.
    """
    _check(relations, body)
    others = len(relations.layout.bodies) - 1
    if order is None:
        order = canonical_order(relations, body)
    elif getattr(order, "shape", None) != (len(relations), others):
        raise QueryError(f"order: expected what canonical_order gives, of shape {(len(relations), others)}")
    return state_keys(relations.table, relations.layout, body, order)


def state_keys(table: NDArray[np.bool_], layout: SceneLayout, body: int, order: _Order) -> list[bytes]:
    """`signature` of which relation holds for which pair, shape ``(n, R, K, K)``."""
    kinds = [layout.types[layout.bodies[body]].name]
    kinds += [name for name, members in slots(layout, body) for _ in members]
    prefix = ",".join(kinds).encode() + b":"
    whole = np.concatenate([np.full((len(order), 1), body, dtype=np.intp), order], axis=1)
    if len(whole) and (whole == whole[0]).all():
        table = table[:, :, whole[0][:, None], whole[0]]
    else:
        scene = np.arange(len(whole))[:, None, None, None]
        relation = np.arange(table.shape[1])[:, None, None]
        table = table[scene, relation, whole[:, None, :, None], whole[:, None, None, :]]
    bits = np.packbits(table.reshape(len(whole), -1), axis=1)
    return [prefix + row.tobytes() for row in bits]


def relations_of(key: bytes, count: int, bodies: int) -> NDArray[np.bool_]:
    """Inverse of `state_keys`: which of R relations hold for which pair of K bodies, shape ``(R, K, K)``."""
    bits = np.frombuffer(key.partition(b":")[2], dtype=np.uint8)
    return np.unpackbits(bits, count=count * bodies**2).astype(np.bool_).reshape(count, bodies, bodies)


def _codes(there: NDArray[np.bool_], back: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Which relations (second axis) hold either way round, as bits; the first relation's are the highest."""
    codes = np.zeros((len(there), *there.shape[2:]), dtype=np.uint64)
    if codes.size < _FEW:  # one sum costs less than many steps
        weights = np.uint64(1) << np.arange(2 * there.shape[1], dtype=np.uint64)[::-1]
        shape = (there.shape[1], *(1 for _ in there.shape[2:]))
        both = there * weights[0::2].reshape(shape) + back * weights[1::2].reshape(shape)
        return np.asarray(both.sum(axis=1, dtype=np.uint64))
    one = np.uint64(1)
    for r in range(there.shape[1]):
        for bits in (there[:, r], back[:, r]):
            codes <<= one
            codes |= bits
    return codes


def _ties(codes: NDArray[np.uint64]) -> NDArray[np.bool_]:
    """In which scenes some bodies have the same code, shape ``(n,)``."""
    ordered = np.sort(codes, axis=1)
    return np.asarray((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))


def _around(
    table: NDArray[np.bool_], body: int, groups: Slots, toward: NDArray[np.uint64]
) -> NDArray[np.uint64]:
    """Codes of how the others lie about each body and what they are to the target, shape ``(n, K)``."""
    codes = _codes(table, table.swapaxes(2, 3))
    kind = np.zeros(codes.shape[1], dtype=np.uint64)
    for number, (_, members) in enumerate(groups):
        kind[members] = number + 1
    # A sum of mixed codes is the same in whatever order the others come (one round of colour refinement).
    about = _mix(_mix(codes + (kind << np.uint64(2 * table.shape[1]))) + toward[:, None, :])
    about[:, :, body] = 0
    about[:, np.arange(len(kind)), np.arange(len(kind))] = 0
    around: NDArray[np.uint64] = about.sum(axis=2, dtype=np.uint64)
    return around


def _mix(a: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Scatter the bits of each number."""
    return mixed(a + np.uint64(GOLDEN))
