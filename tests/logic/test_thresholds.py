from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from relgym.config.constants import FEW_VALUES
from relgym.logic.thresholds import bin_values, merit, simplest_between


def test_neighbours_of_one_class_share_a_bin() -> None:
    # values 0 to 5; the first three tuples are positive
    bins = bin_values(np.array([[0.0, 1.0, 4.0, 2.0, 3.0, 5.0]]), split=3)
    assert bins.index.tolist() == [[0, 0, 2, 1, 1, 3]]
    assert bins.low.tolist() == [[0.0, 2.0, 4.0, 5.0]]
    assert bins.high.tolist() == [[1.0, 3.0, 4.0, 5.0]]
    assert bins.merits.tolist() == [[1.0, 1.0, 1.0]]


def test_values_of_both_classes_have_a_bin_of_their_own() -> None:
    bins = bin_values(np.array([[1.0, 2.0, 2.0, 3.0]]), split=2)
    assert bins.index.tolist() == [[0, 1, 1, 2]]


def test_undefined_values_are_in_no_bin() -> None:
    bins = bin_values(np.array([[np.nan, 1.0], [np.nan, np.nan]]), split=1)
    assert bins.count == 1
    assert bins.index.tolist() == [[1, 0], [1, 1]]
    assert np.isnan(bins.low[1]).all()


def test_no_threshold_between_a_number_and_itself_computed_in_another_way() -> None:
    sine = 0.8660254037844386  # of 60 degrees; the next one is its neighbour
    bins = bin_values(np.array([[sine, 0.5, math.nextafter(sine, 1.0), 1.0]]), split=2)
    assert bins.index.tolist() == [[1, 0, 1, 2]]
    bins = bin_values(
        np.array([[0.0, -0.04, 1e-8, 0.03]]), split=2
    )  # a velocity of 1e-8 decides (Figure 1.3)
    assert bins.index.tolist() == [[0, 0, 1, 1]]


def test_no_threshold_between_distances_of_what_touches() -> None:
    # Differences of positions of some hundred units, all of them zero but for rounding.
    bins = bin_values(np.array([[0.0, 5.7e-14, 1.1e-13, -5e-15]]), split=2)
    assert bins.count == 1


def test_the_number_of_bins_is_bounded() -> None:
    values = np.arange(2000.0)
    alternating = np.concatenate([values[::2], values[1::2]])[np.newaxis]
    bins = bin_values(alternating, split=1000)
    assert bins.count == FEW_VALUES
    order = np.argsort(alternating[0])
    assert (np.diff(bins.index[0][order]) >= 0).all()


@given(low=st.floats(-1e9, 1e9), width=st.floats(1e-12, 1e6))
def test_thresholds_separate_the_ends_of_their_gap(low: float, width: float) -> None:
    high = low + width
    if high > low:
        assert low <= simplest_between(low, high) < high


def test_thresholds_read_well() -> None:
    assert simplest_between(-1.0, 1.0) == 0.0
    assert simplest_between(0.30001, 0.3217) == 0.31
    assert simplest_between(0.0, 1e-8) == 5e-9


def test_the_sign_decides_where_it_can() -> None:
    assert simplest_between(-0.3, 0.01) == 0.0  # however unequal the sides
    assert simplest_between(-1e-3, 1.0) != 0.0  # but not from the very edge: that may be rounding
    assert simplest_between(0.0, 1.0) == simplest_between(-1e-18, 1.0) == 0.5
    low, high = np.array([-1.0, 0.0, 2.0]), np.array([0.5, 9.0, 3.0])
    assert merit(low, high).tolist() == [np.inf, 9.0, 1.0]


def test_the_narrowest_gap_can_be_cut() -> None:
    assert simplest_between(1.0, math.nextafter(1.0, 2.0)) == 1.0
