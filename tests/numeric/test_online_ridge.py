"""Sums of products give what solving anew from all rows gives."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from relgym.config.constants import MORE_ROOM, SUMMABLE
from relgym.numeric.online_ridge import OnlineRidge, _sweep, in_order


def rows(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.normal([0.0, 5.0, -2.0], [1.0, 0.1, 3.0], size=(n, 3))
    return x, np.stack([x @ [1.0, -2.0, 0.5] + 3.0, rng.normal(size=n)], axis=1)


def fitted(x: np.ndarray, y: np.ndarray) -> OnlineRidge:
    """To all rows, one after the other."""
    ridge = OnlineRidge(x.shape[1])
    for one, response in zip(x, y, strict=True):
        ridge.add(one, response)
    ridge.solve()
    return ridge


def test_it_is_ridge_regression_of_standardised_columns() -> None:
    x, y = rows(80)
    ridge, z = fitted(x, y), (x - x.mean(axis=0)) / x.std(axis=0)
    expected = np.linalg.solve(z.T @ z + np.eye(3), z.T @ (y - y.mean(axis=0)))
    np.testing.assert_allclose(ridge.predict(x), z @ expected + y.mean(axis=0), atol=1e-9)


def test_what_is_left_is_generalised_cross_validation() -> None:
    x, y = rows(40)
    ridge, z = fitted(x, y), (x - x.mean(axis=0)) / x.std(axis=0)
    hat = 1.0 / 40 + z @ np.linalg.solve(z.T @ z + np.eye(3), z.T)
    remains = np.square(y - hat @ y).mean(axis=0)
    np.testing.assert_allclose(ridge.left, remains / (1.0 - np.trace(hat) / 40) ** 2, rtol=1e-6)
    # Each row predicted from the others leaves as much: of a law nearly nothing, of noise more than there is of it.
    others = np.square((y - hat @ y) / (1.0 - np.diag(hat))[:, None]).mean(axis=0)
    np.testing.assert_allclose(ridge.left, others, rtol=0.1)
    np.testing.assert_allclose(ridge.size, np.square(y).mean(axis=0))
    assert ridge.left[1] > y[:, 1].var()


def test_what_is_left_of_a_response_that_is_new_is_not_known() -> None:
    x, y = rows(50)
    ridge = OnlineRidge(3, due=40)
    for one, response in zip(x, y, strict=True):
        ridge.add(one, response[:1])
    ridge.add(x[0], y[0])
    assert np.isfinite(ridge.left[0])
    assert ridge.left[1] == np.inf


def test_weights_are_solved_anew_as_rows_become_more() -> None:
    x, y = rows(400)
    ridge = OnlineRidge(3)
    solved = []
    for k, (one, response) in enumerate(zip(x, y, strict=True)):
        before = ridge.weights
        ridge.add(one, response)
        if ridge.weights is not before:
            solved.append(k + 1)
    late = [b / a for a, b in pairwise(solved) if a > 30]
    assert len(late) > 10
    assert max(late) <= 1.0 + MORE_ROOM + 0.04


def test_what_is_solved_already_is_left_as_it_is() -> None:
    x, y = rows(108)
    ridge = OnlineRidge(3, due=100)  # and after 110 next
    for one, response in zip(x, y, strict=True):
        ridge.add(one, response)
    lagging = ridge.weights
    ridge.solve()
    solved = ridge.weights
    ridge.solve()
    assert not np.array_equal(lagging, solved)
    assert ridge.weights is solved


def test_a_row_alone_gives_the_same_bits_as_among_others() -> None:
    rng = np.random.default_rng(1)
    ridge = OnlineRidge(37)
    for _ in range(60):
        ridge.add(rng.normal(size=37), rng.normal(size=5))
    some = rng.normal(size=(20, 37))
    together = ridge.predict(some)
    for row, expected in zip(some, together, strict=True):
        assert ridge.predict(row[None])[0].tobytes() == expected.tobytes()


def test_a_response_that_comes_later_was_zero_before() -> None:
    x, y = rows(90)
    late, whole = OnlineRidge(3), OnlineRidge(3)
    for k, (one, response) in enumerate(zip(x, y, strict=True)):
        late.add(one, response[: 1 if k < 40 else 2])
        whole.add(one, response if k >= 40 else np.array([response[0], 0.0]))
    late.solve(), whole.solve()
    np.testing.assert_array_equal(late.predict(x), whole.predict(x))


def test_constant_columns_have_no_weight() -> None:
    x, y = rows(50)
    x[:, 1] = 7.0
    ridge = OnlineRidge(3)
    for one, response in zip(x, y, strict=True):
        ridge.add(one, response)
    assert (ridge.weights[:, 2] == 0.0).all()
    assert np.isfinite(ridge.weights).all()


def test_what_was_saved_learns_on_to_the_bit() -> None:
    x, y = rows(100)
    ridge = OnlineRidge(3)
    for one, response in zip(x[:60], y[:60], strict=True):
        ridge.add(one, response)
    again = OnlineRidge.restored(ridge.rows, ridge.due, ridge.to_arrays())
    for one, response in zip(x[60:], y[60:], strict=True):
        ridge.add(one, response)
        again.add(one, response)
    assert ridge.predict(x).tobytes() == again.predict(x).tobytes()


def test_weights_by_hand() -> None:
    """x = 0, 2 has mean 1 and spread 1, y = 1, 5 a slope of 2; of four rows the penalty of one takes a fifth."""
    ridge = OnlineRidge(1)
    for x, y in ((0.0, 1.0), (2.0, 5.0), (0.0, 1.0), (2.0, 5.0)):
        ridge.add(np.array([x]), np.array([y]))
    assert (ridge.rows, ridge.due, ridge.columns) == (4, 5, 1)
    np.testing.assert_allclose(ridge.weights, [[3.0 - 1.6, 1.6]], rtol=1e-15)
    np.testing.assert_allclose(ridge.predict(np.array([[1.0], [11.0]])), [[3.0], [19.0]], rtol=1e-15)


@pytest.mark.parametrize("wild", [1.1 * SUMMABLE, 1e300, np.inf, -np.inf, np.nan])
@pytest.mark.parametrize("where", ["column", "response"])
def test_a_row_whose_sums_would_overflow_is_left_out(wild: float, where: str) -> None:
    x, y = rows(60)
    calm, hit = OnlineRidge(3), OnlineRidge(3)
    for k, (one, response) in enumerate(zip(x, y, strict=True)):
        calm.add(one, response)
        hit.add(one, response)
        if k == 30:
            bad = (
                (np.array([0.0, wild, 0.0]), response) if where == "column" else (one, np.array([0.0, wild]))
            )
            hit.add(*bad)
    assert hit.rows == calm.rows == 60
    assert hit.predict(x).tobytes() == calm.predict(x).tobytes()


def test_the_largest_numbers_that_are_taken_give_finite_weights() -> None:
    ridge, rng = OnlineRidge(2), np.random.default_rng(0)
    for x in rng.uniform(-SUMMABLE, SUMMABLE, size=(50, 2)):
        ridge.add(x, x[:1])
    ridge.solve()
    assert all(np.isfinite(array).all() for array in ridge.to_arrays().values())
    np.testing.assert_allclose(ridge.weights[0, 1:], [1.0, 0.0], atol=0.1)


def test_leverage_is_that_of_standardised_columns() -> None:
    x, y = rows(80)
    ridge = OnlineRidge(x.shape[1])
    for row, response in zip(x, y, strict=True):
        ridge.add(row, response)
    ridge.solve()
    z = (x - x.mean(axis=0)) / x.std(axis=0)
    inverse = np.linalg.inv(z.T @ z + np.eye(z.shape[1]))
    expected = np.einsum("ni,ij,nj->n", z, inverse, z) + 1.0 / 80.0
    np.testing.assert_allclose(ridge.leverage(x), expected, rtol=1e-5)
    one = [ridge.leverage(row[None])[0] for row in x]
    for laid in (x, np.asfortranarray(x)):
        assert np.array(one).tobytes() == ridge.leverage(laid).tobytes()
    assert ridge.leverage(np.full((1, x.shape[1]), 1e200))[0] == np.inf
    assert OnlineRidge(2).leverage(np.zeros((1, 2)))[0] == np.inf  # nothing is known


@pytest.mark.parametrize("columns", [0, 1, 7, 40])
def test_the_inverse_is_one_whatever_solves_it(columns: int) -> None:
    rng = np.random.default_rng(columns)
    x = rng.normal(size=(3 * columns, columns)) * np.exp(rng.normal(size=columns))
    matrix = x.T @ x / max(1, len(x)) + 1e-3 * np.eye(columns)
    found, other = matrix.copy(), matrix.copy(order="F")
    for part in (range(columns // 3), range(columns // 3, columns)):
        _sweep(found, part)
    _sweep(other, range(columns))
    assert np.abs(found @ matrix - np.eye(columns)).max(initial=0.0) < 1e-10
    assert (found == other).all()  # however it lies in memory, and in whatever pieces it was done


def test_it_is_solved_in_pieces_of_the_rows_that_it_was_begun_with(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four columns of eight a row; before it is solved for the first time it is known that nothing is known."""
    monkeypatch.setattr("relgym.numeric.online_ridge.SEARCHED_CELLS", 4 * 4 * 4)
    rng = np.random.default_rng(5)
    x, y = rng.normal(size=(60, 8)), rng.normal(size=(60, 2))
    ridge, whole = OnlineRidge(8, due=40), OnlineRidge(8, due=100)
    for k in range(44):
        ridge.add(x[k], y[k])
        whole.add(x[k], y[k])
        assert ridge.worked == (4 * 16 if k in (39, 40, 43) else 0)
        assert ridge.solved == (k >= 40) and ridge.weights.any() == ridge.solved
    whole.solve()
    first = ridge.weights
    saved = OnlineRidge.restored(ridge.rows, ridge.due, ridge.to_arrays())
    assert saved.left.tobytes() == ridge.left.tobytes()
    for each in (ridge, saved):
        each.add(x[45], np.append(y[45], 3.0))  # a response that is new
        assert each.weights[:2].tobytes() == whole.weights.tobytes() != first.tobytes()
        assert each.weights.shape == (3, 9) and not each.weights[2].any()
        assert each.left[:2].tobytes() == whole.left.tobytes() and each.left[2] == np.inf
        assert "begun" not in each.to_arrays()
    ridge.solve()
    assert ridge.weights[:2].tobytes() != whole.weights.tobytes()  # of all rows


