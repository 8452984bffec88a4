"""Which setting of each baseline is reported: chosen on tuning seeds, the same budget for all.

``relgym reproduce tuning`` tries all settings again and prints what it would choose.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

__all__ = ["TUNED", "setting_of"]

TUNED: Final[Mapping[tuple[str, str], int]] = {
    ("boosting", "contact"): 0,
    ("boosting", "thesis"): 3,
    ("ensemble", "contact"): 3,
    ("ensemble", "thesis"): 0,
    ("forest", "contact"): 3,
    ("forest", "thesis"): 2,
    ("gp", "contact"): 0,
    ("gp", "thesis"): 2,
    ("interactions", "contact"): 2,
    ("interactions", "thesis"): 3,
    ("knn", "contact"): 2,
    ("knn", "thesis"): 3,
    ("lwr-25", "contact"): 2,
    ("lwr-25", "thesis"): 3,
    ("lwr-50", "contact"): 2,
    ("lwr-50", "thesis"): 3,
    ("mlp", "contact"): 3,
    ("mlp", "thesis"): 0,
    ("model-tree", "contact"): 3,
    ("model-tree", "thesis"): 0,
    ("rls", "contact"): 0,
    ("rls", "thesis"): 2,
}
"""Per baseline and features: number of the setting in `relgym.baselines.catalogue`; 0 where none is named."""


def setting_of(baseline: str, shown: str) -> int:
    """Number of the setting that tuning chose; of features without a tuning of their own, the thesis' ones."""
    fallback = TUNED.get((baseline, "thesis"), 0)
    return TUNED.get((baseline, shown), fallback)
