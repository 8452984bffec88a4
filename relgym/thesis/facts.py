"""Relational states as FOIL sees them: which relations hold between a target and what is close to it (§3.3, §3.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.scene.context import close_set
from relgym.scene.objects import SceneLayout
from relgym.scene.relations import Extractor

__all__ = ["Facts", "Observer", "joined"]

Bools = NDArray[np.bool_]
Numbers = NDArray[np.intp]

_CONTACT = ("approaching", "approaching-fastest")
"""Relations that the thesis didn't have."""


@dataclass(frozen=True)
class Facts:
    """Distinct relational states, and objects that clauses speak of by name (A, and B for a role).

    Attributes
    ----------
    relations, types
        Names of binary and unary relations, alphabetical.
    binary
        Shape ``(states, relations, K, K)``.
    unary
        Shape ``(states, types, K)``.
    fixed
        Number of each named object, shape ``(states, named)``.
    """

    relations: tuple[str, ...]
    types: tuple[str, ...]
    binary: Bools
    unary: Bools
    fixed: Numbers

    def __len__(self) -> int:
        return len(self.binary)

    def of(self, states: Numbers, fixed: Numbers | None = None) -> Facts:
        """Some states, with other named objects if they are given, shape ``(states, named)``."""
        named = self.fixed[states] if fixed is None else fixed
        return Facts(self.relations, self.types, self.binary[states], self.unary[states], named)


class Observer:
    """Turns scenes into facts.

    Parameters
    ----------
    extractor
        Of the scenes' schema.
    close
        Whether only the target and what it touches, or else the nearest object, are seen.
    """

    def __init__(self, extractor: Extractor, *, close: bool) -> None:
        self._extractor, self._close = extractor, close
        self._used = [k for k, name in enumerate(extractor.names) if name not in _CONTACT]
        self.relations = tuple(extractor.names[k] for k in self._used)
        self.types = extractor.unary_names

    def facts(
        self, layout: SceneLayout, vectors: NDArray[np.float64], target: int
    ) -> tuple[Facts, Numbers, Numbers]:
        """Facts of scenes with the same objects.

        Returns
        -------
        The distinct states; which of them each scene is in, shape ``(n,)``; the object behind each of a state's
        numbers, -1 for none, shape ``(states, K)``.
        """
        relations = self._extractor.extract(layout, vectors)
        body = layout.bodies.index(target)
        count = len(layout.bodies)
        present = np.ones((len(vectors), count), dtype=np.bool_)
        if self._close:
            present = close_set(relations.relation("intersect")[:, body], relations.distances(body), body)
        table = relations.table[:, self._used]
        table = table & present[:, None, :, None] & present[:, None, None, :]
        packed = np.packbits(np.concatenate([present, table.reshape(len(table), -1)], axis=1), axis=1)
        text = np.ascontiguousarray(packed).view(f"S{packed.shape[1]}").reshape(-1)
        _, first, which = np.unique(text, return_index=True, return_inverse=True)
        table, present = table[first], present[first]
        kinds = self._extractor.unary(layout)
        unary = np.stack([kinds[name] for name in self.types])[None] & present[:, None]
        # Only objects that are seen are numbered, so that states stay small.
        width = int(present.sum(axis=1).max(initial=1))
        order = np.argsort(~present, axis=1, kind="stable")[:, :width]
        seen = np.take_along_axis(present, order, axis=1)
        every = np.arange(len(order))[:, None, None, None]
        binary = table[
            every, np.arange(table.shape[1])[:, None, None], order[:, None, :, None], order[:, None, None, :]
        ]
        small = np.take_along_axis(unary, np.repeat(order[:, None], unary.shape[1], axis=1), axis=2)
        own = (order == body).argmax(axis=1)[:, None]
        bodies = np.array(layout.bodies, dtype=np.intp)
        objects = np.where(seen, bodies[order], -1)
        return Facts(self.relations, self.types, binary, small, own), which.reshape(-1), objects


def joined(parts: Sequence[Facts]) -> Facts:
    """Facts of scenes with different objects, one after the other."""
    width = max(part.binary.shape[2] for part in parts)

    def grown(a: Bools, axes: int) -> Bools:
        missing = width - a.shape[-1]
        return np.pad(a, [(0, 0)] * (a.ndim - axes) + [(0, missing)] * axes)

    return Facts(
        parts[0].relations,
        parts[0].types,
        np.concatenate([grown(part.binary, 2) for part in parts]),
        np.concatenate([grown(part.unary, 1) for part in parts]),
        np.concatenate([part.fixed for part in parts]),
    )
