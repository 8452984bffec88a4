"""Short rules that all fit the same examples: where they differ, nobody knows yet."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import FIRST, SHORT

__all__ = ["VersionSpace"]


class VersionSpace:
    """A sample of the version space of boxes: intervals of a few columns that hold of some examples and of no others.

    A threshold that is learned lies somewhere between the nearest examples on either side, and which properties it is
    of may be open as well. One rule would hide that; the share of many that fit tells how sure it is (Mitchell 1982;
    query by committee, Seung et al. 1992). Inside the positive examples' hull all rules agree.

    Rules are of the smallest sets of columns that tell the examples apart. A priori half of the bounds don't exist, and
    the others lie anywhere between the hull's edge and the farthest value seen.

    Parameters
    ----------
    positive, negative
        Examples of which the rules hold, and of which they don't; shape ``(p, d)`` and ``(n, d)``, `p` at least 1.
    rng
        Draws the rules.
    count
        How many are drawn.
    longest
        Most columns of a rule.

    Attributes
    ----------
    found : bool
        Whether there is any rule; without negative examples there is none to be looked for.

    Examples
    --------
    >>> import numpy as np
    >>> held = np.array([[0.0, 1.0], [0.0, -1.0]])
    >>> not_held = np.array([[0.0, 3.0], [2.0, 0.0], [0.0, -3.0]])
    >>> boxes = VersionSpace(held, not_held, rng=np.random.default_rng(0))
    >>> boxes.share(np.array([[0.0, 0.5], [0.0, 3.0], [2.0, 0.0]])).tolist()
    [1.0, 0.0, 0.0]
    >>> bool(0.0 < boxes.share(np.array([[0.0, 2.0]]))[0] < 1.0)
    True

    Notes
    -----
    Cost: ``n * d**2`` to ``n * d**3`` comparisons to find the sets of columns, and some ten passes through the negative
    examples for each rule; of `share` ``2 * longest * count`` comparisons a point.
    """

    def __init__(
        self,
        positive: NDArray[np.float64],
        negative: NDArray[np.float64],
        *,
        rng: np.random.Generator,
        count: int = FIRST,
        longest: int = SHORT,
    ) -> None:
        self._least, self._most = positive.min(axis=0), positive.max(axis=0)
        both = np.concatenate([positive, negative])
        self._first, self._last = both.min(axis=0), both.max(axis=0)
        sets = self._sets(negative, longest)
        self.found = bool(sets)
        if not sets:
            return
        sizes = np.array([len(each) for each in sets])
        weights = np.exp2(-sizes) / np.bincount(sizes)[sizes]  # sets of many columns are many
        drawn = rng.choice(len(sets), size=count, p=weights / weights.sum())
        width = max(sizes[drawn])
        # A column that is asked twice doesn't matter: short rules are filled up with their first one.
        # The first columns of all rules, the second ones, …: shape (width, count).
        self._columns = np.array(
            [(*sets[k], *[sets[k][0]] * (width - sizes[k])) for k in drawn], dtype=np.intp
        ).T.copy()
        bounds = [self._box(negative[:, list(sets[k])], list(sets[k]), rng) for k in drawn]
        self._low = np.array([(*low, *[low[0]] * (width - len(low))) for low, _ in bounds]).T.copy()
        self._high = np.array([(*high, *[high[0]] * (width - len(high))) for _, high in bounds]).T.copy()

    def share(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Share of the rules that hold of n points, shape ``(n,)``."""
        held = np.ones((len(points), self._columns.shape[1]), dtype=np.bool_)
        for columns, low, high in zip(self._columns, self._low, self._high, strict=True):
            asked = points.take(columns, axis=1)
            held &= asked >= low
            held &= asked <= high
        share: NDArray[np.float64] = np.count_nonzero(held, axis=1) / held.shape[1]
        return share

    def _sets(self, negative: NDArray[np.float64], longest: int) -> list[tuple[int, ...]]:
        """The smallest sets of columns in which no negative example lies within the positive ones' hull."""
        inside = ((negative >= self._least) & (negative <= self._most)).astype(np.float32)
        open_columns = np.flatnonzero((self._first < self._last) & ~inside.all(axis=0)).tolist()
        found: list[tuple[int, ...]] = []
        for size in range(1, longest + 1):
            if size == 1:
                told: list[tuple[int, ...]] = [(j,) for j in open_columns if not inside[:, j].any()]
            else:
                told = []
                for start in combinations(open_columns, size - 2):
                    part = inside[:, list(start)].all(axis=1)
                    apart = inside[part].T @ inside[part] == 0.0
                    told += [
                        (*start, i, j)
                        for i, j in combinations(open_columns, 2)
                        if apart[i, j] and (not start or i > start[-1])
                    ]
            smaller = [set(each) for each in found]
            found += [each for each in told if not any(own <= set(each) for own in smaller)]
        return found

    def _box(
        self, negative: NDArray[np.float64], columns: list[int], rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """One rule of these columns: bounds beyond the hull, drawn in until no negative example is left inside."""
        least, most = self._least[columns], self._most[columns]
        low = least - rng.random(len(columns)) * (least - self._first[columns])
        high = most + rng.random(len(columns)) * (self._last[columns] - most)
        low[rng.random(len(columns)) < 0.5] = -np.inf  # a bound is as likely as none
        high[rng.random(len(columns)) < 0.5] = np.inf
        inside = np.flatnonzero(((negative >= low) & (negative <= high)).all(axis=1))
        while len(inside):
            value = negative[int(rng.choice(inside))]
            j = int(rng.choice(np.flatnonzero((value < least) | (value > most))))
            share = rng.random()
            if value[j] < least[j]:
                low[j] = least[j] - share * (least[j] - value[j])
            else:
                high[j] = most[j] + share * (value[j] - most[j])
            left = negative[inside]
            inside = inside[((left >= low) & (left <= high)).all(axis=1)]
        return low, high
