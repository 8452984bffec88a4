"""When to search: one kind of noise ever more rarely while that finds nothing, and whose turn it is for what is dear.

Of all targets' dear searches one is made at a time, so that no single step of the world waits for all.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Search", "Turn"]


@dataclass(slots=True)
class Search:
    """When to search the noise of one slot signature next.

    Attributes
    ----------
    waiting
        Unexplained examples since the last search.
    failures
        Searches in a row that found nothing.
    """

    waiting: int = 0
    failures: int = 0


COLUMNS = 1_500
"""Searches of one step look at no more columns than this together, some tenths of a second; one is always made."""


class Turn:
    """Leave for one dear search in one step of the world: who asks first has it, the others ask again in the next.

    Of plain searches it gives leave for many, unless they are of very many columns.

    Examples
    --------
    >>> turn = Turn()
    >>> turn.take(), turn.take()
    (True, False)
    """

    def __init__(self) -> None:
        self._free = True
        self._columns = 0

    def afford(self, columns: int) -> bool:
        """Whether a search of so many columns may be made in this step; if so, it is counted."""
        if self._columns and self._columns + columns > COLUMNS:
            return False
        self._columns += columns
        return True

    def take(self) -> bool:
        """Whether it was still free; it isn't any more."""
        free, self._free = self._free, False
        return free
