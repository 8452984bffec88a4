"""Sparse regression on data small enough to solve by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.numeric.stepwise import (
    LinearFit,
    eliminate_backward,
    forward_order,
    forward_stepwise,
    least_squares,
    varying_columns,
)

EXACT = 1e-12
"""Noise of data that are exact but for rounding."""


def plane(rng: np.random.Generator, n: int = 20, d: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Rows and ``y = 2 x_1 - 3 x_3``."""
    x = rng.normal(size=(n, d))
    return x, 2.0 * x[:, 1] - 3.0 * x[:, 3]


def test_two_terms_are_chosen_and_no_more(rng: np.random.Generator) -> None:
    x, y = plane(rng)
    fit = forward_stepwise(x, y, sigma=EXACT)
    assert fit.columns == (1, 3)
    assert fit.weights == pytest.approx((2.0, -3.0), abs=1e-13)
    assert fit.intercept == 0.0
    assert fit.terms == 2


def test_a_line_through_three_points() -> None:
    fit = least_squares(np.array([[0.0], [1.0], [2.0]]), np.array([1.0, 2.0, 4.0]), (0,))
    # By hand: slope 3/2, intercept 7/3 - 3/2, residuals (1, -2, 1) / 6.
    assert fit.weights == pytest.approx((1.5,), abs=1e-15)
    assert fit.intercept == pytest.approx(5.0 / 6.0, abs=1e-15)
    assert fit.rss == pytest.approx(1.0 / 6.0, abs=1e-15)


def test_constant_columns_get_no_weight(rng: np.random.Generator) -> None:
    # §3.2.1: two constants of the scene can't be told from one another, nor from the constant term.
    x = np.column_stack([np.full(12, 0.3), rng.normal(size=12), np.full(12, 7.0)])
    fit = forward_stepwise(x, 2.0 * x[:, 1] + 5.0, sigma=EXACT)
    assert fit.columns == (1,)
    assert fit.weights == pytest.approx((2.0,), abs=1e-13)
    assert fit.intercept == pytest.approx(5.0, abs=1e-13)
    assert varying_columns(x).tolist() == [1]


def test_a_constant_response_needs_the_constant_alone(rng: np.random.Generator) -> None:
    fit = forward_stepwise(rng.normal(size=(10, 3)), np.full(10, 4.25), sigma=EXACT)
    assert (fit.columns, fit.intercept) == ((), 4.25)


def test_rounding_in_a_constant_column_is_no_variation() -> None:
    x = np.full((4, 1), 0.1)
    x[1] += 1e-17
    x[2] = np.nextafter(0.1, 1.0)
    assert not len(varying_columns(x))


def test_of_equal_columns_the_earlier_gets_the_weight(rng: np.random.Generator) -> None:
    x = rng.normal(size=(10, 2))
    x = np.column_stack([x[:, 0], x[:, 1], x[:, 0]])
    fit = forward_stepwise(x, 3.0 * x[:, 2], sigma=EXACT)
    assert fit.columns == (0,)
    assert fit.weights == pytest.approx((3.0,), abs=1e-13)


def test_collinear_columns_share_no_weight(rng: np.random.Generator) -> None:
    x = rng.normal(size=(10, 2))
    x = np.column_stack([x, x[:, 0] - 2.0 * x[:, 1] + 1.0])
    fit = least_squares(x, x[:, 2], (0, 1, 2))
    assert fit.columns == (0, 1)
    assert fit.weights == pytest.approx((1.0, -2.0), abs=1e-13)
    assert fit.intercept == pytest.approx(1.0, abs=1e-13)


def test_the_intercept_is_dropped_where_the_data_need_none(rng: np.random.Generator) -> None:
    x = rng.normal(size=(15, 1)) + 10.0
    y = 0.5 * x[:, 0]
    assert eliminate_backward(x, y, least_squares(x, y, (0,)), sigma=EXACT).intercept == 0.0
    assert eliminate_backward(x, y + 1e-3, least_squares(x, y + 1e-3, (0,)), sigma=EXACT).intercept != 0.0


def test_backward_elimination_drops_what_a_later_column_made_superfluous(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(2, 30))
    # The sum alone explains most, hence comes first; with both of its parts it is superfluous.
    x = np.column_stack([a + b + 0.01 * rng.normal(size=30), a, b])
    y = 1.1 * a + b
    greedy = forward_stepwise(x, y, sigma=EXACT, eliminate=False)
    fit = forward_stepwise(x, y, sigma=EXACT)
    assert greedy.columns == (0, 1, 2)
    assert fit.columns == (1, 2)
    assert fit.weights == pytest.approx((1.1, 1.0), abs=1e-12)


