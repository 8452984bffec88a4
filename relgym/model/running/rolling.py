"""Roll-outs of many scenes at once: where each has come to, and how far it was predicted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.model.predicting.prediction import BatchPrediction
from relgym.scene.objects import SceneLayout

__all__ = ["BatchRollout", "step_by_step"]


@dataclass(frozen=True, slots=True)
class BatchRollout:
    """Where roll-outs of n scenes with the same objects have come to.

    Attributes
    ----------
    layout
        The scenes' layout.
    vectors
        The last state vectors of which everything was predicted, shape ``(n, layout.width)``; the action in them is the
        last one that was tried.
    lasted
        How many steps were predicted, shape ``(n,)``; fewer than were asked for where some prediction wasn't `ok`.
    """

    layout: SceneLayout
    vectors: NDArray[np.float64]
    lasted: NDArray[np.int64]


def step_by_step(
    predicts: Callable[[SceneLayout, NDArray[np.float64]], BatchPrediction],
    layout: SceneLayout,
    vectors: NDArray[np.float64],
    actions: NDArray[np.float64],
    first: int,
) -> BatchRollout:
    """Roll scenes out by predictions of one step of all that still go on.

    Parameters
    ----------
    predicts
        As `relgym.model.world_model.WorldModel.predict_batch`.
    layout, vectors
        The scenes.
    actions, first
        Numbers of actions, shape ``(steps, n, k)``, and the column of their first one.
    """
    now, lasted = vectors.copy(), np.zeros(len(vectors), dtype=np.int64)
    going = np.arange(len(vectors))
    for taken in actions:
        now[going, first : first + actions.shape[-1]] = taken[going]
        said = predicts(layout, now[going])
        going = going[said.ok]
        now[going] = said.vectors[said.ok]
        lasted[going] += 1
        if not len(going):
            break
    return BatchRollout(layout, now, lasted)
