"""Which mode each example of a target is assigned to (the E-step's memory)."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.mode import NOISE
from relgym.config.constants import FIRST_ROOM
from relgym.numeric.growing import grown, thin

__all__ = ["AssignmentLog"]


class AssignmentLog:
    """Growing record of a target's examples, numbered from 0: value, mode, and row in the example table.

    Attributes
    ----------
    seen
        Number of examples that ever came here.
    forgotten
        How many examples of each mode were dropped.
    passed
        How many examples never came here, since others stand for them, by the mode of those; of `NOISE`: those for
        which the next one will stand, and those of modes that are gone.

    Notes
    -----
    Arrays are views: writing into `labels` assigns. Appending costs amortised O(1).
    """

    def __init__(self) -> None:
        self._y = np.zeros(FIRST_ROOM)
        self._label = np.zeros(FIRST_ROOM, dtype=np.int32)
        self._row = np.zeros(FIRST_ROOM, dtype=np.int64)
        self._size = 0
        self.seen = 0
        self.forgotten: Counter[int] = Counter()
        self.passed: Counter[int] = Counter()

    def __len__(self) -> int:
        return self._size

    @property
    def y(self) -> NDArray[np.float64]:
        """Target values, shape ``(n,)``."""
        return self._y[: self._size]

    @property
    def labels(self) -> NDArray[np.int32]:
        """Mode ids, shape ``(n,)``."""
        return self._label[: self._size]

    @property
    def rows(self) -> NDArray[np.int64]:
        """Rows in the example table, shape ``(n,)``."""
        return self._row[: self._size]

    def append(self, row: int, y: float) -> int:
        """Add an example, which is noise until it is assigned, and return its number."""
        if self._size == len(self._y):
            self._y, self._label, self._row = grown(self._y), grown(self._label), grown(self._row)
        self._y[self._size], self._label[self._size], self._row[self._size] = y, NOISE, row
        self._size += 1
        self.seen += 1
        return self._size - 1

    def keep(self, rows: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Forget the examples of dropped rows of the example table, and follow the others' new numbers.

        Parameters
        ----------
        rows
            Which rows of the table stay, shape ``(rows,)``.

        Returns
        -------
        New number of every example, -1 where it was dropped, shape ``(n,)``.
        """
        kept = rows[self.rows]
        self.forgotten.update(self.labels[~kept].tolist())
        for array in (self._y, self._label, self._row):
            thin(array, kept)
        self._size = int(kept.sum())
        self._row[: self._size] = _numbers(rows)[self.rows]
        return _numbers(kept)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Arrays that `from_arrays` reads back."""
        dropped = np.array(sorted(self.forgotten.items()), dtype=np.int64).reshape(-1, 2)
        return {"y": self.y, "labels": self.labels, "rows": self.rows, "forgotten": dropped}

    @classmethod
    def from_arrays(cls, arrays: dict[str, NDArray[Any]]) -> AssignmentLog:
        """Take over what `to_arrays` wrote."""
        log = cls()
        log._y, log._label, log._row = (arrays[name].copy() for name in ("y", "labels", "rows"))
        log._size = len(log._y)
        log.forgotten = Counter(dict(arrays["forgotten"].tolist()))
        log.seen = log._size + log.forgotten.total()
        return log


def _numbers(kept: NDArray[np.bool_]) -> NDArray[np.int64]:
    """New number of every row, -1 where it isn't kept."""
    found = np.cumsum(kept, dtype=np.int64)
    found -= 1
    found[~kept] = -1
    return found
