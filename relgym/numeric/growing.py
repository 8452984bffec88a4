"""Arrays that rows are appended to, and dropped from."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import FIRST_ROOM, MORE_ROOM

__all__ = ["grown", "thin"]

S = TypeVar("S", bound=np.generic)


def grown(array: NDArray[S], most: int | None = None) -> NDArray[S]:
    """An array that is full, with room for more rows, which are zeros.

    It grows by the share `MORE_ROOM`, and by `FIRST_ROOM` rows at least: appending a row costs amortised O(width), and
    a learner that runs for days doesn't hold twice as much as it keeps.

    Parameters
    ----------
    array
        Shape ``(n, ...)``.
    most
        Rows that there is never more room for; None: no such number.
    """
    n = len(array)
    room = n + max(FIRST_ROOM, int(MORE_ROOM * n))
    room = room if most is None else min(room, most)
    return np.pad(array, ((0, room - n),) + ((0, 0),) * (array.ndim - 1))


def thin(array: NDArray[S], kept: NDArray[np.bool_]) -> None:
    """Move the rows that are kept to the front, in their order.

    In place and a few at a time: a copy of all rows of a long history takes many megabytes at once.

    Parameters
    ----------
    array
        Shape ``(m, ...)``; rows behind the first n stay.
    kept
        Which of the first n rows are, shape ``(n,)``.
    """
    rows, moved = array[: len(kept)], 0
    for begin in range(0, len(kept), FIRST_ROOM):
        piece = slice(begin, begin + FIRST_ROOM)
        some = rows[piece][kept[piece]]
        array[moved : moved + len(some)] = some
        moved += len(some)
