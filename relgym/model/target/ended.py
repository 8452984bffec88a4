"""Modes that have ended: the world changed, and others hold in the situations that were theirs.

No clause can tell such modes from those that took their place, since the same conditions hold for both: all that
differs is when. So what has ended takes no part in the vote any more, and clauses are learned between the others alone.
It is kept, and votes again as soon as an example comes that it alone explains.

A world that stays as it is has modes that seldom hold, and it goes through its situations in turns. Therefore three
things must come together. Nothing tells which mode holds (`relgym.model.target.hindsight`). Where the mode wins the
vote it is wrong, since its record began or began anew, or ever since it was right, however often clauses were learned
again in between (`relgym.model.predicting.calibration.Calibration.failing`). And it has not held for so long that this
is news: in a share p of the examples up to its last one, and in none of the n since, which has the probability
(1 - p)^n; but since what comes in a row is alike, each tells one bit at most. Where it came back less often than that,
after a share q of the examples for which it was away, it is (1 - q)^n: what comes and goes, as the hidden states of a
world do, isn't missed before it stays away for much longer than it used to. What is news says `EVIDENCE`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import EVIDENCE

__all__ = ["ended"]


def ended(labels: NDArray[np.int32], modes: Sequence[int], failing: Callable[[int], bool]) -> set[int]:
    """Modes that have ended, as long as there are others that haven't.

    Parameters
    ----------
    labels
        Id of the mode that explains each example, oldest first, shape ``(n,)``.
    modes
        Ids of those that take part in the vote.
    failing
        Whether a mode is wrong where it wins the vote.

    Notes
    -----
    Cost O(n) for each mode that fails.

    Examples
    --------
    >>> ended(np.array([1, 2] * 20 + [3, 2] * 20), [1, 2, 3], lambda mode: mode == 1)
    {1}
    >>> ended(np.array([1, 2] * 20 + [3, 2] * 3), [1, 2, 3], lambda mode: mode == 1)  # six steps tell nothing yet
    set()
    """
    over = {mode for mode in modes if failing(mode) and _news(labels == mode)}
    return over if len(over) < len(modes) else set()


def _news(holds: NDArray[np.bool_]) -> bool:
    """Whether it is news that a mode which held in these examples has not held since the last of them."""
    times = np.flatnonzero(holds)
    until = int(times.max(initial=-1)) + 1
    gaps = np.diff(times) - 1
    returns = (np.count_nonzero(gaps) + 0.5) / (gaps.sum() + 1.0)  # a prior that says nothing, as Jeffreys'
    share = min(len(times) / (until + 1.0), returns)  # never all: nothing is known to hold always
    return (len(holds) - until) * min(-math.log2(1.0 - share), 1.0) >= EVIDENCE
