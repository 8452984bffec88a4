"""The interface of every baseline: rows of numbers in, the next values or the mode out.

A baseline sees a scene as a row of features (`relgym.baselines.features`), never as objects. Regressors predict the
next values of one or several properties, classifiers the number of a mode.
"""

from __future__ import annotations

from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ObservationError, QueryError

__all__ = ["Classifier", "Float1D", "Float2D", "Int1D", "Memory", "Regressor", "refuse_gaps"]

Float1D: TypeAlias = NDArray[np.float64]
Float2D: TypeAlias = NDArray[np.float64]
Int1D: TypeAlias = NDArray[np.int64]


class Regressor(Protocol):
    """Learns, one example at a time, a function from d features to m values."""

    def learn_one(self, x: Float1D, y: Float1D) -> None:
        """Take up one example: features of shape ``(d,)``, values of shape ``(m,)``."""
        ...

    def predict_one(self, x: Float1D) -> Float1D:
        """Values of one row of features, shape ``(m,)``."""
        ...

    def predict_batch(self, x: Float2D) -> Float2D:
        """Values of rows of features of shape ``(n, d)``, shape ``(n, m)``; the same as row by row."""
        ...


class Classifier(Protocol):
    """Learns, one example at a time, which of several classes holds."""

    def learn_one(self, x: Float1D, label: int) -> None:
        """Take up one example: features of shape ``(d,)`` and its class."""
        ...

    def predict_one(self, x: Float1D) -> int:
        """Class of one row of features."""
        ...

    def predict_batch(self, x: Float2D) -> Int1D:
        """Classes of rows of features of shape ``(n, d)``, shape ``(n,)``."""
        ...


def refuse_gaps(*parts: Any) -> None:
    """Raise `ObservationError` where an example holds NaN or infinity: what remembers sums would never be rid of it."""
    if not all(np.isfinite(part).all() for part in parts):
        raise ObservationError("an example holds NaN or infinity: leave it out or fix it")


class Memory:
    """Rows and what belongs to them, in the order in which they came.

    Examples
    --------
    >>> memory = Memory()
    >>> memory.add([1.0, 2.0], [3.0])
    >>> memory.x.shape, memory.y.shape
    ((1, 2), (1, 1))
    """

    def __init__(self) -> None:
        self._x, self._y = np.empty((0, 0)), np.empty((0, 0))
        self._used = 0

    def __len__(self) -> int:
        return self._used

    def add(self, x: Any, y: Any) -> None:
        """Remember one row of shape ``(d,)`` and its values of shape ``(m,)``.

        Raises
        ------
        ObservationError
            NaN or infinity, or other lengths than before; the memory is unchanged.

        Notes
        -----
        Cost: O(d + m), amortised.
        """
        row, values = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if not self._used:
            self._x, self._y = np.empty((64, len(row))), np.empty((64, len(values)))
        if row.shape != self._x.shape[1:] or values.shape != self._y.shape[1:]:
            raise ObservationError(
                f"expected {self._x.shape[1]} features and {self._y.shape[1]} values as before, "
                f"got shapes {row.shape} and {values.shape}"
            )
        refuse_gaps(row, values)
        if self._used == len(self._x):
            self._x = np.concatenate([self._x, np.empty_like(self._x)])
            self._y = np.concatenate([self._y, np.empty_like(self._y)])
        self._x[self._used], self._y[self._used] = row, values
        self._used += 1

    @property
    def x(self) -> Float2D:
        """All rows, shape ``(n, d)``; `QueryError` before the first."""
        self._require()
        return self._x[: self._used]

    @property
    def y(self) -> Float2D:
        """Their values, shape ``(n, m)``; `QueryError` before the first."""
        self._require()
        return self._y[: self._used]

    def _require(self) -> None:
        if not self._used:
            raise QueryError("nothing learned yet: call learn_one first")
