"""Locally weighted regression, the thesis' baseline (§2.1.1, §4.7.1)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.baselines.base import Float1D, Float2D, Memory
from relgym.errors import ConfigError
from relgym.thesis.regression import fit_samples

__all__ = ["LocallyWeightedRegression"]

_CHUNK = 256
"""Queries regressed at once: 50 neighbours of 60 features each are some 6 MB then."""

_VARIANCE = 1e-15
"""Of the noise that stepwise fits expect, in squared units of the value; the program's."""


class LocallyWeightedRegression:
    """A linear function of each query's own, fitted to its nearest neighbours (Atkeson, Moore & Schaal, 1997).

    Rows of neighbours are multiplied by ``d ** -power``, d their Euclidean distance from the query (§4.7.1: d⁻³).
    Examples that lie exactly on the query are averaged.

    Parameters
    ----------
    neighbours
        How many examples count, at least 1 (thesis: 50, also 25). Raising it lowers the worst errors and raises the
        median (§4.7.1).
    power
        Exponent of the kernel (thesis: 3).
    ridge
        Penalty of weights relative to the neighbours' mean square, at least 0; it keeps fewer neighbours than features
        solvable.
    scale
        Whether features are brought to [0, 1] each before distances are measured. The thesis doesn't speak of it.
    stepwise
        Whether the fit is forward-stepwise (Algorithm 1, the thesis' own regression) rather than a ridge regression.

    Notes
    -----
    Cost: learning O(d); a query O(k d² + d³), and the search in a k-d tree that is rebuilt after learning.
    """

    def __init__(
        self,
        neighbours: int = 50,
        power: float = 3.0,
        ridge: float = 1e-8,
        *,
        scale: bool = True,
        stepwise: bool = False,
    ) -> None:
        if neighbours < 1 or ridge < 0.0:
            raise ConfigError(
                f"expected neighbours >= 1 and ridge >= 0, got neighbours={neighbours}, ridge={ridge}"
            )
        self.neighbours, self.power, self.ridge = neighbours, power, ridge
        self.scale, self.stepwise = scale, stepwise
        self._memory = Memory()
        self._tree: Any = None
        self._low, self._span = np.empty(0), np.empty(0)

    def learn_one(self, x: Float1D, y: Float1D) -> None:
        """Remember one example."""
        self._memory.add(x, y)
        self._tree = None

    def predict_one(self, x: Float1D) -> Float1D:
        """Values of one row, shape ``(m,)``."""
        values: Float1D = self.predict_batch(x[None])[0]
        return values

    def predict_batch(self, x: Float2D) -> Float2D:
        """Values of rows of shape ``(n, d)``, shape ``(n, m)``."""
        queries = self._scaled(x)
        if not queries.shape[1]:  # nothing ever varied: all examples lie on every query
            return np.repeat(self._memory.y.mean(axis=0)[None], len(x), axis=0)
        parts = [self._predict(queries[k : k + _CHUNK]) for k in range(0, len(x), _CHUNK)]
        return np.concatenate(parts) if parts else np.empty((0, self._memory.y.shape[1]))

    def _scaled(self, x: Float2D) -> Float2D:
        """Rows on the scale of what was learned; features that never varied there are left out."""
        if self._tree is None:
            from scipy.spatial import cKDTree

            learned = self._memory.x
            self._low, self._span = learned.min(axis=0), np.ptp(learned, axis=0)
            if not self.scale:
                self._span = (self._span > 0.0).astype(np.float64)
            own = self._on_scale(learned)
            self._tree = cKDTree(own) if own.shape[1] else ()
        return self._on_scale(x)

    def _on_scale(self, x: Float2D) -> Float2D:
        varied = self._span > 0.0
        scaled: Float2D = (x[:, varied] - self._low[varied]) / self._span[varied]
        return scaled

    def _predict(self, queries: Float2D) -> Float2D:
        k = min(self.neighbours, len(self._memory))
        distances, found = self._tree.query(queries, k=[*range(1, k + 1)])
        near, values = self._tree.data[found], self._memory.y[found]
        hits = distances == 0.0
        exact = hits.any(axis=1)
        weights = np.where(exact[:, None], 1.0, distances) ** -self.power
        weights /= weights.max(axis=1, keepdims=True)
        variance = _VARIANCE if self.stepwise else None
        fitted = _fits(near - queries[:, None], values, weights, self.ridge, variance)
        counts = np.maximum(hits.sum(axis=1), 1)[:, None]
        return np.where(exact[:, None], (values * hits[..., None]).sum(axis=1) / counts, fitted)


def _fits(
    offsets: NDArray[np.float64],
    values: NDArray[np.float64],
    weights: Float2D,
    ridge: float,
    variance: float | None = None,
) -> Float2D:
    """Value at offset 0 of a weighted linear fit to each query's neighbours: stepwise if there is a variance.

    Shapes: offsets ``(n, k, d)``, values ``(n, k, m)``, weights ``(n, k)``; result ``(n, m)``.
    """
    squares = weights**2 / (weights**2).sum(axis=1, keepdims=True)
    centre_x = np.einsum("nk,nkd->nd", squares, offsets)
    centre_y = np.einsum("nk,nkm->nm", squares, values)
    a = (offsets - centre_x[:, None]) * np.sqrt(squares)[..., None]
    b = (values - centre_y[:, None]) * np.sqrt(squares)[..., None]
    if variance is not None:
        slopes = np.stack([_stepwise(a, b[..., j], variance) for j in range(b.shape[2])], axis=2)
    else:
        gram = np.swapaxes(a, 1, 2) @ a
        scale = np.einsum("ndd->n", gram) / max(gram.shape[1], 1)
        gram += (ridge * scale + np.finfo(float).tiny)[:, None, None] * np.eye(gram.shape[1])
        slopes = np.linalg.pinv(gram, hermitian=True) @ (np.swapaxes(a, 1, 2) @ b)
    fits: Float2D = centre_y - np.einsum("nd,ndm->nm", centre_x, slopes)
    return fits


def _stepwise(a: NDArray[np.float64], b: Float2D, variance: float) -> Float2D:
    """Slopes of Algorithm 1, shape ``(n, d)``, of rows that are weighted and centred; their weights add up to 1."""
    n, k, d = a.shape
    columns, found, _ = fit_samples(k**0.5 * a, k**0.5 * b, variance, centred=True)
    slopes = np.zeros((n, d + 1))
    np.put_along_axis(slopes, np.where(columns >= 0, columns, d), found, axis=1)
    return slopes[:, :d]
