"""Actions in many scenes at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError
from relgym.scene.objects import ACTION, Float2D, SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = ["acting_all"]


def acting_all(
    schema: SceneSchema, layout: SceneLayout, vectors: Float2D, actions: NDArray[Any]
) -> tuple[SceneLayout, NDArray[np.float64]]:
    """Layout and state vectors with actions in them, in physical units: `relgym.envs.actions.acting` for n.

    Raises
    ------
    ConfigError
        The action object has more properties than an action has numbers: a view makes them (`Lens.acting`).
    """
    if ACTION not in schema.order:
        return layout, vectors
    whole = schema.layout((*layout.names, ACTION))
    done = np.asarray(actions, dtype=np.float64).reshape(len(vectors), -1)
    if schema.action_scale:
        ranges = {p: (k, low, high) for k, (p, low, high) in enumerate(schema.action_scale)}
        order, low, high = map(
            list, zip(*(ranges[p] for p in schema.type_of(ACTION).properties), strict=True)
        )
        done = low + (done[:, order] + 1.0) / 2.0 * np.subtract(high, low)
    if done.shape[1] != (known := len(schema.type_of(ACTION).properties)):
        raise ConfigError(
            f"expected {known} numbers for each action, as the action object has, got {done.shape[1]}: what a view "
            "makes of them Lens(env).acting says, acting= of a LearnedRewardModel"
        )
    at = whole.offsets[whole.index(ACTION)]
    return whole, np.concatenate([vectors[:, :at], done, vectors[:, at:]], axis=1)
