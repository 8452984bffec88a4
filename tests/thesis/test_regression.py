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


# Two columns at right angles: y = (3, -3, a, -a) takes 3 of the first one, which leaves 2 a^2, and a of the second one,
# which leaves nothing. Cp = left / variance - 4 + 2 k: the second one is worth it where 2 a^2 > 2 variance.
CROSS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])


@pytest.mark.parametrize(
    ("a", "variance", "columns"),
    [(0.9, 1.0, (0,)), (1.0, 1.0, (0,)), (1.125, 1.0, (0, 1)), (1.125, 2.0, (0,)), (4.0, 1.0, (0, 1))],
)
def test_cp_by_hand(a: float, variance: float, columns: tuple[int, ...]) -> None:
    line = fit(CROSS, np.array([3.0, -3.0, a, -a]), variance)
    assert line.columns == columns
    assert line.weights == (3.0, a)[: len(columns)]
    assert line.intercept == 0.0


def test_what_explains_most_comes_first() -> None:
    """With one regressor to take it is the column that leaves least."""
    chosen, weights, _ = fit_samples(CROSS[None], np.array([[1.0, -1.0, 5.0, -5.0]]), 1e-3)
    assert chosen.tolist() == [[1, 0]] and weights.tolist() == [[5.0, 1.0]]


def test_the_mean_is_an_intercept() -> None:
    line = fit(np.array([[1.0], [2.0], [6.0]]), np.array([5.0, 7.0, 15.0]), 1e-12)
    assert (line.columns, line.weights, line.intercept) == ((0,), (2.0,), 3.0)
    np.testing.assert_array_equal(line.values(np.array([[10.0], [0.0]])), [23.0, 3.0])


def test_weights_of_columns_that_lean_on_each_other() -> None:
    """x2 = x1 + (0, 0, 0, 1): y = x1 + 2 x2 = (0, 3, 6, 11)."""
    x = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 4.0]])
    line = fit(x, x[:, 0] + 2.0 * x[:, 1], 1e-15)
    assert line.columns == (0, 1)
    np.testing.assert_allclose(line.weights, (1.0, 2.0), rtol=1e-12)


def test_an_intercept_below_a_hundredth_of_the_noise_is_none() -> None:
    x = np.array([[1.0], [-1.0]])
    assert fit(x, np.array([1.0099, -0.9901]), 1.0).intercept == 0.0  # 0.0099 < 0.01
    assert fit(x, np.array([1.0101, -0.9899]), 1.0).intercept == pytest.approx(0.0101)
