"""Whose turn it is: of all targets' dear searches one at a time, so that no single step of the world waits for all."""

from __future__ import annotations

__all__ = ["Turn"]


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
