"""Bounded memory: of a long history a uniform choice is kept, and all that is rare.

Which examples stay is decided by hashes of their serial numbers, the smallest ones first. That is a uniform reservoir
without a random number: it depends on nothing but how many examples came, and it needs no weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE
from relgym.config.constants import LITTLE, MORE_ROOM
from relgym.mixing import GOLDEN, mixed
from relgym.model.target.property_model import PropertyModel

__all__ = ["forget"]


def forget(table: ExampleTable, models: list[PropertyModel], bound: int) -> bool:
    """Cut a type's history back to its bound, if that is due; whether it was.

    Parameters
    ----------
    table
        The type's rows.
    models
        Models of its targets.
    bound
        Number of rows that stay. What classifiers remember stays in any case, and rare modes may exceed it a little.

    Notes
    -----
    Cost O(bound), whenever it has grown beyond that by `MORE_ROOM`.
    """
    if len(table) < (1.0 + MORE_ROOM) * bound:
        return False
    forced = np.zeros(len(table), dtype=bool)
    for model in models:
        forced[_indispensable(model, bound)] = True
    free = np.flatnonzero(~forced)
    room = max(0, bound - int(forced.sum()))
    kept = forced.copy()
    kept[free[np.argsort(_lot(table.serials[free]), kind="stable")[:room]]] = True
    for model in models:
        model.keep(kept)
    table.keep(kept)
    return True


def _indispensable(model: PropertyModel, bound: int) -> NDArray[np.int64]:
    """Rows of what classifiers remember, of modes that hold little beside the bound, and of recent noise."""
    log = model.clusterer
    chosen = [
        model.classifier.exemplars.rows.astype(np.intp),
        np.flatnonzero(log.labels == NOISE)[-bound // 4 :],  # a quarter at most
    ]
    for mode, count in zip(*np.unique(log.labels, return_counts=True), strict=True):
        if mode != NOISE and count < LITTLE * bound:
            chosen.append(np.flatnonzero(log.labels == mode))
    return log.rows[np.concatenate(chosen)]


def _lot(serials: NDArray[np.int64]) -> NDArray[np.uint64]:
    """A number that looks random for every serial number."""
    return mixed((serials.astype(np.uint64) + np.uint64(1)) * np.uint64(GOLDEN))
