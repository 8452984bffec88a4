"""The law of last resort, and what tells laws from tangents of curves."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.clustering.approximation import approximate
from relgym.clustering.discovery import Scale, is_law, likeness
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
