"""When what was fitted to examples is fitted anew: whenever there are so many times as many."""

from __future__ import annotations

import math

__all__ = ["came_due", "due"]


def due(seen: int, first: int, times: float = 2) -> bool:
    """Whether so many examples are the first ones, or so many times as many, or that again.

    So all fits before the latest one cost no more than that does, or twice as much where there are half as many more.

    Parameters
    ----------
    seen
        Examples so far.
    first
        Examples that it is fitted to for the first time.
    times
        More than 1.

    Examples
    --------
    >>> [n for n in range(1_000) if due(n, 64)]
    [64, 128, 256, 512]
    >>> [n for n in range(5_000) if due(n, 64, 4)]
    [64, 256, 1024, 4096]
    """
    return came_due(seen - 1, seen, first, times)


def came_due(before: int, seen: int, first: int, times: float = 2) -> bool:
    """Whether one of the examples after the first `before` of `seen` was one at which it is `due`.

    Examples
    --------
    >>> came_due(60, 64, 64), came_due(64, 127, 64), came_due(64, 300, 64)
    (True, False, True)
    """
    while first <= before:
        first = math.ceil(times * first)
    return first <= seen
