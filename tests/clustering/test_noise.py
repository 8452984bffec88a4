"""How noisy a target is, from its data and their precision."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from relgym.clustering.discovery import Scale
from relgym.clustering.noise import (
    _quartile,
    _windows,
    coded_by_a_law,
    estimate_noise,
    refuted,
    rounding_noise,
)
from relgym.config.constants import ENOUGH

EPS = float(np.finfo(np.float64).eps)
EPS32 = float(np.finfo(np.float32).eps)


def test_double_precision_leaves_some_roundings_of_the_largest_term() -> None:
    y = np.array([0.1, 0.2])
    assert rounding_noise(np.array([[0.5], [-8.0]]), y) == pytest.approx(32 * EPS * 0.2)
    # A term that varies by .1 as its column does by 1 has the roundings of 100.
    far = np.array([[1000.0], [1001.0]])
    assert rounding_noise(far, y) == pytest.approx(32 * EPS * 100.1)
    assert rounding_noise(1e9 * far, y) == pytest.approx(32 * EPS * 100.1)  # in whatever unit
    # What never varies, or by rounding alone, is in no term.
    still = np.array([[1e6, 1e6], [1e6, 1e6 * (1.0 + 4 * EPS)]])
    assert rounding_noise(still, y) == pytest.approx(32 * EPS * 0.2)


@given(
    hnp.arrays(float, (12, 3), elements=st.floats(-100.0, 100.0)),
    hnp.arrays(float, 12, elements=st.floats(-100.0, 100.0)),
    st.integers(-20, 20),
    st.integers(-20, 20),
)
def test_units_make_no_difference(x: np.ndarray, y: np.ndarray, columns: int, responses: int) -> None:
    """Powers of 2, so that nothing is rounded on the way."""
    y = np.append(y, 0.1)  # no response that single precision holds exactly
    scaled = rounding_noise(2.0**columns * x, 2.0**responses * y)
    assert scaled == pytest.approx(2.0**responses * rounding_noise(x, y))


def test_single_precision_is_recognised_and_coarser() -> None:
    y = np.array([0.1, 0.2, 0.3], dtype=np.float32).astype(float)
    noise = rounding_noise(np.ones((3, 1)), y)
    assert 0.5 * EPS32 < noise < 4.0 * EPS32


def test_what_single_precision_cannot_hold_was_not_rounded_to_it() -> None:
    """Nor does asking overflow."""
    for size in (1e39, 1e75):
        assert rounding_noise(np.ones((2, 1)), np.array([0.5, size])) == pytest.approx(32 * EPS * size)
        own = np.array([[0.5 + 0.25 * k] for k in range(ENOUGH)] + [[size]])
        assert rounding_noise(np.ones((2, 1)), np.array([0.1, 0.3]), own) == pytest.approx(32 * EPS)


def test_a_column_that_was_rounded_tells_of_responses_worked_out_from_it() -> None:
    y = np.array([0.1, 0.2])  # an angle, say, of a sine and a cosine in single precision
    fractions = np.array([[0.125 * k + 0.0625] for k in range(ENOUGH)])
    for rows, coarse in ((fractions, True), (fractions[1:], False), (np.arange(20.0)[:, None], False)):
        expected = 2.0 * EPS32 if coarse else 32.0 * EPS * 0.2
        assert rounding_noise(np.full((1, 1), 5.0), y, rows) == pytest.approx(expected)
    both = np.concatenate([np.pi * fractions, fractions], axis=1)
    assert rounding_noise(np.full((1, 1), 5.0), np.array([0.1, 30.1]), both) == pytest.approx(
        2.0 * EPS32 * 30.1
    )


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


def test_windows_hold_examples_of_one_state() -> None:
    strata = np.arange(2 * ENOUGH + 5) % 2
    first, second = _windows(np.concatenate([strata, np.full(ENOUGH - 1, 7)]))
    assert first.tolist() == list(range(0, 2 * ENOUGH, 2))
    assert second.tolist() == list(
        range(1, 2 * ENOUGH, 2)
    )  # of the rest, and of the third state, too few are left
    many = _windows(np.zeros(100 * ENOUGH, dtype=int))
    assert len(many) == 20 and [w[0] for w in many[:2]] == [0, 5 * ENOUGH]  # every fifth


def test_the_lower_quartile_of_spreads_is_that_of_estimates(rng: np.random.Generator) -> None:
    """Spreads of a unit normal from eleven degrees of freedom each: what is told is the unit."""
    for count, close in ((4, 0.15), (24, 0.05), (400, 0.02)):
        told = [
            _quartile([(float(np.sqrt(x / 11.0)), 11) for x in rng.chisquare(11, count)]) for _ in range(200)
        ]
        assert np.median(told) == pytest.approx(1.0, abs=close)


@pytest.mark.parametrize(
    ("estimate", "explained", "n", "expected"),
    [
        (2.1, 0.0, 200, True),
        (1.9, 0.0, 200, False),  # not clearly larger
        (99.0, 0.5, 200, True),  # of the same order: it may have hidden examples of what is known
        (101.0, 0.5, 200, False),  # of another order, and yet much is explained
        (101.0, 0.05, 200, True),
        (60.0, 0.0, 200, True),
        (60.0, 0.0, 100, False),  # so few say nothing of noise that is as large as the signal, 100
        (40.0, 0.0, 100, True),
    ],
)
def test_when_an_estimate_refutes_what_was_assumed(
    estimate: float, explained: float, n: int, expected: bool
) -> None:
    y = np.resize([100.0, -100.0], n)
    assert refuted(1.0, estimate, explained=explained, y=y) is expected


def test_of_a_large_sum_only_its_changes_are_owed_to_other_columns() -> None:
    """A column that varies by a ten-thousandth of itself could be as rough as `y`, or as its changes."""
    y = np.array([5e4, 9e4, 2e4])
    tank = np.array([[20.0], [19.999], [19.998]])
    rough = 20.0 / 0.002
    assert rounding_noise(tank, y) == pytest.approx(32 * EPS * rough * 7e4)
    changes = np.array([3e-5, 1e-5, 2e-5])
    assert rounding_noise(tank, y, changes=changes) == pytest.approx(32 * EPS * 9e4)


@pytest.mark.parametrize("kinds", [1, 2, 4])
@pytest.mark.parametrize("seed", range(3))
def test_functions_that_hold_by_turns_are_no_noise(kinds: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, which = rng.normal(size=(80, 3)), rng.integers(kinds, size=80)
    y = (1.0 + which) * x[:, 0] + 0.25 * which
    assert coded_by_a_law(x, y, Scale(1e-14, 4.0, 6.0), float(y.std()) / 2, draws=1_500, rng=rng)


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_no_law(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(80, 3))
    y = 2.0 * x[:, 0] + 0.1 * rng.normal(size=80)
    assert not coded_by_a_law(x, y, Scale(1e-14, 4.0, 6.0), 0.1, draws=1_500, rng=rng)
