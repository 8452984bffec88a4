"""Ridge regression kept up to date one row at a time: sums of products, solved anew as rows become more.

That costs the cube of the number of columns, 25 ms for 300 of them, so it is done in pieces, with the rows that come:
meanwhile the weights are those of the solution before, and none before the first one.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ALIKE, CACHED, MORE_ROOM, SEARCHED_CELLS, SUMMABLE

__all__ = ["OnlineRidge", "in_order"]


class OnlineRidge:
    """Least squares of several responses on the same columns, with an intercept.

    Parameters
    ----------
    columns
        Number of columns, d.
    due
        Number of rows from which weights are solved for the first time.

    Attributes
    ----------
    rows
        Number of rows taken in.
    solved
        Whether there are weights: until then they are 0.
    weights
        One row for each response, the intercept first, shape ``(responses, d + 1)``; of a response that came later
        than some rows, as if it had been 0 in those.
    left
        Mean square that the latest solution leaves of each response in rows like those that it comes from, shape
        ``(responses,)``: generalised cross-validation, what is left in the rows themselves over the square of the share
        of them that no weight takes up.
    mean, spread
        Where the columns lie, shape ``(d,)``, and the inverse of the sums of squares about that, with the penalty, in
        single precision, shape ``(d, d)``: what `leverage` is worked out from. Both are those of the latest solution.
    worked
        Cells that solving took with the latest row.

    Notes
    -----
    Cost O(d^2 + d * responses) a row; O(d^3 + d^2 * responses) at every tenth more, in pieces of `SEARCHED_CELLS`
    cells a row.

    References
    ----------
    Hoerl and Kennard (1970), Ridge regression; Golub, Heath and Wahba (1979), Generalized cross-validation.

    Examples
    --------
    >>> ridge = OnlineRidge(1)
    >>> for x in range(100):
    ...     ridge.add(np.array([float(x)]), np.array([2.0 * x + 3.0]))
    >>> bool(abs(ridge.predict(np.array([[5.0]]))[0, 0] - 13.0) < 1.0)
    True
    """

    def __init__(self, columns: int, due: int = 2) -> None:
        self.rows = 0
        self.weights = np.zeros((0, columns + 1))
        self.mean = np.zeros(columns)
        self.spread = np.full((columns, columns), np.inf, dtype=np.float32)
        self._half = (np.zeros((0, 0), dtype=np.float32), np.zeros((0, 0)))  # see `_halved`
        self._gram = np.zeros((columns + 1, columns + 1))
        self._moments = np.zeros((0, columns + 1))
        self._squares = np.zeros(0)
        self.left = np.zeros(0)
        self._due = due
        self.solved = False
        self._solved_of = 0  # rows that the weights come from, if they were solved here
        self._begun: _Solution | None = None
        self.worked = 0

    @property
    def columns(self) -> int:
        """Number of columns, d."""
        return len(self._gram) - 1

    def add(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
        """Take in one row of columns, shape ``(d,)``, and its responses, shape ``(responses,)``.

        One with a number beyond `SUMMABLE` is left out: of infinite sums no weights are ever solved again.
        """
        self.worked = 0
        row = np.concatenate([[1.0], x])
        self._widen(len(y))
        if not (np.abs(row).max() <= SUMMABLE and np.abs(y).max(initial=0.0) <= SUMMABLE):
            return
        self._gram += row[:, None] * row
        self._moments += y[:, None] * row
        self._squares += y * y
        self.rows += 1
        if self._begun is None and self.rows >= self._due:
            self._begin()
        if self._begun is not None:
            self.worked = self._begun.advance(SEARCHED_CELLS)
            self._finish()

    def _widen(self, responses: int) -> None:
        missing = responses - len(self._moments)
        if missing > 0:
            self._moments = np.pad(self._moments, ((0, missing), (0, 0)))
            self.weights = np.pad(self.weights, ((0, missing), (0, 0)))
            self._squares = np.pad(self._squares, (0, missing))
            self.left = np.pad(self.left, (0, missing), constant_values=np.inf)

    def solve(self) -> None:
        """Work out the weights from the rows so far, unless that was done."""
        if self._solved_of == self.rows:
            return
        if self._begun is None or self._begun.rows != self.rows:
            self._begin()
        if self._begun is not None:
            self._begun.advance(sys.maxsize)
            self._finish()

    def _begin(self) -> None:
        self._due = max(self.rows + 1, int((1.0 + MORE_ROOM) * self.rows))
        self._begun = _Solution(self.rows, self._gram, self._moments, self._squares) if self.rows else None

    def _finish(self) -> None:
        """Take over the solution that was begun, if it is done."""
        if self._begun is None or not self._begun.done:
            return
        done, self._begun = self._begun, None
        self._solved_of = done.rows
        if (found := done.weights()) is not None:
            self.solved = True
            self.mean, self.spread, weights, left = found
            later = len(self._moments) - len(weights)  # responses that came meanwhile
            self.weights = np.pad(weights, ((0, later), (0, 0)))
            self.left = np.pad(left, (0, later), constant_values=np.inf)

    @property
    def size(self) -> NDArray[np.float64]:
        """Mean square of each response, shape ``(responses,)``."""
        return self._squares / max(self.rows, 1)

    def predict(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Responses of rows ``(n, d)``, shape ``(n, responses)``; of a row alone the same bits as among others."""
        if len(x) == 1:
            return in_order(self.weights.T * np.concatenate([[1.0], x[0]])[:, None])[None]
        columns = np.concatenate([np.ones((1, len(x))), x.T])
        found = np.empty((len(x), len(self.weights)))
        for k, weights in enumerate(self.weights):
            found[:, k] = in_order(columns * weights[:, None])
        return found

    def leverage(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far rows ``(n, d)`` lie from those that the weights come from, shape ``(n,)``; 1/rows in their midst.

        Of noise with a variance of 1 the weights are off by so much there, squared. Cost O(d^2) a row.
        """
        found, half = np.empty(len(x)), self._halved()
        with np.errstate(over="ignore", invalid="ignore"):  # what lies that far is far from all
            for k, off in enumerate(x - self.mean):
                found[k] = in_order((off * in_order(half * off[:, None]))[:, None])[0]
        return np.where(found >= 0.0, found, np.inf) + 1.0 / max(self.rows, 1)

    def without(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Responses and leverage of rows that the weights come from, each as if it hadn't been learned; nearly.

        A row with leverage h takes the share h of what it misses into the weights, so that without it 1 / (1 - h) times
        as much is missed, and it lies h / (1 - h) far from the rest (PRESS: Allen 1974). As for all, cost O(d^2) a row.
        """
        off = x - self.mean
        leverage = (np.einsum("ij,jk->ik", off, self.spread) * off).sum(axis=1) + 1.0 / max(self.rows, 1)
        leverage = np.minimum(np.maximum(leverage, 0.0), 1.0 - 1.0 / max(self.rows, 2))
        rest = 1.0 - leverage
        said = self.weights[:, 0] + np.einsum("ij,rj->ir", x, self.weights[:, 1:])
        return y - (y - said) / rest[:, None], leverage / rest

    def _halved(self) -> NDArray[np.float64]:
        """Entries of `spread` on and above the diagonal, those above it twice, by the second column, then the first."""
        if self._half[0] is not self.spread:
            upper = self.spread.astype(np.float64)
            self._half = self.spread, np.ascontiguousarray((np.triu(upper) + np.triu(upper, 1)).T)
        return self._half[1]

    # ------------------------------------------------------------------ saving
    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The sums, which further rows are added to, the weights, and the sums that a solution was begun from."""
        sums = {"gram": self._gram, "moments": self._moments, "squares": self._squares}
        begun = {} if self._begun is None else self._begun.to_arrays()
        return {**sums, "weights": self.weights, "left": self.left, **begun}

    @classmethod
    def restored(cls, rows: int, due: int, arrays: Mapping[str, NDArray[Any]]) -> OnlineRidge:
        """What `to_arrays` wrote, of one that was solved; sums may be missing, then it can only predict."""
        weights = arrays["weights"]
        found = cls(weights.shape[1] - 1)
        found.solved = True
        found.rows, found._due, found.weights = rows, due, weights.copy()
        found._moments, found._squares = np.zeros_like(weights), np.zeros(len(weights))
        found.left = arrays.get("left", np.full(len(weights), np.inf)).copy()
        if "gram" in arrays:
            found._gram, found._moments = arrays["gram"].copy(), arrays["moments"].copy()
            found._squares = arrays["squares"].copy()
        if "begun" in arrays:
            found._begun = _Solution.restored(arrays)
        return found

    @property
    def due(self) -> int:
        """Number of rows at which weights are solved anew."""
        return self._due


def in_order(terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums along the first axis of ``(m, k)`` terms, one after the other: what any loop over them gives, to the bit."""
    if terms.shape[1] == 1:  # one after the other in memory, which NumPy adds in pairs
        found: NDArray[np.float64] = np.add.accumulate(terms, axis=0)[-1]
    else:
        found = np.ascontiguousarray(terms).sum(axis=0)
    return found


class _Solution:
    """Weights of some sums, worked out in pieces.

    The columns of the standardised covariance are swept out one after the other (Gauss-Jordan), which needs no pivots,
    since it is positive definite. Elementwise, so that it is the same to the bit whatever version of a linear algebra
    library lies behind NumPy, and however many threads that would begin; as many rows at once as a core's cache holds.
    """

    def __init__(
        self, rows: int, gram: NDArray[np.float64], moments: NDArray[np.float64], squares: NDArray[np.float64]
    ) -> None:
        self.rows, self._gram = rows, gram.copy()
        self._moments, self._squares = moments.copy(), squares.copy()
        self._mean = gram[0, 1:] / rows
        covariance = gram[1:, 1:] / rows - self._mean[:, None] * self._mean
        variance = covariance.diagonal()
        # What differs by rounding alone is constant.
        std = np.sqrt(np.where(variance > ALIKE**2 * (variance + np.square(self._mean)), variance, np.inf))
        self._alive = alive = np.isfinite(std)
        self._std = np.where(alive, std, 1.0)
        scaled = np.where(alive[:, None] & alive, covariance / (self._std[:, None] * self._std), 0.0)
        # The penalty is one: each weight of a standardised column is taken to be no larger than the noise that a single
        # row leaves, as scikit-learn's default has it. It keeps weights finite where columns depend on one another.
        self._inverse = scaled + np.eye(len(scaled)) / rows
        self._swept = 0

    @property
    def done(self) -> bool:
        """Whether all columns are swept out."""
        return self._swept == len(self._inverse)

    def advance(self, cells: int) -> int:
        """Sweep out columns for about so many cells, at least one; how many that took, a quarter each in a cache."""
        each = max(1, len(self._inverse) // 2) ** 2
        begin, self._swept = self._swept, min(self._swept + max(1, cells // each), len(self._inverse))
        _sweep(self._inverse, range(begin, self._swept))
        return (self._swept - begin) * each

    def weights(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.float64], NDArray[np.float64]] | None:
        """`OnlineRidge.mean`, `spread`, `weights` and `left`; None: they aren't finite."""
        n, inverse, mean = float(self.rows), self._inverse, self._mean
        level = self._moments[:, 0] / n
        slope = np.where(self._alive, (self._moments[:, 1:] / n - level[:, None] * mean) / self._std, 0.0)
        solved = np.einsum("rj,ij->ri", slope, inverse) / self._std
        if not np.isfinite(solved).all():
            return None
        # What never varied has no leverage: nothing is known of what it does, and the weights leave it out.
        ends = np.where(self._alive, 1.0 / self._std, 0.0)
        with np.errstate(over="ignore", under="ignore"):
            spread = (inverse * (ends[:, None] * ends) / n).astype(np.float32)
        level -= (solved * mean).sum(axis=1)
        weights = np.concatenate([level[:, None], solved], axis=1)
        taken = 1.0 + np.count_nonzero(self._alive) - float(inverse.diagonal()[self._alive].sum()) / n
        # Mean squares left in the rows that they come from.
        said = np.einsum("rj,ij->ri", weights, self._gram)
        left = self._squares + ((said - 2.0 * self._moments) * weights).sum(axis=1)
        left = np.maximum(left, 0.0) / n / max(1.0 - taken / n, 1.0 / n) ** 2
        return mean, np.triu(spread) + np.triu(spread, 1).T, weights, left

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The sums, and how far it has come."""
        found = {"begun": np.array([self.rows, self._swept], dtype=np.int64), "begun_gram": self._gram}
        return found | {"begun_moments": self._moments, "begun_squares": self._squares}

    @classmethod
    def restored(cls, arrays: Mapping[str, NDArray[Any]]) -> _Solution:
        """What `to_arrays` wrote; it sweeps out again what was."""
        rows, swept = arrays["begun"].tolist()
        with np.errstate(all="ignore"):  # of a damaged file nothing comes that is finite, and it is left out
            found = cls(rows, *(arrays[f"begun_{part}"] for part in ("gram", "moments", "squares")))
            _sweep(found._inverse, range(swept))
        found._swept = swept
        return found


def _sweep(matrix: NDArray[np.float64], columns: range) -> None:
    """Sweep out some columns of a matrix, in place; after all of them it is its inverse."""
    rows = max(1, CACHED // max(1, len(matrix)))
    parts, change = [matrix[k : k + rows] for k in range(0, len(matrix), rows)], np.empty_like(matrix[:rows])
    for k in columns:
        pivot = 1.0 / matrix[k, k]
        row, column = matrix[k] * pivot, matrix[:, k].copy()
        for begin, part in enumerate(parts):
            share = column[begin * rows :][: len(part), None]
            part -= np.multiply(share, row, out=change[: len(part)])
        matrix[:, k] = -column * pivot
        matrix[k] = row
        matrix[k, k] = pivot
