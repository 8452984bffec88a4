from __future__ import annotations

import numpy as np
import pytest

from relgym.thesis.regression import fit, fit_samples

VARIANCE = 1e-15


def test_only_what_explains_is_chosen() -> None:
    rng = np.random.default_rng(0)
    x = rng.normal(size=(60, 8))
    line = fit(x, 0.525 * x[:, 2] - 0.8227 * x[:, 5] + 4e-4, VARIANCE)
    assert line.columns == (2, 5)
    np.testing.assert_allclose(line.weights, (0.525, -0.8227), atol=1e-12)
    assert line.intercept == pytest.approx(4e-4, abs=1e-12)


def test_a_constant_needs_no_weight_and_a_tiny_intercept_is_none() -> None:
    x = np.random.default_rng(1).normal(size=(20, 3))
    assert fit(x, np.zeros(20), VARIANCE).columns == ()
    assert fit(x, x[:, 1], VARIANCE).intercept == 0.0
    assert fit(x, np.full(20, 0.25), VARIANCE).intercept == 0.25


def test_columns_that_say_the_same_are_not_both_chosen() -> None:
    x = np.random.default_rng(2).normal(size=(30, 2))
    doubled = np.column_stack([x, 2.0 * x[:, 0]])
    assert len(fit(doubled, 3.0 * x[:, 0] + x[:, 1], VARIANCE).columns) == 2


def test_samples_are_fitted_as_if_alone() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.normal(size=(5, 6, 4)), rng.normal(size=(5, 6))
    y[2] = x[2, :, 1] - 0.5
    columns, weights, intercepts = fit_samples(x, y, VARIANCE)
    for k in range(5):
        line = fit(x[k], y[k], VARIANCE)
        used = {int(c): w for c, w in zip(columns[k], weights[k], strict=True) if c >= 0 and w != 0.0}
        assert set(used) == set(line.columns)
        np.testing.assert_allclose([used[c] for c in line.columns], line.weights, rtol=1e-9)
        assert intercepts[k] == pytest.approx(line.intercept, rel=1e-9, abs=1e-14)
    assert fit(x[2], y[2], VARIANCE).columns == (1,)


def test_noise_beyond_what_is_expected_takes_more_regressors() -> None:
    rng = np.random.default_rng(4)
    x = rng.normal(size=(200, 6))
    y = x[:, 0] + rng.normal(scale=5e-4, size=200)
    assert fit(x, y, 1e-6).columns == (0,)
    assert len(fit(x, y, 1e-9).columns) > 1  # Cp takes the noise for what is left to explain
