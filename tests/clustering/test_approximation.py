"""The law of last resort, and what tells laws from tangents of curves."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.clustering.approximation import approximate, normal_reach, reach, terms_of
from relgym.clustering.discovery import Scale, is_law, likeness
from relgym.config import ClusteringConfig
from relgym.numeric.ransac import Consensus
from relgym.numeric.stepwise import least_squares

SCALE = Scale(1e-6, 4.0, 8.0)


def fitted(x: np.ndarray, y: np.ndarray, kept: np.ndarray) -> Consensus:
    fit = least_squares(x[kept], y[kept], tuple(range(x.shape[1])))
    return Consensus(fit, np.abs(y - fit.predict(x)) <= SCALE.tolerance)


def test_the_best_sparse_function_of_nearly_all_rows(rng: np.random.Generator) -> None:
    x = rng.normal(size=(300, 4))
    y = x[:, 0] + 2.0 * x[:, 2] + 0.01 * rng.normal(size=300)
    y[:6] += 50.0
    found = approximate(x, y, x[:, 0], floor=1e-9, terms=3, stds=4.0, left=0.1)
    assert found is not None
    assert set(found.fit.columns) >= {0, 2}
    assert found.sigma == pytest.approx(0.01, rel=0.1)
    assert not found.inliers[:6].any()
    assert found.inliers[6:].mean() > 0.99


def test_what_leaves_too_much_of_the_change_is_no_approximation(rng: np.random.Generator) -> None:
    x = rng.normal(size=(300, 4))
    y = x[:, 0] + x[:, 1] + 0.3 * rng.normal(size=300)
    assert approximate(x, y, x[:, 0], floor=1e-9, terms=4, stds=4.0, left=0.1) is None
    assert approximate(x, y, x[:, 0], floor=1e-9, terms=4, stds=4.0, left=0.5) is not None


def test_two_kinds_of_behaviour_are_no_approximation(rng: np.random.Generator) -> None:
    x = rng.normal(size=(300, 2))
    y = np.where(np.arange(300) % 4 == 0, -x[:, 0], x[:, 0] + x[:, 1])
    assert approximate(x, y, x[:, 0], floor=1e-9, terms=2, stds=4.0, left=0.1) is None


def test_a_tangent_is_no_law_but_a_mode_among_others_is(rng: np.random.Generator) -> None:
    x = rng.uniform(-1.0, 1.0, (2000, 1))
    curve = fitted(x, np.cos(x[:, 0]), np.abs(x[:, 0]) < 2e-3)
    assert curve.size > 0
    assert not is_law(x, np.cos(x[:, 0]), curve, 1, SCALE)
    y = np.where(x[:, 0] > 0.5, -x[:, 0], 0.3 * x[:, 0])
    assert is_law(x, y, fitted(x, y, x[:, 0] > 0.5), 1, SCALE)


def test_a_law_of_noisy_data_is_a_law(rng: np.random.Generator) -> None:
    x = rng.normal(size=(500, 2))
    y = x[:, 0] + 1e-6 * rng.normal(size=500)
    assert is_law(x, y, fitted(x, y, np.ones(500, dtype=bool)), 2, SCALE)


def test_neighbours_residuals_are_alike_on_a_curve_only(rng: np.random.Generator) -> None:
    x = rng.uniform(-1.0, 1.0, (300, 2))
    assert likeness(x, np.sin(4.0 * x[:, 0])) > 0.8
    assert abs(likeness(x, rng.normal(size=300))) < 0.3
    assert likeness(np.ones((5, 1)), np.arange(5.0)) == 0.0


def engine(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A velocity that an engine, on in one step of four, changes by as much as it likes."""
    x = np.column_stack([rng.normal(size=n), rng.random(n) < 0.25])
    y = 0.9 * x[:, 0] + x[:, 1] * (0.5 + rng.uniform(-0.25, 0.25, n)) + 1e-4 * rng.normal(size=n)
    return x, y


