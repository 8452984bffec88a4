"""How noisy a target is, from its data and their precision."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.clustering.noise import estimate_noise, rounding_noise

EPS = float(np.finfo(np.float64).eps)
EPS32 = float(np.finfo(np.float32).eps)


def test_double_precision_leaves_some_roundings_of_the_largest_number() -> None:
    x = np.array([[0.5], [-8.0]])
    assert rounding_noise(x, np.array([0.1, 0.2])) == pytest.approx(32 * EPS * 8.0)


def test_single_precision_is_recognised_and_coarser() -> None:
    y = np.array([0.1, 0.2, 0.3], dtype=np.float32).astype(float)
    noise = rounding_noise(np.ones((3, 1)), y)
    assert 0.5 * EPS32 < noise < 4.0 * EPS32


def test_whole_numbers_are_not_taken_for_single_precision() -> None:
    assert rounding_noise(np.ones((3, 1)), np.array([1.0, -2.0, 0.0])) < 1e-13


def test_a_world_at_rest_has_a_positive_noise() -> None:
    assert rounding_noise(np.zeros((3, 1)), np.zeros(3)) > 0.0


@pytest.mark.parametrize("sd", [1e-12, 1e-8, 1e-3])
def test_the_noise_about_a_line_is_estimated(sd: float, rng: np.random.Generator) -> None:
    x = rng.normal(size=(400, 3))
    y = x[:, 0] - 0.5 * x[:, 2] + rng.normal(scale=sd, size=400)
    estimate = estimate_noise(x, y, np.zeros(400, dtype=int), floor=1e-15)
    assert estimate == pytest.approx(sd, rel=0.5)


def test_exact_data_have_the_noise_of_rounding(rng: np.random.Generator) -> None:
    x = rng.normal(size=(200, 2))
    assert estimate_noise(x, -0.9 * x[:, 0], np.zeros(200, dtype=int), floor=1e-14) == 1e-14


def test_changes_of_mode_are_no_noise(rng: np.random.Generator) -> None:
    x = rng.normal(size=(400, 2))
    strata = np.arange(400) // 50 % 2
    y = np.where(strata == 0, x[:, 0], -0.9 * x[:, 0]) + rng.normal(scale=1e-6, size=400)
    assert estimate_noise(x, y, strata, floor=1e-15) == pytest.approx(1e-6, rel=0.5)


def test_too_few_examples_give_no_estimate(rng: np.random.Generator) -> None:
    x = rng.normal(size=(10, 2))
    assert estimate_noise(x, x[:, 0], np.zeros(10, dtype=int), floor=3e-14) is None
