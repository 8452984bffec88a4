"""Recursive least squares: one linear function for everything, kept up to date example by example."""

from __future__ import annotations

import numpy as np

from relgym.baselines.base import Float1D, Float2D, refuse_gaps
from relgym.errors import ConfigError, QueryError

__all__ = ["RecursiveLeastSquares"]


class RecursiveLeastSquares:
    """Linear regression with forgetting, updated by rank one (Ljung, System Identification, §11.2).

    Parameters
    ----------
    forgetting
        Weight of an example one step later, λ in (0, 1]. Lowering it follows changes faster and averages less.
    prior
        Variance of the weights before the first example, > 0; the inverse of ridge regression's penalty.

    Notes
    -----
    Cost: O(d²) per example, O(d) per prediction.
    """

    def __init__(self, forgetting: float = 1.0, prior: float = 1e6) -> None:
        if not 0.0 < forgetting <= 1.0 or not prior > 0.0:
            raise ConfigError(
                f"expected forgetting in (0, 1] and prior > 0, got forgetting={forgetting}, prior={prior}"
            )
        self.forgetting, self.prior = forgetting, prior
        self._weights: Float2D | None = None
        self._covariance = np.empty((0, 0))

    def learn_one(self, x: Float1D, y: Float1D) -> None:
        """Move the weights by the error, along the gain; `ObservationError` for NaN or infinity."""
        refuse_gaps(x, y)
        row = np.append(x, 1.0)
        if self._weights is None:
            self._weights = np.zeros((len(row), len(y)))
            self._covariance = self.prior * np.eye(len(row))
        spread = self._covariance @ row
        gain = spread / (self.forgetting + row @ spread)
        self._weights += np.outer(gain, y - row @ self._weights)
        self._covariance = (self._covariance - np.outer(gain, spread)) / self.forgetting
        self._covariance = 0.5 * (self._covariance + self._covariance.T)  # rounding must not make it lopsided

    def predict_one(self, x: Float1D) -> Float1D:
        """Values of one row, shape ``(m,)``."""
        values: Float1D = self.predict_batch(x[None])[0]
        return values

    def predict_batch(self, x: Float2D) -> Float2D:
        """Values of rows of shape ``(n, d)``, shape ``(n, m)``."""
        if self._weights is None:
            raise QueryError("nothing learned yet: call learn_one first")
        values: Float2D = x @ self._weights[:-1] + self._weights[-1]
        return values
