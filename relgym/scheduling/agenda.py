"""How much is worked in one step of the world, and on what first.

Each step earns a little; what isn't spent is saved, up to a limit. So a world that is new gets what was saved at once,
one that can't be explained costs no more in the mean than a step earns, and no single step costs much.
"""

from __future__ import annotations

import sys
from collections.abc import Hashable, Iterable
from typing import Any

from relgym.scheduling.work import Task

__all__ = ["Agenda", "Budget"]


class Budget:
    """The work that one step of the world may do, in cells.

    Parameters
    ----------
    cells
        So many; ``None``: as many as it takes.
    whole
        What it is a part of: whatever is spent here is spent there.

    Examples
    --------
    >>> budget = Budget(100)
    >>> budget.spend(130)
    >>> budget.left, budget.spent
    (0, 130)
    """

    def __init__(self, cells: int | None = None, whole: Budget | None = None) -> None:
        self._cells, self._whole = cells, whole
        self.spent = 0

    def part(self, share: float) -> Budget:
        """A share of what is left, the rest being kept for others."""
        return self if self._cells is None else Budget(int(share * self.left), self)

    @property
    def left(self) -> int:
        """What may still be spent."""
        return sys.maxsize if self._cells is None else max(0, self._cells - self.spent)

    def spend(self, cells: int) -> None:
        """Take note of work done."""
        self.spent += cells
        if self._whole is not None:
            self._whole.spend(cells)

    def work(self, task: Task[Any]) -> bool:
        """Go on with a task as long as anything is left; whether it is done."""
        if not task.done and self.left:
            self.spend(task.advance(self.left))
        return task.done


class Agenda:
    """What was earned and not yet spent, and whose work is under way: whom least was spent on first.

    Nobody knows how long a search will take, but most are short, and some never find anything. Who has had least goes
    first (least attained service: Nuyens & Wierman 2008): what is easy to find is found at once, whoever else searches
    in vain; of equals the longest waiting.

    Parameters
    ----------
    earned
        Cells that each step earns.
    most
        Cells that one step may spend.
    saved
        Cells that are saved at most, and that there are to begin with.

    Examples
    --------
    >>> agenda = Agenda(earned=10, most=40, saved=60)
    >>> budget = agenda.open()
    >>> budget.left
    40
    >>> budget.spend(50); agenda.spent_on("a", 50); agenda.close(budget, ["a", "b"])
    >>> agenda.open().left, agenda.waiting
    (20, ('b', 'a'))
    """

    def __init__(self, *, earned: int, most: int, saved: int) -> None:
        self.earned, self.most, self.limit = earned, most, max(saved, earned)
        self.saved = saved
        self.waiting: tuple[Hashable, ...] = ()
        self._had: dict[Hashable, int] = {}

    def open(self) -> Budget:
        """The budget of a step that begins."""
        self.saved = min(self.limit, self.saved + self.earned)
        return Budget(max(0, min(self.most, self.saved)))

    def spent_on(self, whom: Hashable, cells: int) -> None:
        """Take note of work done for one of those who wait; it is forgotten once that waits no longer."""
        self._had[whom] = self._had.get(whom, 0) + cells

    def close(self, budget: Budget, waiting: Iterable[Hashable]) -> None:
        """A step ends: pay for it, and put in order whose work is under way now."""
        self.saved -= budget.spent
        now = dict.fromkeys(waiting)
        self._had = {k: cells for k, cells in self._had.items() if k in now}
        queue = [*(k for k in self.waiting if k in now), *(k for k in now if k not in self.waiting)]
        self.waiting = tuple(sorted(queue, key=lambda k: self._had.get(k, 0)))
