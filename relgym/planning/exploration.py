"""Where an agent hasn't been: pairs of values that no real step has shown together (§5.1)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError
from relgym.scene.objects import Float1D, Float2D

__all__ = ["Coverage"]

_OCTAVES: Final = 6
"""Values are told apart by sign and power of two, down to this many powers below the largest one seen; below it they
count as zero. Conditions of modes lie at zero more often than anywhere else, so near it the cells are small."""


class Coverage:
    """Counts which values of two properties were seen together, and what a step would add.

    A reward that is paid at the goal when the truck stands still is a mode that random play never sees; what the agent
    can know is that it never stood still there. Counting single properties would miss that (it stood still elsewhere,
    and drove over the goal), whole states never come again; pairs are what two-literal clauses are made of.

    Parameters
    ----------
    columns
        Columns of the state vectors that count: of properties that change.
    capacity
        Real steps that are remembered.

    Notes
    -----
    Cost: of `bonus` a table look-up for each pair of columns and each step.
    """

    def __init__(self, columns: Iterable[int], *, capacity: int = 20_000) -> None:
        self.columns = np.array(sorted(set(columns)), dtype=np.intp)
        if capacity < 1:
            raise ConfigError(f"capacity={capacity!r}: expected at least 1 step")
        self._capacity = capacity
        self._seen: list[Float1D] = []
        self._largest = np.zeros(len(self.columns))
        first, second = np.triu_indices(len(self.columns), k=0)  # a column with itself: the values alone
        self._first, self._second = first, second
        self._counts = np.zeros((len(first), 2 * _OCTAVES + 3, 2 * _OCTAVES + 3))

    def __len__(self) -> int:
        return len(self._seen)

    def add(self, state: Float1D) -> None:
        """Take note of a state that a real step led to, shape ``(width,)``."""
        row = np.array(state[self.columns])
        self._seen.append(row)
        sizes = np.exp2(np.ceil(np.log2(np.maximum(np.abs(row), 1e-300))))
        if (sizes > self._largest).any() or len(self._seen) > self._capacity:
            self._largest = np.maximum(self._largest, np.where(row == 0.0, 0.0, sizes))
            del self._seen[: -self._capacity]
            self._counts[:] = 0.0
            self._count(np.array(self._seen))
        else:
            self._count(row[None])

    def novelty(self, states: Float2D) -> Float1D:
        """Share of the pairs of values that were never seen together, of n states; in [0, 1], shape ``(n,)``."""
        if not len(self._first):
            return np.zeros(len(states))
        cells = self._cells(states[:, self.columns])
        pairs = np.arange(len(self._first))
        found = self._counts[pairs, cells[:, self._first], cells[:, self._second]]
        fresh: Float1D = (found == 0.0).mean(axis=1)
        return fresh

    def bonus(self, weight: float) -> Any:
        """A `Bonus` that pays `weight` times the novelty of the next state."""

        def paid(states: Float2D, actions: NDArray[Any], following: Float2D) -> Float1D:
            return weight * self.novelty(following)

        return paid

    def _count(self, rows: Float2D) -> None:
        cells = self._cells(rows)
        pairs = np.broadcast_to(np.arange(len(self._first)), (len(rows), len(self._first)))
        np.add.at(self._counts, (pairs, cells[:, self._first], cells[:, self._second]), 1.0)

    def _cells(self, rows: Float2D) -> NDArray[np.intp]:
        """The cell of each value: sign and power of two below the largest, one more beyond it; shape of `rows`."""
        size = np.where(self._largest > 0.0, self._largest, 1.0)
        with np.errstate(divide="ignore"):
            octave = np.floor(np.log2(np.abs(rows) / size)) + _OCTAVES + 1
        level = np.clip(octave, 0, _OCTAVES + 1).astype(np.intp)
        found: NDArray[np.intp] = _OCTAVES + 1 + np.sign(rows).astype(np.intp) * level
        return found
