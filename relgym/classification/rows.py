"""Rows of numbers that many learners keep, each held once.

All targets of a type are shown the same numbers of an object, and their classifiers remember much the same examples.
In a world of a hundred numbers and fifty targets, what each classifier held for itself was nine tenths of a model's
memory.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from functools import cached_property
from heapq import heappop, heappush
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import FIRST_ROOM
from relgym.numeric.growing import grown

__all__ = ["Gathered", "RowPool"]


class RowPool:
    """Rows of equal width; those with the same bits are one, and have one number.

    Parameters
    ----------
    width
        How many numbers a row has.

    Notes
    -----
    Who holds a row lets go of it as often as it was held: then its place is taken by another one. Cost of either
    O(width), some 2 µs for a hundred numbers. A copy, or what was pickled, gives the numbers that the original would.
    """

    def __init__(self, width: int) -> None:
        self.width = width
        self._rows = np.zeros((FIRST_ROOM, width))
        self._holders: list[int] = []  # how often each row is held
        self._find_places()

    def __len__(self) -> int:
        return len(self._holders) - len(self._free)

    def hold(self, row: NDArray[np.float64]) -> int:
        """The number of a row, shape ``(width,)``, which is held once more."""
        content = row.tobytes()
        check = zlib.crc32(content)
        known = self._known.get(check)
        if known is not None and self._rows[known].tobytes() == content:
            self._holders[known] += 1
            return known
        number = heappop(self._free) if self._free else self._append()
        self._rows[number], self._holders[number] = row, 1
        self._known.setdefault(check, number)  # of different rows with the same sum one is found again
        return number

    def release(self, numbers: Iterable[int]) -> None:
        """Let go of rows, each as often as it stands there."""
        for number in numbers:
            self._holders[number] -= 1
            if not self._holders[number]:
                heappush(self._free, number)
                check = zlib.crc32(self._rows[number].tobytes())
                if self._known.get(check) == number:
                    del self._known[check]

    def take(self, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """A copy of some rows, shape ``(len(numbers), width)``."""
        return self._rows[numbers]

    def __getstate__(self) -> dict[str, Any]:
        return {
            "width": self.width,
            "_rows": self._rows[: len(self._holders)],
            "_holders": self._holders,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._find_places()

    def _find_places(self) -> None:
        """Where each row is found, by a check sum, and what places are free, the first first."""
        self._free = [number for number, count in enumerate(self._holders) if not count]
        self._known: dict[int, int] = {}
        for number, count in enumerate(self._holders):
            if count:
                self._known.setdefault(zlib.crc32(self._rows[number].tobytes()), number)

    def _append(self) -> int:
        if len(self._holders) == len(self._rows):
            self._rows = grown(self._rows)
        self._holders.append(0)
        return len(self._holders) - 1


class Gathered:
    """Rows of a pool, each with further numbers behind it, put together when somebody reads them.

    Parameters
    ----------
    pool, numbers
        Where the rows are held, and their numbers there, shape ``(n,)``.
    more
        What comes behind them, shape ``(n, m)``.
    """

    def __init__(self, pool: RowPool, numbers: NDArray[np.int64], more: NDArray[np.float64]) -> None:
        self._pool, self._numbers, self._more = pool, numbers, more

    @cached_property
    def whole(self) -> NDArray[np.float64]:
        """All rows, as they are when this is read first, shape ``(n, width + m)``."""
        rows = self._pool.take(self._numbers)
        return np.concatenate([rows, self._more], axis=1) if self._more.shape[1] else rows

    def __getitem__(self, places: Any) -> NDArray[np.float64]:
        """Part of `whole`, by what indexes an array."""
        found: NDArray[np.float64] = self.whole[places]
        return found
