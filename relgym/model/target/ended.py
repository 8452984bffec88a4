"""Modes that have ended: the world changed, and others hold in the situations that were theirs.

No clause can tell such modes from those that took their place, since the same conditions hold for both: all that
differs is when. So what has ended takes no part in the vote any more, and clauses are learned between the others alone.
It is kept, and votes again as soon as an example comes that it alone explains.

A world that stays as it is has modes that seldom hold, and it goes through its situations in turns. Therefore three
things must come together. Nothing tells which mode holds (`relgym.model.target.hindsight`). Where the mode wins the
vote it is wrong, since its record began or began anew, or ever since it was right, however often clauses were learned
again in between (`relgym.model.predicting.calibration.Calibration.failing`). And it has not held for so long that this
is news, among the examples of it and of its alternatives, which nothing tells it from: in a share p of those up to its
last one, and in none of the n since, which has the probability (1 - p)^n; but since what comes in a row is alike, each
tells one bit at most. Where it came back less often than that, after a share q of those for which it was away, it is
(1 - q)^n: what comes and goes, as the hidden states of a world do, isn't missed before it stays away for much longer
than it used to. What is news says `EVIDENCE`.

Once a law that took the place of one that had ended has ended, too, laws come and go: a mass is drawn anew in every
episode. Then that a law was right in its time, however often, tells less of what comes next than what became of all of
them (`relgym.model.predicting.calibration.Calibration.fleeting`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import EVIDENCE, FOUNDING, NEARLY_ALL, SMALL

__all__ = ["come_and_go", "ended"]


def ended(
    labels: NDArray[np.int32],
    modes: Sequence[int],
    failing: Callable[[int], bool],
    alternatives: Callable[[int], Collection[int]],
) -> set[int]:
    """Modes that have ended, as long as there are others that haven't.

    Parameters
    ----------
    labels
        Id of the mode that explains each example, oldest first, shape ``(n,)``.
    modes
        Ids of those that take part in the vote.
    failing
        Whether a mode is wrong where it wins the vote.
    alternatives
        Modes that nothing tells a mode from.

    Notes
    -----
    Cost O(n) for each mode that fails.

    Examples
    --------
    >>> wrong, alike = lambda mode: mode == 1, lambda mode: {1: {3}, 2: (), 3: {1}}[mode]
    >>> ended(np.array([1, 2] * 20 + [3, 2] * 20), [1, 2, 3], wrong, alike)
    {1}
    >>> ended(np.array([1, 2] * 20 + [3, 2] * 3), [1, 2, 3], wrong, alike)  # three steps tell nothing yet
    set()
    """

    def holds(mode: int) -> NDArray[np.bool_]:
        among = labels[np.isin(labels, [mode, *alternatives(mode)])]
        return np.asarray(among == mode)

    over = {mode for mode in modes if failing(mode) and _news(holds(mode))}
    return over if len(over) < len(modes) else set()


def _news(holds: NDArray[np.bool_]) -> bool:
    """Whether it is news that a mode which held in these examples has not held since the last of them."""
    times = np.flatnonzero(holds)
    until = int(times.max(initial=-1)) + 1
    gaps = np.diff(times) - 1
    returns = (np.count_nonzero(gaps) + 0.5) / (gaps.sum() + 1.0)  # a prior that says nothing, as Jeffreys'
    share = min(len(times) / (until + 1.0), returns)  # never all: nothing is known to hold always
    return (len(holds) - until) * min(-math.log2(1.0 - share), 1.0) >= EVIDENCE


def come_and_go(labels: NDArray[np.int32], past: Collection[int]) -> bool:
    """Whether a law that took the place of one that had ended has ended itself.

    Laws count that held for more examples than it takes to find one: what is found while a change is under way is
    often a mixture of both, and is soon replaced.

    Parameters
    ----------
    labels
        Id of the mode that explains each example, oldest first, shape ``(n,)``.
    past
        Ids of those that have ended.

    Examples
    --------
    >>> come_and_go(np.repeat([1, 2, 3], 100), {1, 2}), come_and_go(np.repeat([1, 2, 3], 100), {1})
    (True, False)
    >>> come_and_go(np.repeat([1, 2, 3], [100, 20, 100]), {1, 2})
    False
    """
    held = [np.flatnonzero(labels == mode) for mode in past]
    times = [np.quantile(each, (SMALL, NEARLY_ALL)) for each in held if len(each) > max(FOUNDING)]
    return len(times) > 1 and bool(max(begun for begun, _ in times) > min(over for _, over in times))
