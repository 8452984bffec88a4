"""Computations that can be interrupted: generators that yield the work done since the last time.

Work is counted in *cells*, numbers looked at, never in seconds: so what is done in which step is the same on every
machine. A thousand million cells take one to four seconds of one core; a piece should have no more than a few million.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Generator
from typing import Any, Generic, ParamSpec, TypeAlias, TypeVar

__all__ = ["Resumable", "Steps", "Task", "resumable"]

T = TypeVar("T")
P = ParamSpec("P")

Steps: TypeAlias = Generator[int, None, T]
"""Yields the cells of work done since the last time, and returns the result."""


class Resumable(Generic[P, T]):
    """A function that may be called as any other one, or be worked on piece by piece (`steps`).

    Parameters
    ----------
    function
        A generator function: yields cells of work, returns the result.

    Examples
    --------
    >>> @resumable
    ... def total(numbers):
    ...     found = 0
    ...     for number in numbers:
    ...         found += number
    ...         yield 1
    ...     return found
    >>> total([1, 2, 3])
    6
    >>> list(total.steps([1, 2, 3]))
    [1, 1, 1]
    """

    def __init__(self, function: Callable[P, Steps[T]]) -> None:
        functools.update_wrapper(self, function)
        self.steps = function

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> T:
        """Do all of it at once."""
        steps = self.steps(*args, **kwargs)
        while True:
            try:
                next(steps)
            except StopIteration as end:
                found: T = end.value
                return found

    def __reduce__(self) -> str:
        return str(self.__name__)  # type: ignore[attr-defined]


def resumable(function: Callable[P, Steps[T]]) -> Resumable[P, T]:
    """Decorator of generator functions: see `Resumable`."""
    return Resumable(function)


class Task(Generic[T]):
    """A computation under way, on arguments that nobody changes any more.

    It can be copied and pickled wherever it stands: the copy takes the same pieces again when it is asked to go on.

    Parameters
    ----------
    work
        What is computed.
    args, kwargs
        Its arguments. A generator of random numbers is copied, so that it is drawn from as if nobody else did.

    Attributes
    ----------
    done : bool
        Whether there is a result.
    result
        The result, once it is done.
    pieces : int
        Pieces of work done so far.
    rng : numpy.random.Generator or None
        The copy of the argument ``rng``, as far as it has been drawn from.
    """

    def __init__(self, work: Resumable[..., T], *args: Any, **kwargs: Any) -> None:
        self._work, self._args = work, args
        self._kwargs = {name: copy.deepcopy(v) if name == "rng" else v for name, v in kwargs.items()}
        self.done = False
        self.pieces = 0
        self.result: T
        self.rng: Any = None
        self._steps: Steps[T] | None = None

    def advance(self, budget: int) -> int:
        """Work until it is done or the budget is spent; what was spent, in cells: the last piece may overdraw it."""
        if self.done:
            return 0
        if self._steps is None:
            self._start()
        assert self._steps is not None
        spent = 0
        while spent < budget:
            try:
                spent += next(self._steps)
            except StopIteration as end:
                self.done, self.result = True, end.value
                break
            self.pieces += 1
        return spent

    def _start(self) -> None:
        kwargs = dict(self._kwargs)
        if "rng" in kwargs:
            self.rng = kwargs["rng"] = copy.deepcopy(kwargs["rng"])
        steps = self._steps = self._work.steps(*self._args, **kwargs)
        for _ in range(self.pieces):  # a copy catches up
            next(steps)

    def __getstate__(self) -> dict[str, Any]:
        if self.done:
            return self.__dict__ | {"_steps": None, "_args": (), "_kwargs": {}}
        return self.__dict__ | {"_steps": None, "rng": None}
