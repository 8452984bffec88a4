"""What others make of the columns that a model was offered: ridge regression, and PySINDy's sparse regression."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import PRIME
from relgym.model.world_model import WorldModel
from relgym.scene.objects import SceneLayout, Transition

__all__ = ["BASELINES", "predicted", "ridge", "short", "sparse"]

Fit: TypeAlias = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]

THRESHOLDS: Final = (1e-4, 1e-3, 1e-2, 3e-2, 1e-1)
"""Least weights that sparse regression keeps, as shares of the change's spread; the last fifth of the rows decides."""

HELD_OUT: Final = 5
"""One in so many rows, the last ones."""


def predicted(
    model: WorldModel,
    training: Sequence[Transition],
    fresh: Sequence[Transition],
    baselines: Mapping[str, Fit] | None = None,
) -> dict[str, dict[str, NDArray[np.float64]]]:
    """Changes of fresh steps that each baseline predicts, by its name and by ``object.property``.

    Parameters
    ----------
    model
        Whose columns they are given: what its functions may hold of the present scene, features included. Columns are
        standardised, and those that never vary left out.
    training, fresh
        Steps of one layout, fitted to and predicted.
    baselines
        By name: weights from standardised columns and centred changes; default: `BASELINES`.
    """
    baselines = BASELINES if baselines is None else baselines
    found: dict[str, dict[str, NDArray[np.float64]]] = {name: {} for name in baselines}
    for part, x, z, y in _libraries(model, training, fresh):
        mean, spread = x.mean(axis=0), x.std(axis=0)
        varies = spread > 0.0
        shown, asked = ((each[:, varies] - mean[varies]) / spread[varies] for each in (x, z))
        for name, fit in baselines.items():
            found[name][part] = np.asarray(asked @ fit(shown, y - y.mean()) + y.mean())
    return found


def _libraries(
    model: WorldModel, training: Sequence[Transition], fresh: Sequence[Transition]
) -> Iterator[tuple[str, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    """Each property that is predicted: its name, columns of both kinds of steps, and what it changed by."""
    layout = training[0].before.layout
    before, later = (np.array([t.before.vector for t in part]) for part in (training, fresh))
    for target in model.targets:
        for index in layout.of_type(target.type):
            name, column = layout.names[index], layout.column(index, target.property)
            came = np.array([t.after[name][target.property] for t in training])
            y = short(came - before[:, column], target.property in layout.types[index].angles)
            x, z = (_columns(model, layout, vectors, index) for vectors in (before, later))
            yield f"{name}.{target.property}", x, z, y


def _columns(
    model: WorldModel, layout: SceneLayout, vectors: NDArray[np.float64], index: int
) -> NDArray[np.float64]:
    percept = model._parts.perception.percept(layout, vectors)
    signature = percept.situation(index).signature
    count = len(signature.columns) + len(signature.features)
    present = [k for k in range(count) if PRIME not in signature.named(k)]
    return signature.matrix(percept.rows(index, vectors.copy(), ordered=False), present)


def short(difference: NDArray[np.float64], angle: bool) -> NDArray[np.float64]:
    """Differences, of an angle the short way round."""
    return np.asarray(np.arctan2(np.sin(difference), np.cos(difference))) if angle else difference


def ridge(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights with a penalty of 1."""
    return np.asarray(np.linalg.solve(x.T @ x + np.eye(x.shape[1]), x.T @ y), dtype=np.float64)


def sparse(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights by sequentially thresholded least squares (Brunton et al. 2016), PySINDy's own."""
    kept = len(y) - len(y) // HELD_OUT
    errors = []
    for share in THRESHOLDS:
        off = x[kept:] @ _thresholded(x[:kept], y[:kept], share) - y[kept:]
        errors.append(float(np.square(off).mean()))
    return _thresholded(x, y, THRESHOLDS[int(np.argmin(errors))])


def _thresholded(x: NDArray[np.float64], y: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    from pysindy import STLSQ

    found = STLSQ(threshold=share * float(y.std()), alpha=1e-6 * len(y)).fit(x, y[:, None])
    return np.asarray(found.coef_[0], dtype=np.float64)


BASELINES: Final[Mapping[str, Fit]] = {"library": ridge, "sindy": sparse}
"""By name: ridge regression, and PySINDy."""
