"""scikit-learn's estimators behind the baselines' interface: refitted when asked after having learned something."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from relgym.baselines.base import Float1D, Float2D, Int1D, Memory

__all__ = ["FittedClassifier", "FittedRegressor"]


class _Fitted:
    """An estimator, what it was fitted to, and what came since.

    Parameters
    ----------
    make
        Gives a new estimator with ``fit`` and ``predict``.
    scale
        Whether features are brought to mean 0 and variance 1 first.
    limit
        Most examples an estimator is fitted to; of more, a random part is taken. For those whose cost grows with the
        square or the cube of it.
    rng
        Source of that part.
    """

    def __init__(
        self,
        make: Callable[[], Any],
        *,
        rng: np.random.Generator,
        scale: bool = True,
        limit: int | None = None,
    ) -> None:
        self._make, self._scale, self._limit, self._rng = make, scale, limit, rng
        self._memory = Memory()
        self._mean, self._deviation = np.empty(0), np.empty(0)
        self._estimator: Any = None

    def _learn(self, x: Float1D, y: Any) -> None:
        self._memory.add(x, y)
        self._estimator = None

    def _rows(self) -> tuple[Float2D, Float2D]:
        x, y = self._memory.x, self._memory.y
        if self._limit is None or len(x) <= self._limit:
            return x, y
        chosen = np.sort(self._rng.choice(len(x), self._limit, replace=False))
        return x[chosen], y[chosen]

    def _fit(self, target: Callable[[Float2D], Any]) -> None:
        x, y = self._rows()
        self._mean = x.mean(axis=0) if self._scale else np.zeros(x.shape[1])
        deviation = x.std(axis=0) if self._scale else np.ones(x.shape[1])
        self._deviation = np.where(deviation > 0.0, deviation, 1.0)
        with warnings.catch_warnings():
            from sklearn.exceptions import ConvergenceWarning

            warnings.simplefilter("ignore", ConvergenceWarning)  # a budget of iterations is a setting, too
            estimator = self._make()
            if getattr(estimator, "n_neighbors", 0) > len(x):  # as many as there are
                estimator.set_params(n_neighbors=len(x))
            self._estimator = estimator.fit(self._scaled(x), target(y))

    def _scaled(self, x: Float2D) -> Float2D:
        scaled: Float2D = (x - self._mean) / self._deviation
        return scaled


class FittedRegressor(_Fitted):
    """A regressor of scikit-learn's, fitted to everything seen; see `_Fitted` for the parameters.

    Values are divided by their standard deviations before the fit, so that no estimator's idea of small depends on
    units.
    """

    def learn_one(self, x: Float1D, y: Float1D) -> None:
        """Remember one example; the next question refits."""
        self._learn(x, y)

    def predict_one(self, x: Float1D) -> Float1D:
        """Values of one row, shape ``(m,)``."""
        values: Float1D = self.predict_batch(x[None])[0]
        return values

    def predict_batch(self, x: Float2D) -> Float2D:
        """Values of rows of shape ``(n, d)``, shape ``(n, m)``."""
        if not len(x):
            return np.empty((0, self._memory.y.shape[1]))
        units = self._memory.y.std(axis=0)
        units = np.where(units > 0.0, units, 1.0)
        if self._estimator is None:
            self._fit(lambda y: y / units)
        values: Float2D = np.asarray(self._estimator.predict(self._scaled(x)), dtype=np.float64)
        return values.reshape(len(x), -1) * units


class FittedClassifier(_Fitted):
    """A classifier of scikit-learn's, fitted to everything seen; see `_Fitted` for the parameters.

    As long as there is one class only, that is the answer.
    """

    def learn_one(self, x: Float1D, label: int) -> None:
        """Remember one example; the next question refits."""
        self._learn(x, [label])

    def predict_one(self, x: Float1D) -> int:
        """Class of one row."""
        return int(self.predict_batch(x[None])[0])

    def predict_batch(self, x: Float2D) -> Int1D:
        """Classes of rows of shape ``(n, d)``, shape ``(n,)``."""
        labels = self._memory.y[:, 0].astype(np.int64)
        if not len(x) or len(np.unique(labels)) == 1:
            return np.full(len(x), labels[0])
        if self._estimator is None:
            self._fit(lambda y: y[:, 0].astype(np.int64))
        return np.asarray(self._estimator.predict(self._scaled(x)), dtype=np.int64)
