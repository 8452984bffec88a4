"""Expectation and maximisation (§3.2.4)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from streams import ALONE, BALL, Stream, mode_of

from relgym.clustering.columns import SlotSignature
from relgym.clustering.discovery import Scale
from relgym.clustering.em import Cluster, preferred, refit, role_matrix
from relgym.clustering.mode import Role
from relgym.config.constants import MOST_ROWS
from relgym.scene.objects import ObjectType
from relgym.scene.shapes import Box

SCALE = Scale(1e-13, 4.0, 8.0)
BOX = ObjectType("box", ("friction",), Box())


def filled(signature: SlotSignature, rows: np.ndarray) -> tuple[Stream, np.ndarray]:
    """A stream whose table holds the rows, and the rows' numbers."""
    stream = Stream(signature)
    bodies = [-1] * len(signature.types)
    return stream, np.array([stream.table.add(signature, row, b"", bodies) for row in rows])


def test_of_two_exact_explanations_the_one_with_fewer_parameters_wins() -> None:
    clusters = {1: Cluster(mode_of(("v", 1.0)), fitted=1000), 2: Cluster(mode_of(id=2), fitted=10)}
    assert preferred([1, 2], {1: 0.0, 2: 1e-14}, clusters, SCALE) == 2


def test_among_equals_the_more_frequent_then_the_older_wins() -> None:
    clusters = {
        1: Cluster(mode_of(("v", 1.0)), fitted=10),
        2: Cluster(mode_of(("w", 1.0), id=2), fitted=5, unfitted=6),
        3: Cluster(mode_of(("w", 2.0), id=3), fitted=11),
    }
    errors = {1: 0.0, 2: 0.0, 3: 0.0}
    assert preferred([1, 2, 3], errors, clusters, SCALE) == 2


def test_refitting_sharpens_the_weights(rng: np.random.Generator) -> None:
    x = rng.normal(size=(50, 2))
    stream, rows = filled(ALONE, x)
    y = 0.525 * x[:, 0] - 0.8 * x[:, 1]
    loose = Scale(1e-6, 4.0, 8.0)
    rough = Cluster(mode_of(("v", 0.525 + 1e-7), ("w", -0.8), constant=1e-7))
    done = refit(rough, stream.table, rows, y, loose)
    assert dict(done.mode.roles[0].terms) == pytest.approx({"v": 0.525, "w": -0.8}, abs=1e-13)
    assert done.mode.intercept == 0.0
    assert done.fitted == 50


def test_a_refit_that_would_lose_an_example_isnt_made(rng: np.random.Generator) -> None:
    x = rng.normal(size=(20, 2))
    stream, rows = filled(ALONE, x)
    y = 0.5 * x[:, 0]
    y[3] += 1.0
    cluster = Cluster(mode_of(("v", 0.5)))
    assert refit(cluster, stream.table, rows, y, SCALE).mode == cluster.mode


def test_roles_are_refitted_on_the_objects_that_play_them(rng: np.random.Generator) -> None:
    signature = SlotSignature((BALL, BOX, BOX))
    x = rng.uniform(0.1, 1.0, size=(60, 4))
    player = rng.integers(2, 4, 60)
    y = x[:, 0] - 2.5 * x[np.arange(60), player]
    stream, rows = filled(signature, x)
    mode = mode_of(("v", 1.0), others=[Role("box", (("friction", -2.5 + 1e-8),))])
    loose = Scale(1e-7, 4.0, 8.0)
    cluster = Cluster(mode)
    error, assignment = cluster.errors(stream.table, rows, y, loose)
    assert (error < 1e-7).all()
    assert (assignment == player - 2).all()
    done = refit(cluster, stream.table, rows, y, loose)
    assert done.mode.open_roles[0].terms[0][1] == pytest.approx(-2.5, abs=1e-13)


def test_a_mode_whose_roles_cant_be_filled_explains_nothing() -> None:
    stream, rows = filled(ALONE, np.ones((2, 2)))
    cluster = Cluster(mode_of(("v", 1.0), others=[Role("box", (("friction", 1.0),))]))
    assert np.isinf(cluster.errors(stream.table, rows, np.ones(2), SCALE)[0]).all()


