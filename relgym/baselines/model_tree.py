"""A linear model tree: a regression tree whose leaves hold linear functions (Quinlan's M5, 1992)."""

from __future__ import annotations

from typing import Any

import numpy as np

from relgym.baselines.base import Float2D
from relgym.errors import ConfigError

__all__ = ["LinearModelTree"]


class LinearModelTree:
    """scikit-learn's CART with a ridge regression in each leaf; an estimator with ``fit`` and ``predict``.

    Parameters
    ----------
    leaf
        Fewest examples in a leaf, at least 2. Raising it gives fewer, better founded functions.
    depth
        Most tests between root and leaf; 0: a single linear function.
    ridge
        Penalty of the weights, relative to the leaf's mean square.
    random_state
        Settles equally good splits.
    """

    def __init__(self, leaf: int = 30, depth: int = 8, ridge: float = 1e-8, *, random_state: int = 0) -> None:
        if leaf < 2 or depth < 0 or ridge < 0.0:
            raise ConfigError(
                f"expected leaf >= 2, depth >= 0 and ridge >= 0, got {leaf}, {depth} and {ridge}"
            )
        self.leaf, self.depth, self.ridge, self.random_state = leaf, depth, ridge, random_state
        self._tree: Any = None
        self._weights: dict[int, Float2D] = {}

    def fit(self, x: Float2D, y: Float2D) -> LinearModelTree:
        """Grow the tree on rows ``(n, d)`` and values ``(n, m)``, then regress in every leaf."""
        from sklearn.tree import DecisionTreeRegressor

        self._tree = DecisionTreeRegressor(
            max_depth=self.depth or None,
            min_samples_leaf=self.leaf if self.depth else len(x),
            random_state=self.random_state,
        ).fit(x, y)
        leaves = self._tree.apply(x)
        self._weights = {
            int(k): _ridge(x[leaves == k], np.asarray(y)[leaves == k], self.ridge) for k in np.unique(leaves)
        }
        return self

    def predict(self, x: Float2D) -> Float2D:
        """Values of rows of shape ``(n, d)``, shape ``(n, m)``."""
        leaves = self._tree.apply(x)
        widths = {w.shape[1] for w in self._weights.values()}
        values = np.empty((len(x), widths.pop()))
        for k in np.unique(leaves):
            part = leaves == k
            values[part] = x[part] @ self._weights[int(k)][:-1] + self._weights[int(k)][-1]
        return values


def _ridge(x: Float2D, y: Float2D, ridge: float) -> Float2D:
    """Weights and intercept, shape ``(d + 1, m)``; columns that don't vary in the leaf get no weight."""
    centre_x, centre_y = x.mean(axis=0), y.mean(axis=0)
    a, b = x - centre_x, y - centre_y
    varied = np.ptp(a, axis=0) > 1e-12
    gram = a[:, varied].T @ a[:, varied]
    penalty = ridge * float(np.trace(gram)) / max(len(gram), 1)
    weights = np.zeros((x.shape[1], y.shape[1]))
    weights[varied] = np.linalg.lstsq(gram + penalty * np.eye(len(gram)), a[:, varied].T @ b, rcond=None)[0]
    return np.vstack([weights, centre_y - centre_x @ weights])