def test_what_is_left_may_be_more_if_it_is_noise(rng: np.random.Generator) -> None:
    x, y = engine(800, rng)
    assert approximate(x, y, x[:, 0], floor=1e-9, terms=3, stds=4.0, left=0.1) is None
    found = approximate(x, y, x[:, 0], floor=1e-9, terms=3, stds=4.0, left=0.1, noisy=2)
    assert found is not None
    assert found.fit.weights == pytest.approx((0.9, 0.5), abs=0.03)
    assert found.inliers.mean() > 0.98  # what the engine does is noise, no behaviour of its own


def test_a_curve_is_no_noise(rng: np.random.Generator) -> None:
    x = rng.uniform(-1.0, 1.0, (800, 2))
    y = x[:, 0] + 0.2 * x[:, 1] + 0.1 * np.sin(6.0 * x[:, 1])
    assert approximate(x, y, x[:, 0], floor=1e-9, terms=2, stds=4.0, left=0.1, noisy=2) is None


def test_a_choice_among_few_values_is_no_noise(rng: np.random.Generator) -> None:
    x = rng.normal(size=(800, 1))
    y = np.round(x[:, 0] * 3.0) + rng.integers(-1, 2, 800)
    assert approximate(x, y, np.zeros(800), floor=1e-9, terms=1, stds=4.0, left=0.1, noisy=1) is None


def touches(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Flight, in which gravity and an engine pull, and rare touches, which throw by as much as they like.

    Columns: v, engine, leg; then leg times v, leg times engine, and the cosine of leg.
    """
    plain = np.column_stack([rng.normal(size=n), rng.random(n) < 0.3, rng.random(n) < 0.04]).astype(float)
    v, engine, leg = plain.T
    y = v - 0.1 + 0.3 * engine + 0.01 * rng.normal(size=n) + leg * (5.0 + 5.0 * rng.normal(size=n))
    return np.column_stack([plain, leg * v, leg * engine, np.cos(leg)]), y


def test_rare_rows_without_a_law_get_no_terms(rng: np.random.Generator) -> None:
    x, y = touches(1_000, rng)
    found = approximate(x, y, x[:, 0], floor=1e-9, terms=6, stds=4.0, left=0.1, noisy=3)
    assert found is not None
    assert found.fit.columns == (0, 1)
    assert found.fit.weights == pytest.approx((1.0, 0.3), abs=0.01)
    assert found.fit.intercept == pytest.approx(-0.1, abs=0.01)
    assert found.inliers[x[:, 2] == 0.0].mean() > 0.99
    assert found.inliers[x[:, 2] == 1.0].mean() < 0.1


def test_rare_rows_with_a_law_keep_their_term(rng: np.random.Generator) -> None:
    x, _ = touches(1_000, rng)
    y = x[:, 0] - 0.1 + 2.0 * x[:, 2] + 0.01 * rng.normal(size=1_000)
    found = approximate(x, y, x[:, 0], floor=1e-9, terms=6, stds=4.0, left=0.1, noisy=3)
    assert found is not None
    assert found.fit.columns == (0, 2)
    assert found.inliers.mean() > 0.99


def test_a_line_is_no_series(rng: np.random.Generator) -> None:
    w = rng.normal(size=500) * np.where(rng.random(500) < 0.1, 10.0, 1.0)
    x = np.column_stack([rng.normal(size=500), w, np.sin(w), np.sin(2.0 * w), w * np.cos(w)])
    y = x[:, 0] + 0.05 * w + np.where(np.arange(500) % 20 == 0, rng.normal(size=500), 0.0)
    found = approximate(x, y, x[:, 0], floor=1e-7, terms=5, stds=4.0, left=0.1, noisy=2)
    assert found is not None
    assert found.fit.columns == (0, 1)
    assert found.fit.weights == pytest.approx((1.0, 0.05), abs=1e-6)


def test_errors_as_small_as_rounding_are_alike() -> None:
    errors = np.linspace(0.0, 1.0, 11)
    assert reach(errors) == pytest.approx(0.9)
    assert reach(errors, 1.0) == reach(errors / 2.0, 1.0) == normal_reach()


def test_the_wider_the_library_the_more_terms() -> None:
    config = ClusteringConfig()
    assert terms_of(20, config) == config.max_terms
    assert terms_of(500, config) == 2 * config.max_terms
    assert terms_of(1_000, config) == 3 * config.max_terms
