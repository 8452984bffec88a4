"""Seeds, in one place: what is tuned on some is reported on others."""

from __future__ import annotations

from typing import Final

__all__ = ["FREQUENCY_SEEDS", "TEST_SEEDS", "TRAINING_SEEDS", "TUNING_SEEDS", "TUNING_TEST_SEED"]

TRAINING_SEEDS: Final = (0, 1, 2, 3, 4)
"""Seeds of the training sets that results are reported of."""

TEST_SEEDS: Final = (10, 11, 12)
"""Seeds of the test sets that results are reported of."""

TUNING_SEEDS: Final = (100, 101, 102, 103, 104)
"""Seeds of the training sets on which parameters and mechanisms are chosen; no result is reported of them."""

TUNING_TEST_SEED: Final = 110
"""Seed of the test set that goes with `TUNING_SEEDS`."""

FREQUENCY_SEEDS: Final = tuple(range(300, 310))
"""Seeds of scenes whose modes are counted; `relgym.experiments.scenes` was fitted on 900 to 959."""
