"""river's online learners behind the baselines' interface: AMRules and Hoeffding trees."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from relgym.baselines.base import Float1D, Float2D, Int1D, refuse_gaps

__all__ = ["StreamingClassifier", "StreamingRegressor"]


class StreamingRegressor:
    """A regressor of river's for every value, features scaled by their running means and variances.

    Parameters
    ----------
    make
        Gives a new river regressor.

    Notes
    -----
    Cost: a dictionary per example and value; nothing is remembered.
    """

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make
        self._parts: list[Any] = []
        self._scaler: Any = None

    def learn_one(self, x: Float1D, y: Float1D) -> None:
        """Take up one example; `ObservationError` for NaN or infinity."""
        refuse_gaps(x, y)
        if self._scaler is None:
            self._scaler, self._parts = _scaler(), [self._make() for _ in y]
        row = _row(x)
        self._scaler.learn_one(row)
        scaled = self._scaler.transform_one(row)
        for part, value in zip(self._parts, y.tolist(), strict=True):
            # AMRules divides by zero where a split leaves one side empty; the rule then simply isn't split.
            with suppress(ZeroDivisionError):
                part.learn_one(scaled, value)

    def predict_one(self, x: Float1D) -> Float1D:
        """Values of one row, shape ``(m,)``; zeros before the first example."""
        if self._scaler is None:
            return np.zeros(1)
        scaled = self._scaler.transform_one(_row(x))
        return np.array([float(part.predict_one(scaled)) for part in self._parts])

    def predict_batch(self, x: Float2D) -> Float2D:
        """Values of rows of shape ``(n, d)``, shape ``(n, m)``; one by one, since river knows no batches."""
        if not len(x):
            return np.empty((0, max(1, len(self._parts))))
        return np.stack([self.predict_one(row) for row in x])


class StreamingClassifier:
    """A classifier of river's; see `StreamingRegressor`."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._model = make()
        self._scaler: Any = None
        self._first = 0

    def learn_one(self, x: Float1D, label: int) -> None:
        """Take up one example; `ObservationError` for NaN or infinity."""
        refuse_gaps(x)
        if self._scaler is None:
            self._scaler, self._first = _scaler(), label
        row = _row(x)
        self._scaler.learn_one(row)
        self._model.learn_one(self._scaler.transform_one(row), label)

    def predict_one(self, x: Float1D) -> int:
        """Class of one row; before the model has an opinion, the first class seen."""
        if self._scaler is None:
            return self._first
        label = self._model.predict_one(self._scaler.transform_one(_row(x)))
        return self._first if label is None else int(label)

    def predict_batch(self, x: Float2D) -> Int1D:
        """Classes of rows, one by one."""
        return np.array([self.predict_one(row) for row in x], dtype=np.int64)


def _scaler() -> Any:
    from river import preprocessing

    return preprocessing.StandardScaler()


def _row(x: Float1D) -> dict[int, float]:
    return dict(enumerate(x.tolist()))
