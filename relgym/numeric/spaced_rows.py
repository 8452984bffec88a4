"""Evenly spaced rows of a stream, so many that they tell what all would."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError
from relgym.numeric.growing import grown, thin

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
    Cost amortised O(width) a row. There is no chance in it: a stream leaves the same rows whenever it comes.

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
        if not self._size:
            self._columns = np.zeros((len(self._columns), len(columns)))
        if self._size == len(self._columns):
            self._columns, self._responses = grown(self._columns), grown(self._responses)
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
            kept = np.arange(self._size) % 2 == 0
            for rows in (self._columns, self._responses):
                thin(rows, kept)
            self._size, self.every = int(kept.sum()), 2 * self.every

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
