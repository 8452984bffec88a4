"""Which setting of each baseline is reported: chosen on tuning seeds, the same budget for all.

``relgym reproduce tuning`` tries all settings again and prints what it would choose.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

__all__ = ["TUNED", "setting_of"]

TUNED: Final[Mapping[tuple[str, str], int]] = {}
"""Per baseline and features: number of the setting in `relgym.baselines.catalogue`; 0 where none is named."""


def setting_of(baseline: str, shown: str) -> int:
    """Number of the setting that tuning chose; of features without a tuning of their own, the thesis' ones."""
    fallback = TUNED.get((baseline, "thesis"), 0)
    return TUNED.get((baseline, shown), fallback)