def test_idle_is_where_no_term_acts() -> None:
    stream, rows = filled(ALONE, np.array([[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]))
    assert Cluster(mode_of(("v", -0.9))).idle(stream.table, rows, 1e-12).tolist() == [True, False, True]
    both = Cluster(mode_of(("v", -0.9), ("w", 0.1)))
    assert both.idle(stream.table, rows, 1e-12).tolist() == [False, False, True]


@given(st.integers(0, 2**32 - 1), st.sampled_from(["own", "a role", "no such object"]))
def test_the_error_of_one_example_is_that_of_many_to_the_bit(seed: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    signature = SlotSignature((BALL, BOX, BOX))
    x = rng.normal(size=(6, 4))
    stream, rows = filled(signature, x)
    others = {
        "own": [],
        "a role": [Role("box", (("friction", -2.5),))],
        "no such object": [Role("lid", (("x", 1.0),))],
    }
    cluster = Cluster(mode_of(("v", 0.7), ("w", -0.3), others=others[kind], constant=0.1))
    y = rng.normal(size=6)
    errors, assignments = cluster.errors(stream.table, rows, y, SCALE)
    for k, row in enumerate(rows.tolist()):
        one = cluster.error_one(stream.table, row, stream.table.x[row].tolist(), float(y[k]), SCALE)
        assert one == errors[k]
        assert cluster.closest_one(stream.table, row, float(y[k]), SCALE) == (errors[k], assignments[k])
    assert np.isinf(errors).all() == (kind == "no such object")


def test_columns_of_a_regression_are_read_from_the_players() -> None:
    signature = SlotSignature((BALL, BOX, BOX))
    stream, rows = filled(signature, np.array([[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]]))
    mode = mode_of(("w", 1.0), ("v", 2.0), others=[Role("box", (("friction", -2.5),))])
    found = role_matrix(mode, stream.table, rows, np.array([1, 0]), Cluster(mode))
    assert found.tolist() == [[2.0, 1.0, 4.0], [6.0, 5.0, 7.0]]


def test_few_examples_are_not_refitted_and_of_many_some(rng: np.random.Generator) -> None:
    x = rng.normal(size=(2 * MOST_ROWS, 2))
    stream, rows = filled(ALONE, x)
    loose = Scale(1e-3, 4.0, 8.0)
    rough = Cluster(mode_of(("v", 0.5001)), fitted=7, unfitted=9)
    y = 0.5 * x[:, 0]
    few = refit(rough, stream.table, rows[:2], y[:2], loose)
    assert (few.mode, few.fitted, few.unfitted) == (rough.mode, 2, 0)
    assert refit(rough, stream.table, rows[:0], y[:0], loose).fitted == 1
    y[1] += 1.0  # not among those that are evenly spread
    many = refit(rough, stream.table, rows, y, loose)
    assert many.fitted == 2 * MOST_ROWS
    assert dict(many.mode.roles[0].terms) == pytest.approx({"v": 0.5}, abs=1e-12)
    assert many.mode.sigma < 1e-12


def test_errors_of_two_sigma_are_ties_and_larger_ones_are_not() -> None:
    clusters = {1: Cluster(mode_of(("v", 1.0))), 2: Cluster(mode_of(("v", 1.0), ("w", 1.0), id=2))}
    scale = Scale(0.01, 4.0, 8.0)
    assert preferred([1, 2], {1: 0.02, 2: 0.0}, clusters, scale) == 1
    assert preferred([1, 2], {1: 0.021, 2: 0.0}, clusters, scale) == 2
    assert preferred([1, 2], {1: 0.03, 2: 0.035}, clusters, scale) == 1
    assert preferred([2], {2: 9.0}, clusters, scale) == 2


def test_what_counts_from_the_present_value_goes_on_doing_so(rng: np.random.Generator) -> None:
    """Of a clock far from 0 a weight beside 1 would be as good, in the tolerance, and say nothing of its steps."""
    x = np.column_stack([1.7e9 + rng.uniform(0.0, 1e3, 40), np.zeros(40)])
    stream, rows = filled(ALONE, x)
    clock = Cluster(mode_of(("v", 1.0), constant=0.1))
    done = refit(clock, stream.table, rows, x[:, 0] + 0.25, Scale(1e-5, 4.0, 8.0))
    assert dict(done.mode.roles[0].terms) == {"v": 1.0}
    assert done.mode.intercept == pytest.approx(0.25, abs=1e-7)
