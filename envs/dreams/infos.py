"""What many dreams say beside their observations: infos as Gymnasium's vector envs have them, each with its mask."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.envs.dreams.ends import CAUSES, Cause
from relgym.envs.dreams.step import DreamStep, Stepped

__all__ = ["masked", "told_of"]

_HORIZON = CAUSES.index(Cause.HORIZON)
_NAMES = tuple(cause.name.lower() for cause in CAUSES)


def told_of(step: DreamStep, stepped: Stepped, going: NDArray[np.bool_] | None) -> dict[str, Any]:
    """Infos of a step of many dreams; what happened to none is left out.

    Parameters
    ----------
    step, stepped
        The step function, and what it gave.
    going
        Which dreams went on, shape ``(n,)``; None: all.
    """
    infos: dict[str, Any] = {}
    count = len(stepped.truncated)
    if stepped.truncated.any():
        reasons, names = (np.empty(count, dtype=object) for _ in range(2))  # of None
        out = stepped.causes == _HORIZON
        if out.any():
            reasons[out], names[out] = step.out_of_time, _NAMES[_HORIZON]
        rows = (stepped.truncated & ~out).nonzero()[0]
        reasons[rows] = step.reasons(stepped, rows)
        names[rows] = [_NAMES[cause] for cause in stepped.causes[rows].tolist()]
        mask = stepped.truncated.copy()
        infos |= {"reason": reasons, "_reason": mask, "cause": names, "_cause": mask.copy()}
    if stepped.success is not None:
        followed = (stepped.causes < 0) | (stepped.causes == _HORIZON)
        told = followed if going is None else followed & going
        infos["is_success"] = stepped.success & told
        infos["_is_success"] = told
    return infos


def masked(infos: dict[str, Any], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """The infos of some of the dreams."""
    found: dict[str, Any] = {}
    for name in [name for name in infos if not name.startswith("_")]:
        if (left := infos[f"_{name}"] & mask).any():
            found |= {name: infos[name], f"_{name}": left}
    return found
