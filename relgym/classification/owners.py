"""Whose an example is that several modes explain.

Examples are assigned to the simplest mode that explains them, and sometimes that is the wrong one by chance: a ball at
the top of its flight is as fast as one at rest. No number tells, but relations do: where it flies, all that is beyond
doubt belongs to flying. Left alone such an example would count for rest against all other modes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import NOISE, Bools
from relgym.classification.exemplars import Exemplars

__all__ = ["Owners"]


class Owners:
    """Knows which modes' examples beyond doubt were seen in which relations.

    An example is beyond doubt where no mode explains it but the one that it was assigned to, and those that cover that
    one (`covered_by`). One that isn't belongs to the mode that it was assigned to, unless that mode was never seen
    beyond doubt in the same relations while another one was that explains it too.

    Parameters
    ----------
    certain
        Relational states (`Example.key`), each with the modes that were seen there beyond doubt, and how many of their
        examples were.
    covered
        Pairs (k, m): mode m covers mode k.
    """

    def __init__(
        self, certain: Mapping[bytes, Mapping[int, float]], covered: Iterable[tuple[int, int]]
    ) -> None:
        self._certain = {key: dict(modes) for key, modes in certain.items()}
        self.covered = frozenset(covered)

    @classmethod
    def of(cls, exemplars: Exemplars, covered: Iterable[tuple[int, int]]) -> Owners:
        """Count what is remembered, each exemplar as often as it stands for an example."""
        self = cls({}, covered)
        weights = np.where(self._doubtful(exemplars), 0.0, exemplars.weights())
        for mode, key, slots in exemplars.cells:
            if mode != NOISE and (weight := float(weights[slots].sum())) > 0.0:
                self._certain.setdefault(key, {})[mode] = weight
        return self

    def with_covered(self, covered: Iterable[tuple[int, int]]) -> Owners:
        """The same counts under another idea of which modes cover which."""
        other = Owners({}, covered)
        other._certain = self._certain
        return other

    def _doubtful(self, exemplars: Exemplars) -> Bools:
        """Which exemplars are explained by modes that don't cover their own."""
        found, fits = np.zeros(len(exemplars), dtype=np.bool_), exemplars.columns["fits"]
        for mode in exemplars.modes:
            own = np.flatnonzero(exemplars.assigned == mode)
            alternatives = [m != mode and (mode, m) not in self.covered for m in exemplars.modes]
            found[own] = fits[own][:, alternatives].any(axis=1)
        return found

    def count(self, assigned: int, key: bytes, explaining: Iterable[int], weight: float = 1.0) -> None:
        """Take note of one more example, which stands for so many."""
        doubtful = any(m != assigned and (assigned, m) not in self.covered for m in explaining)
        if assigned != NOISE and not doubtful:
            there = self._certain.setdefault(key, {})
            there[assigned] = there.get(assigned, 0.0) + weight

    def owner(self, assigned: int, key: bytes, explaining: Iterable[int]) -> int:
        """Mode that an example belongs to."""
        there = self._certain.get(key, {})
        if assigned == NOISE or assigned in there:
            return assigned
        found = [m for m in explaining if m in there]
        return min(found, key=lambda m: (-there[m], m), default=assigned)

    def owners(self, exemplars: Exemplars) -> NDArray[np.int64]:
        """`owner` of everything remembered, shape ``(len(exemplars),)``."""
        found, fits = exemplars.assigned.copy(), exemplars.columns["fits"]
        for mode, key, slots in exemplars.cells:
            if mode != NOISE and mode not in self._certain.get(key, {}):
                for slot in slots:
                    explaining = [m for m, ok in zip(exemplars.modes, fits[slot].tolist(), strict=True) if ok]
                    found[slot] = self.owner(mode, key, explaining)
        return found

    def to_list(self) -> list[list[Any]]:
        """Plain data: what was seen beyond doubt."""
        return [[key.hex(), sorted(modes.items())] for key, modes in sorted(self._certain.items())]

    @classmethod
    def from_list(cls, data: list[list[Any]], covered: Iterable[tuple[int, int]]) -> Owners:
        """Inverse of `to_list`."""
        return cls({bytes.fromhex(key): {int(m): float(n) for m, n in modes} for key, modes in data}, covered)
