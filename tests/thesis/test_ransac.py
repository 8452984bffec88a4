from __future__ import annotations

import numpy as np
import pytest

from relgym.thesis.ransac import Union, _draws, _inliers, _samples, search, varied
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
    args, every = (PRESETS[0], np.random.default_rng(1)), np.ones(100, dtype=np.bool_)
    assert search(x, y, *args, Union(70, every, 0.9)).line is not None
    y[70:] = x[70:, 1]
    assert search(x, y, *args, Union(70, every, 0.9)).line is None
    few = every.copy()
    few[75:] = False  # of the second mode's examples all but five have another explanation
    y[70:75] = x[70:75, 0]
    assert search(x, y, *args, Union(70, few, 0.9)).line is not None


def test_columns_that_seldom_change_must_have_taken_values_enough() -> None:
    every = np.arange(12.0)
    assert varied(every[:, None])  # twelve values in twelve rows: it changes all the time
    assert not varied(np.repeat([0.2, 0.3], 6)[:, None])  # two values
    assert not varied(
        np.repeat([0.2, 0.3, 0.4], 4)[:, None]
    )  # a weight and a constant fit two, and two more test
    assert varied(np.repeat([0.2, 0.3, 0.4, 0.5], 3)[:, None])
    assert not varied(np.column_stack([every, np.repeat([0.2, 0.3], 6)]))
    both = np.column_stack([np.repeat([1.0, 2.0, 3.0, 4.0], 3), np.repeat([5.0, 6.0, 7.0, 8.0], 3)])
    assert not varied(both)  # four pairs; two weights and a constant need five
    both[0, 1] = 6.0
    assert varied(both)


@pytest.mark.parametrize(("size", "n", "draws"), [(10, 10, 1), (5, 10, 192), (0, 10, 10**9)])
def test_draws_by_hand(size: int, n: int, draws: int) -> None:
    """All six of a sample are inliers with a chance of 1/64: log .05 / log (63/64) = 190.2."""
    found = _draws(size, n, 6)
    assert found == draws


def test_inliers_by_hand() -> None:
    x, y = np.array([[1.0, 5.0], [2.0, 5.0], [3.0, 5.0]]), np.array([2.0, 4.5, 6.0])
    columns, weights = np.array([[0, -1], [1, 0]]), np.array([[2.0, 0.0], [1.0, 1.0]])
    fits = _inliers(x, y, columns, weights, np.array([0.0, -4.0]), 0.25)
    # 2 x0 leaves 0, 0.5, 0; x1 + x0 - 4 says 2, 3, 4
    assert fits.T.tolist() == [[True, False, True], [True, False, False]]


def test_half_a_sample_comes_from_either_side() -> None:
    rng = np.random.default_rng(0)
    rows = _samples(np.zeros((30, 1)), 50, 20, PRESETS[0], rng)
    assert rows.shape == (50, 6)
    assert ((rows[:, :3] < 20) & (rows[:, 3:] >= 20)).all()
    assert all(len(set(row)) == 6 for row in rows.tolist())


def test_the_programs_samples_take_two_values_of_each_column() -> None:
    """Of a column that is 1 in one row of thirty a sample by chance would see both in a fifth of the cases."""
    x = np.zeros((30, 2))
    x[7, 0] = x[9, 1] = 1.0
    rows = _samples(x, 40, 0, PRESETS[1], np.random.default_rng(0))
    assert all({7, 9} & set(row) and len(set(row)) == 6 for row in rows.tolist())


def test_too_few_rows_for_a_sample_have_no_line() -> None:
    found = search(np.zeros((5, 1)), np.zeros(5), PRESETS[0], np.random.default_rng(0))
    assert found.line is None and found.inliers.tolist() == [False] * 5