def test_noise_buys_no_terms(rng: np.random.Generator) -> None:
    x = rng.normal(size=(200, 6))
    fit = forward_stepwise(x, 2.0 * x[:, 0] + rng.normal(scale=0.1, size=200), sigma=0.1)
    assert fit.columns == (0,)
    assert fit.weights[0] == pytest.approx(2.0, abs=0.03)


def test_at_most_as_many_terms_as_are_allowed(rng: np.random.Generator) -> None:
    x, y = plane(rng)
    assert forward_stepwise(x, y, sigma=EXACT, max_terms=1).columns == (3,)
    assert forward_stepwise(x, y, sigma=EXACT, max_terms=0).columns == ()


def test_one_degree_of_freedom_is_always_left(rng: np.random.Generator) -> None:
    x = rng.normal(size=(4, 10))
    assert len(forward_stepwise(x, rng.normal(size=4), sigma=EXACT).columns) <= 2


def test_inputs_stay_as_they_are(rng: np.random.Generator) -> None:
    x, y = plane(rng)
    before = x.copy(), y.copy()
    forward_stepwise(x, y, sigma=EXACT)
    assert (x == before[0]).all() and (y == before[1]).all()


def test_large_offsets_cost_no_digits(rng: np.random.Generator) -> None:
    x, _ = plane(rng)
    x[:, 1] += 1e4
    fit = forward_stepwise(x, 2.0 * x[:, 1] - 3.0 * x[:, 3], sigma=1e-10)
    assert fit.columns == (1, 3)
    assert fit.weights == pytest.approx((2.0, -3.0), abs=1e-11)


@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.floats(-5, 5).filter(lambda w: abs(w) > 0.01), min_size=1, max_size=4),
    st.sampled_from([0.0, 1.5, -20.0]),
)
def test_any_sparse_function_is_recovered_to_rounding(
    seed: int, weights: list[float], constant: float
) -> None:
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(40, 8))
    columns = np.sort(rng.choice(8, size=len(weights), replace=False))
    fit = forward_stepwise(x, x[:, columns] @ np.array(weights) + constant, sigma=EXACT)
    assert fit.columns == tuple(columns)
    assert fit.weights == pytest.approx(weights, abs=1e-11)
    assert fit.intercept == pytest.approx(constant, abs=1e-11)


@given(st.integers(0, 2**32 - 1))
def test_least_squares_agrees_with_the_pseudoinverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(12, 3)), rng.normal(size=12)
    fit = least_squares(x, y, (0, 1, 2))
    expected = np.linalg.lstsq(np.column_stack([x, np.ones(12)]), y, rcond=None)[0]
    assert [*fit.weights, fit.intercept] == pytest.approx(expected.tolist(), abs=1e-10)


@given(st.integers(0, 2**32 - 1))
def test_predictions_are_the_same_bits_row_by_row(seed: int) -> None:
    x = np.random.default_rng(seed).normal(size=(9, 4))
    fit = LinearFit((0, 2, 3), (0.1, -1.7, 3.3), 0.7, 0.0)
    assert [float(fit.predict(row[None])[0]) for row in x] == fit.predict(x).tolist()


@pytest.mark.parametrize("columns", [8, 80])
def test_the_first_columns_are_what_fewer_terms_find(columns: int, rng: np.random.Generator) -> None:
    x = rng.normal(size=(200, columns))
    y = x[:, 0] - 2.0 * x[:, 3] + 0.5 * x[:, 5] + rng.normal(size=200)
    order = forward_order(x, y, sigma=0.5, max_terms=6)
    for k in range(len(order) + 1):
        fewer = forward_stepwise(x, y, sigma=0.5, max_terms=k, eliminate=False)
        assert fewer == least_squares(x, y, order[:k])


@pytest.mark.parametrize("n", [50, 1000])
def test_a_chosen_column_is_never_chosen_again(n: int, rng: np.random.Generator) -> None:
    # Much noise makes many columns equally good; a used-up one isn't among them.
    x = rng.normal(size=(n, 12))
    fit = forward_stepwise(x, rng.normal(scale=0.5, size=n), sigma=0.1, eliminate=False)
    assert len(fit.columns) == len(set(fit.columns)) > 3
