from __future__ import annotations

import numpy as np
import pytest

from relgym.thesis.ransac import search
from relgym.thesis.settings import ThesisSettings

PRESETS = [ThesisSettings.thesis(), ThesisSettings.original()]


@pytest.mark.parametrize("settings", PRESETS, ids=["thesis", "original"])
def test_a_line_among_others(settings: ThesisSettings) -> None:
    rng = np.random.default_rng(0)
    x = rng.normal(size=(90, 5))
    y = rng.normal(size=90)
    y[:50] = 0.9 * x[:50, 1] - 0.1
    found = search(x, y, settings, np.random.default_rng(1))
    assert found.line is not None and found.line.columns == (1,)
    assert found.inliers[:50].all() and not found.inliers[50:].any()


def test_too_few_found_no_mode_and_say_how_many_there_were() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(60, 3)), rng.normal(size=60)
    y[:30] = x[:30, 2]
    assert search(x, y, PRESETS[0], np.random.default_rng(1)).size == 30 < PRESETS[0].min_examples


def test_what_only_tells_two_scenes_apart_is_no_regressor() -> None:
    """Left in one scene, right in another: a size that differs between them would explain both."""
    rng = np.random.default_rng(0)
    x = np.column_stack([rng.normal(size=60), np.repeat([0.2, 0.3], 30)])
    y = x[:, 0] + np.where(x[:, 1] > 0.25, 2e-4, -2e-4)
    found = search(x, y, PRESETS[0], np.random.default_rng(1))
    assert found.size <= 30


def test_unification_needs_both_sides() -> None:
    rng = np.random.default_rng(0)
    x = rng.normal(size=(100, 2))
    y = x[:, 0].copy()
    args = (PRESETS[0], np.random.default_rng(1))
    assert search(x, y, *args, wanted=(63, 27), old=70).line is not None
    y[70:] = x[70:, 1]
    assert search(x, y, *args, wanted=(63, 27), old=70).line is None
