"""What many dreams say beside their observations: infos as Gymnasium's vector envs have them, each with its mask."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.envs.learned_model_batch import DreamStep, Stepped
from relgym.envs.learned_model_ends import CAUSES, Cause

__all__ = ["masked", "told_of"]


def told_of(step: DreamStep, stepped: Stepped, rows: NDArray[np.intp], count: int) -> dict[str, Any]:
    """Infos of a step of some of `count` dreams; what happened to none is left out.

    Parameters
    ----------
    step, stepped
        The step function, and what it gave.
    rows
        Numbers of the dreams that were stepped.
    count
        Number of all dreams.
    """
    infos: dict[str, Any] = {}
    cut = np.flatnonzero(stepped.truncated)
    if len(cut):
        reasons, names = (np.full(count, None, dtype=object) for _ in range(2))
        for k in cut.tolist():
            reasons[rows[k]] = step.reason(stepped, k)
            names[rows[k]] = CAUSES[stepped.causes[k]].name.lower()
        mask = _placed(np.ones(len(cut), dtype=np.bool_), rows[cut], count)
        infos |= {"reason": reasons, "_reason": mask, "cause": names, "_cause": mask.copy()}
    if stepped.success is not None:
        followed = (stepped.causes < 0) | (stepped.causes == CAUSES.index(Cause.HORIZON))
        infos["is_success"] = _placed(stepped.success, rows, count)
        infos["_is_success"] = _placed(followed, rows, count)
    return infos


def masked(infos: dict[str, Any], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """The infos of some of the dreams."""
    found: dict[str, Any] = {}
    for name in [name for name in infos if not name.startswith("_")]:
        if (left := infos[f"_{name}"] & mask).any():
            found |= {name: infos[name], f"_{name}": left}
    return found


def _placed(values: NDArray[Any], rows: NDArray[np.intp], count: int) -> NDArray[Any]:
    """Values of some of the dreams among zeros for the others."""
    whole = np.zeros(count, dtype=values.dtype)
    whole[rows] = values
    return whole
