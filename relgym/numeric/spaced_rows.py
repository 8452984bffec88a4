"""Evenly spaced rows of a stream, so many that they tell what all would."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import FIRST_ROOM
from relgym.errors import ConfigError

__all__ = ["SpacedRows"]


class SpacedRows:
    """Columns and responses of every k-th row that came; k doubles where `thin` finds too many.

    Attributes
    ----------
    seen
        Number of rows that came.
    every
        Of so many rows one is kept, a power of 2: the first, and so on.

    Notes
    -----
    Cost O(width) a row. There is no chance in it: a stream leaves the same rows whenever it comes.

    Examples
    --------
    >>> rows = SpacedRows()
    >>> for k in range(10):
    ...     rows.add(np.array([float(k)]), np.array([2.0 * k]))
    >>> rows.thin(6)
    >>> rows.columns[:, 0].tolist(), rows.responses[:, 0].tolist()
    ([0.0, 2.0, 4.0, 6.0, 8.0], [0.0, 4.0, 8.0, 12.0, 16.0])
    """

    def __init__(self) -> None:
        self.seen = 0
        self.every = 1
        self._size = 0
        self._columns = np.zeros((0, 0))
        self._responses = np.zeros((0, 0))

    def __len__(self) -> int:
        return self._size

    @property
    def columns(self) -> NDArray[np.float64]:
        """Columns of the rows that are kept, shape ``(n, d)``."""
        return self._columns[: self._size]

    @property
    def responses(self) -> NDArray[np.float64]:
        """Their responses, shape ``(n, responses)``; 0 where a response came later than the row."""
        return self._responses[: self._size]

    def add(self, columns: NDArray[np.float64], responses: NDArray[np.float64]) -> None:
        """Take in a row of as many columns as those before, and of as many responses or more."""
        self.widen(len(responses))
        number, self.seen = self.seen, self.seen + 1
        if number % self.every:
            return
        if self._size == len(self._columns):
            more = (0, max(FIRST_ROOM, self._size))
            self._responses = np.pad(self._responses, (more, (0, 0)))
            self._columns = np.pad(self._columns, (more, (0, len(columns) - self._columns.shape[1])))
        self._columns[self._size], self._responses[self._size, : len(responses)] = columns, responses
        self._size += 1

    def widen(self, responses: int) -> None:
        """Expect so many responses from now on, if that is more than before: they were 0 in the rows that there are."""
        missing = responses - self._responses.shape[1]
        if missing > 0:
            self._responses = np.pad(self._responses, ((0, 0), (0, missing)))

    def thin(self, most: int) -> None:
        """Keep every second row, as often as there are more than so many.

        Raises
        ------
        ConfigError
            Fewer than one are to be kept.
        """
        if most < 1:
            raise ConfigError(f"expected at least one row to be kept, got {most}")
        while self._size > most:
            kept, self.every = (self._size + 1) // 2, 2 * self.every
            for rows in (self._columns, self._responses):
                rows[:kept] = rows[: self._size : 2].copy()
            self._size = kept

    # ------------------------------------------------------------------ saving
    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The rows, and how many came and are left out."""
        count = np.array([self.seen, self.every], dtype=np.int64)
        return {"columns": self.columns, "responses": self.responses, "count": count}

    @classmethod
    def restored(cls, arrays: Mapping[str, NDArray[Any]]) -> SpacedRows:
        """What `to_arrays` wrote."""
        found = cls()
        found.seen, found.every = arrays["count"].tolist()
        found._columns, found._responses = arrays["columns"].copy(), arrays["responses"].copy()
        found._size = len(found._columns)
        return found
