"""What is logged of a model's errors, the same by every callback."""

from __future__ import annotations

import math

from stable_baselines3.common.logger import Logger

from relgym.model.predicting.prequential import Prequential

__all__ = ["log_quality"]


def log_quality(logger: Logger, prequential: Prequential) -> None:
    """Record ``relgym/nrmse``, ``relgym/calibration`` and ``relgym/coverage``, as far as they are known yet."""
    for name in ("nrmse", "calibration", "coverage"):
        value = getattr(prequential, name)
        if not math.isnan(value):
            logger.record(f"relgym/{name}", value)
