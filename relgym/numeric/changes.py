"""From when on something was wrong more often than before."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["changed_at"]


def changed_at(wrong: Sequence[bool] | NDArray[np.bool_]) -> int | None:
    """From which step on something was wrong more often than before, if it was.

    Two shares of wrong steps, one up to some step and one from there on, are stated instead of one if that takes fewer
    bits, those included that state the second share, half of ``log2(n)``, and where it begins, all of it (Rissanen
    1983).

    Parameters
    ----------
    wrong
        Whether it was wrong, in n steps, the latest one last.

    Returns
    -------
    Number of the first step of the second part, from 1 to n - 1; None if one share says it as well.

    Examples
    --------
    >>> changed_at([False] * 40 + [True] * 10)
    40
    >>> changed_at([False, True] * 25) is None
    True
    """
    count = len(wrong)
    if count < 2:
        return None
    misses = np.cumsum(wrong)
    before = np.arange(1, count)
    after = count - before
    early, late = misses[:-1], misses[-1] - misses[:-1]
    saved = _bits(misses[-1], count) - _bits(early, before) - _bits(late, after)
    saved[early * after >= late * before] = -np.inf
    best = int(np.argmax(saved))
    return best + 1 if saved[best] > (0.5 + 1.0) * np.log2(count) else None


def _bits(misses: Any, of: Any) -> Any:
    """What it takes to state which of so many steps were wrong, by their share."""
    share = misses / of
    return of * (_entropy(share) + _entropy(1.0 - share))


def _entropy(share: Any) -> Any:
    """``-p * log2(p)``, 0 of nothing.

    ``scipy.special.entr`` says the same in nats; importing it takes longer than importing the rest of the learner.
    """
    return -share * np.log2(np.where(share > 0, share, 1.0))
