"""Pushing among bystanders: what is learned of one order of the lesson holds in fresh scenes."""

from __future__ import annotations

import pytest

from relgym.experiments.seeds import TEST_SEEDS, TRAINING_SEEDS
from relgym.experiments.worlds.truck import counts


@pytest.mark.slow
@pytest.mark.parametrize("seed", TRAINING_SEEDS[:2])
def test_two_three_and_four_boxes_in_a_row_are_told_apart(seed: int) -> None:
    wrong, guessed = counts(seed=seed, test=TEST_SEEDS[0])
    assert wrong <= 0.001
    assert guessed == 0.0