@pytest.mark.parametrize(
    "shape", [(1, 1), (5, 1), (300, 1), (1, 7), (9, 2), (300, 3), (130, 129), (1000, 40)]
)
def test_sums_in_order_are_those_of_a_loop(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(sum(shape))
    terms = rng.normal(size=shape) * np.exp(20.0 * rng.normal(size=shape))
    expected = np.zeros(shape[1])
    for row in terms:
        expected = expected + row
    for laid in (terms, np.asfortranarray(terms)):
        assert in_order(laid).tobytes() == expected.tobytes()


@pytest.mark.parametrize("columns", [1, 4])
def test_a_row_that_was_left_out_is_missed_as_if_it_had_never_come(columns: int) -> None:
    rng = np.random.default_rng(columns)
    x, y = rng.normal(size=(60, columns)), rng.normal(size=(60, 2))
    x[0] *= 4.0  # far out, where it matters
    whole = OnlineRidge(columns, due=1000)
    for row, each in zip(x, y, strict=True):
        whole.add(row, each)
    whole.solve()
    said, leverage = whole.without(x, y)
    for k in range(60):
        rest = OnlineRidge(columns, due=1000)
        for i in range(60):
            if i != k:
                rest.add(x[i], y[i])
        rest.solve()
        np.testing.assert_allclose(said[k], rest.predict(x[k : k + 1])[0], atol=0.05)
        np.testing.assert_allclose(leverage[k], rest.leverage(x[k : k + 1])[0], rtol=0.1)


def test_what_nothing_else_tells_is_not_known_without_it() -> None:
    """A row that alone has a column: without it nothing would have been learned of that."""
    ridge, x, y = OnlineRidge(2), np.zeros((50, 2)), np.zeros((50, 1))
    x[:, 0] = np.arange(50.0)
    x[7, 1], y[7] = 1.0, 5.0
    for row, each in zip(x, y, strict=True):
        ridge.add(row, each)
    ridge.solve()
    said, leverage = ridge.without(x, y)
    assert abs(ridge.predict(x[7:8])[0, 0]) > 2.0
    assert abs(said[7, 0]) < 0.5
    assert leverage[7] > 0.4
