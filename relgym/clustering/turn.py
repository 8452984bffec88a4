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


class Turn:
    """Leave for one dear search in one step of the world: who asks first has it, the others ask again in the next.

    Examples
    --------
    >>> turn = Turn()
    >>> turn.take(), turn.take()
    (True, False)
    """

    def __init__(self) -> None:
        self._free = True

    def take(self) -> bool:
        """Whether it was still free; it isn't any more."""
        free, self._free = self._free, False
        return free
