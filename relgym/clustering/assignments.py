"""Which mode each example of a target is assigned to (the E-step's memory)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.mode import NOISE

__all__ = ["AssignmentLog"]


class AssignmentLog:
    """Growing record of a target's examples, numbered from 0: value, mode, and row in the example table.

    Notes
    -----
    Arrays are views: writing into `labels` assigns. Appending costs amortised O(1).
    """

    def __init__(self) -> None:
        self._y = np.zeros(256)
        self._label = np.zeros(256, dtype=np.int32)
        self._row = np.zeros(256, dtype=np.int64)
        self._size = 0

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
            room = (0, max(256, self._size))
            self._y = np.pad(self._y, room)
            self._label = np.pad(self._label, room)
            self._row = np.pad(self._row, room)
        self._y[self._size], self._label[self._size], self._row[self._size] = y, NOISE, row
        self._size += 1
        return self._size - 1

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Arrays that `from_arrays` reads back."""
        return {"y": self.y, "labels": self.labels, "rows": self.rows}

    @classmethod
    def from_arrays(cls, arrays: dict[str, NDArray[Any]]) -> AssignmentLog:
        """Take over what `to_arrays` wrote."""
        log = cls()
        log._y, log._label, log._row = (arrays[name].copy() for name in ("y", "labels", "rows"))
        log._size = len(log._y)
        return log
