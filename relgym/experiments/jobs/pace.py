"""How long will the rest take? Evaluated by what tasks of the same kind took, and abstained before any did."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from statistics import mean

from relgym.experiments.jobs.task import Task

__all__ = ["Pace"]


class Pace:
    """Remaining time of a set of tasks.

    Parameters
    ----------
    tasks
        What is to be done.
    workers
        How many run at the same time.

    Examples
    --------
    >>> tasks = [Task("os:getpid", {"n": n}, kind) for n, kind in enumerate(["slow", "slow", "quick"])]
    >>> pace = Pace(tasks, workers=1)
    >>> pace.left() is None
    True
    >>> pace.took(tasks[0], 60.0)
    >>> pace.left(), pace.guessed
    (120.0, 1)
    """

    def __init__(self, tasks: Iterable[Task], workers: int) -> None:
        self._waiting = Counter(_kind(task) for task in tasks)
        self._workers = workers
        self._seconds: dict[tuple[str, str], list[float]] = {}

    def learn(self, task: Task, seconds: float) -> None:
        """Take note of how long a task took in an earlier run."""
        self._seconds.setdefault(_kind(task), []).append(seconds)

    def took(self, task: Task, seconds: float) -> None:
        """A task is done."""
        self._waiting[_kind(task)] -= 1
        self.learn(task, seconds)

    @property
    def guessed(self) -> int:
        """Waiting tasks of kinds none of which has been timed: they are taken to be like the others."""
        return sum(count for kind, count in self._waiting.items() if kind not in self._seconds)

    def left(self) -> float | None:
        """Seconds until the last task is done; none as long as no task has been timed.

        Tasks already begun count in full, so it errs on the long side.
        """
        if not self._seconds:
            return None
        usual = {kind: mean(seconds) for kind, seconds in self._seconds.items()}
        other = mean(usual.values())
        each = {kind: usual.get(kind, other) for kind, count in self._waiting.items() if count}
        total = sum(self._waiting[kind] * seconds for kind, seconds in each.items())
        return max(total / self._workers, *each.values(), 0.0) if each else 0.0


def _kind(task: Task) -> tuple[str, str]:
    return task.function, task.kind
