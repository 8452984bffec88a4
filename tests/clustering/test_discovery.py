"""Which functions data identify, and which they only seem to."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.clustering.discovery import (
    Scale,
    counts,
    find_mode,
    identified,
    is_law,
    least_examples,
    likeness,
    plans,
    searched,
    verifying_bits,
)
from relgym.config import ClusteringConfig
from relgym.config.constants import SEARCHED_ROWS, WIDE
from relgym.numeric.ransac import Consensus
from relgym.numeric.stepwise import LinearFit, least_squares
from relgym.scheduling.work import Task

SCALE = Scale(1e-13, 4.0, 8.0)
CONFIG = ClusteringConfig()


def evaluated(x: np.ndarray, y: np.ndarray, fit: LinearFit, support: int = 3) -> Consensus | None:
    return identified(x, y, fit, scale=SCALE, support=support)


def told(x: np.ndarray, y: np.ndarray, scale: Scale, rng: np.random.Generator) -> Consensus | None:
    """What is found where all rows are news, and the first column is the property's present value."""
    states, n, columns = np.zeros(len(y), dtype=int), len(y), x.shape[1]
    return find_mode(x, y, states, stages=(columns,), fresh=n, scale=scale, config=CONFIG, rng=rng, present=0)


def test_a_weight_that_one_example_determines_is_dropped(rng: np.random.Generator) -> None:
    # A ball that meets the slope along the floor has w = 0 but for once: that once would fix w's weight.
    x = np.column_stack([rng.normal(size=30), np.zeros(30)])
    y = -0.17 * x[:, 0]
    x[7, 1], y[7] = 0.4, 0.9
    found = evaluated(x, y, least_squares(x, y, (0, 1)))
    assert found is not None
    assert found.fit.columns == (0,)
    assert found.fit.weights == pytest.approx((-0.17,), abs=1e-12)
    assert found.inliers.tolist() == [k != 7 for k in range(30)]


def test_an_example_far_out_in_every_column_backs_no_weight_either(rng: np.random.Generator) -> None:
    # It draws a regression of w on v to itself, so that others have larger residuals.
    x = np.column_stack([-0.02 - 0.04 * rng.random(12), 1e-18 * rng.normal(size=12)])
    y = -0.78 * x[:, 0] - 0.0006
    x[5], y[5] = (0.0355, -0.0041), 0.0032
    found = evaluated(x, y, least_squares(x, y, (0, 1)))
    assert found is not None
    assert found.fit.columns == (0,)
    assert found.inliers.tolist() == [k != 5 for k in range(12)]


@pytest.mark.parametrize(("backing", "columns"), [(2, (0,)), (3, (0, 1)), (10, (0, 1))])
def test_three_examples_must_back_each_weight(
    backing: int, columns: tuple[int, ...], rng: np.random.Generator
) -> None:
    x = np.column_stack([rng.normal(size=40), np.zeros(40)])
    x[:backing, 1] = rng.normal(size=backing)
    y = 0.5 * x[:, 0] - 0.7 * x[:, 1]
    found = evaluated(x, y, least_squares(x, y, (0, 1)))
    assert found is not None
    assert found.fit.columns == columns


def test_through_noise_many_rows_that_say_little_back_a_weight(rng: np.random.Generator) -> None:
    # No velocity is ten tolerances large, and yet hardly a row would be explained without it.
    scale = Scale(4e-3, 4.0, 8.0)
    x = rng.normal(scale=0.03, size=(2_000, 1)).clip(-0.1, 0.1)
    y = 0.98 * x[:, 0] + rng.normal(scale=4e-3, size=2_000)
    found = identified(x, y, least_squares(x, y, (0,)), scale=scale, support=3)
    assert found is not None and found.fit.columns == (0,)
    # A column whose part is as small as the noise is none.
    faint = identified(x, 0.1 * x[:, 0], least_squares(x, 0.1 * x[:, 0], (0,)), scale=scale, support=3)
    assert faint is None or faint.fit.columns == ()


def test_constants_of_a_few_scenes_are_no_law(rng: np.random.Generator) -> None:
    # Three scenes, two positions that are constant in each: any three constants are linear in them.
    scene = np.arange(60) % 3
    places = rng.normal(size=(3, 2))[scene]
    x = np.column_stack([rng.normal(size=60), places])
    y = x[:, 0] + np.array([1e-3, -2e-3, 5e-4])[scene]
    fit = least_squares(x, y, (0, 1, 2))
    assert np.abs(y - fit.predict(x)).max() < 1e-12
    assert evaluated(x, y, fit) is None


def test_constants_of_many_scenes_that_obey_are_a_law(rng: np.random.Generator) -> None:
    scene = np.arange(60) % 10
    x = np.column_stack([rng.normal(size=60), rng.normal(size=(10, 2))[scene]])
    y = x[:, 0] + 0.3 * x[:, 1] - 0.2 * x[:, 2]
    found = evaluated(x, y, least_squares(x, y, (0, 1, 2)))
    assert found is not None
    assert found.fit.columns == (0, 1, 2)


def test_persistence_needs_no_other_proof() -> None:
    x = np.repeat([3.0, 5.0], 6)[:, None]
    assert evaluated(x, x[:, 0], LinearFit((0,), (1.0,), 0.0, 0.0)) is not None
    assert evaluated(x, -0.9 * x[:, 0], LinearFit((0,), (-0.9,), 0.0, 0.0)) is None


def test_exact_data_need_ten_examples_and_noisy_ones_forty(rng: np.random.Generator) -> None:
    y = rng.normal(size=100)
    assert least_examples(y, SCALE, CONFIG) == 10
    assert least_examples(y, Scale(1e-2, 4.0, 8.0), CONFIG) > 30
    assert least_examples(y, Scale(1.0, 4.0, 8.0), CONFIG) == 40
    assert least_examples(y, SCALE, ClusteringConfig(min_examples=25)) == 25


def test_searches_go_from_few_columns_to_many() -> None:
    assert plans((3, 29), CONFIG) == [(3, 3, 6), (29, 2, 5), (29, 4, 12), (29, 8, 24)]
    assert plans((3, 29), ClusteringConfig(own_only=True)) == [(3, 3, 6)]


def test_a_mode_among_the_noise_is_found_by_its_newest_example(rng: np.random.Generator) -> None:
    x, y = rng.normal(size=(60, 3)), rng.normal(size=60)
    x[45:], y[45:] = x[45:], -0.8227241 * x[45:, 0] - 0.425 * x[45:, 1] - 0.000245
    found = find_mode(
        x, y, np.zeros(60, dtype=int), stages=(3,), fresh=1, scale=SCALE, config=CONFIG, rng=rng
    )
    assert found is not None
    assert found.size == 15
    assert found.fit.weights == pytest.approx((-0.8227241, -0.425), abs=1e-12)
    assert found.fit.intercept == pytest.approx(-0.000245, abs=1e-12)


def test_a_term_that_few_rows_do_not_show_is_found_from_near_misses(rng: np.random.Generator) -> None:
    # Extrapolated from a few rows, the function without it is as good as any, but explains hardly a row.
    x = rng.normal(size=(400, 24)) * np.array([100.0, 2.0, 0.2] + 21 * [1.0])
    y = x[:, 0] + 0.2 * x[:, 1] + 0.01 * x[:, 2] + 0.002 + rng.normal(scale=2e-5, size=400)
    y[:100] += rng.normal(scale=0.05, size=100)
    found = find_mode(
        x,
        y,
        np.zeros(400, dtype=int),
        stages=(24,),
        fresh=1,
        scale=Scale(1e-4, 4.0, 6.0),
        config=CONFIG,
        rng=rng,
    )
    assert found is not None
    assert found.fit.columns == (0, 1, 2)
    assert found.fit.weights == pytest.approx((1.0, 0.2, 0.01), abs=1e-4)
    assert 298 <= found.size <= 306


@pytest.mark.parametrize(("exceptions", "column"), [(1, 0), (4, 1)])
def test_that_nothing_changes_is_said_in_fewer_bits_than_another_flag(
    rng: np.random.Generator, exceptions: int, column: int
) -> None:
    # A flag that was set once when the other one was is no copy of it; one that is set whenever the other one is, is.
    x = np.repeat(rng.integers(0, 2, size=(60, 1)), 2, axis=1).astype(float)
    y = x[:, 0].copy()
    changed = np.flatnonzero(y == 1.0)[:exceptions]
    x[changed, 0] = 0.0
    found = told(x, y, Scale(1e-12, 4.0, 6.0), rng)
    assert found is not None
    assert found.fit.columns == (column,)
    assert found.fit.weights == pytest.approx((1.0,))
    assert found.size == (60 if column else 60 - exceptions)


def test_what_drifts_within_the_noise_is_not_said_to_stay(rng: np.random.Generator) -> None:
    # Each row may be one of something that stays; all of them together aren't.
    x = rng.normal(size=(300, 1))
    y = x[:, 0] + 0.02 + rng.normal(scale=0.01, size=300)
    found = told(x, y, Scale(0.01, 4.0, 6.0), rng)
    assert found is not None
    assert found.fit.intercept == pytest.approx(0.02, abs=2e-3)


def test_fresh_rows_may_outnumber_those_left_to_search(rng: np.random.Generator) -> None:
    # Of 900 rows that no search has seen some have become a mode's tail, and 600 are left.
    x = rng.normal(size=(600, 3))
    y = 2.0 * x[:, 0]
    found = find_mode(
        x, y, np.zeros(600, dtype=int), stages=(3,), fresh=900, scale=SCALE, config=CONFIG, rng=rng
    )
    assert found is not None
    assert found.fit.weights == pytest.approx((2.0,), abs=1e-12)


def test_few_multiples_of_one_step_are_counted() -> None:
    assert counts(np.array([0.0, 2.0, -1.0, 0.0]), SCALE)
    assert counts(np.array([0.25, 1.0, 0.5]), SCALE)
    assert not counts(np.array([0.0, 1.0, 0.0]), SCALE)  # either or
    assert not counts(np.array([0.0, 1.0, 1.5, 2.1]), SCALE)
    assert not counts(np.arange(100.0), SCALE)


def test_of_what_counts_a_few_small_numbers_add_up_to_another_by_chance(rng: np.random.Generator) -> None:
    x = rng.integers(-3, 4, size=(36, 5)).astype(float)
    y = rng.integers(-3, 4, size=36).astype(float)
    y[:15] = x[:15, 1] - x[:15, 2] + x[:15, 3]
    arguments = {"stages": (5,), "fresh": 36, "scale": SCALE, "config": CONFIG}
    found = [
        find_mode(x, y, np.zeros(36, dtype=int), rng=rng, counting=counting, **arguments)
        for counting in (False, True)
    ]
    assert found[0] is not None
    assert found[1] is None


def test_among_many_columns_a_few_examples_show_a_constant(rng: np.random.Generator) -> None:
    x = rng.normal(size=(5, WIDE + 20))
    found = find_mode(
        x,
        np.ones(5),
        np.zeros(5, dtype=int),
        stages=(WIDE + 20,),
        fresh=1,
        scale=Scale(1e-12, 4.0, 6.0),
        config=ClusteringConfig(min_examples=4),
        rng=rng,
    )
    assert found is not None
    assert (found.fit.columns, found.fit.intercept, found.size) == ((), 1.0, 5)


# ---------------------------------------------------------------------- which rows are searched
@given(st.integers(0, 5_000), st.integers(1, 6_000), st.integers(0, 2**32 - 1))
def test_so_many_rows_are_searched_the_newest_among_them(n: int, fresh: int, seed: int) -> None:
    rows = searched(n, fresh, np.random.default_rng(seed))
    assert (np.diff(rows) > 0).all()
    assert len(rows) == 0 or (rows[0] >= 0 and rows[-1] == n - 1)
    if n <= SEARCHED_ROWS:
        assert len(rows) == n
        return
    newest = min(max(fresh, SEARCHED_ROWS // 2), SEARCHED_ROWS)
    np.testing.assert_array_equal(rows[-newest:], np.arange(n - newest, n))
    assert len(rows) == newest + min(n - newest, SEARCHED_ROWS // 2)
    assert len(rows) <= SEARCHED_ROWS + SEARCHED_ROWS // 2


def test_all_of_few_rows_are_searched_without_a_draw() -> None:
    rng = np.random.default_rng(3)
    before = rng.bit_generator.state
    assert searched(SEARCHED_ROWS, 1, rng).tolist() == list(range(SEARCHED_ROWS))
    assert rng.bit_generator.state == before
    older = [searched(5_000, 1, np.random.default_rng(k))[:200].tolist() for k in (3, 3, 4)]
    assert older[0] == older[1] != older[2]
    assert min(older[0]) < 1_000 and max(older[0]) > 4_000  # from all of them


# ---------------------------------------------------------------------- in pieces
@pytest.mark.parametrize("kind", ["a law", "nothing", "a law that lacks a term"])
def test_a_mode_searched_for_in_pieces_is_the_one_found_at_once(kind: str) -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(150, 24)) * np.array([100.0, 2.0, 0.2] + 21 * [1.0])
    y, scale = rng.normal(size=150), SCALE
    if kind == "a law":
        y[70:] = 0.5 * x[70:, 0] - 2.0 * x[70:, 1]
    if kind == "a law that lacks a term":
        scale = Scale(1e-4, 4.0, 6.0)
        y = x[:, 0] + 0.2 * x[:, 1] + 0.01 * x[:, 2] + rng.normal(scale=2e-5, size=150)
    given_ = {"stages": (3, 24), "fresh": 150, "scale": scale, "config": CONFIG}
    strata = np.arange(150) % 2
    own = np.random.default_rng(7)
    whole = find_mode(x, y, strata, rng=own, **given_)
    task = Task(find_mode, x, y, strata, rng=np.random.default_rng(7), **given_)
    while not task.done:
        task.advance(1)
        if task.pieces % 7 == 3:  # saved and read while it is under way
            task = pickle.loads(pickle.dumps(task))
    assert task.pieces > 5
    assert task.rng is None or task.rng.bit_generator.state == own.bit_generator.state
    if whole is None or task.result is None:
        assert kind == "nothing" and whole is task.result is None
        return
    assert task.result.fit == whole.fit
    np.testing.assert_array_equal(task.result.inliers, whole.inliers)
    assert whole.fit.columns == ((0, 1) if kind == "a law" else (0, 1, 2))


# ---------------------------------------------------------------------- laws and tangents
def test_a_tangent_is_given_away_by_near_misses() -> None:
    # Tail 8 σ; near misses are those up to 100 σ. Twenty are explained, so ten near misses are no more than half.
    scale = Scale(1.0, 4.0, 8.0)
    fit = LinearFit((), (), 0.0, 0.0)
    for misses, law in ((10, True), (11, False)):
        y = np.r_[np.zeros(20), np.full(misses, 100.0), np.full(50, 101.0), np.full(50, 7.9)]
        found = Consensus(fit, np.arange(len(y)) < 20)
        assert is_law(np.zeros((len(y), 1)), y, found, 1, scale) is law


def test_a_tangent_is_given_away_by_residuals_that_are_alike() -> None:
    scale, x = Scale(1.0, 4.0, 8.0), np.linspace(-1.0, 1.0, 41)[:, None]
    fit, inliers = LinearFit((), (), 0.0, 0.0), np.ones(41, dtype=bool)
    curve, zigzag = np.square(x[:, 0]) - 1.0 / 3.0, np.where(np.arange(41) % 2, 0.5, -0.5)
    assert not is_law(x, curve, Consensus(fit, inliers), 1, scale)
    assert is_law(x, zigzag, Consensus(fit, inliers), 1, scale)
    assert is_law(x, 0.5 * curve, Consensus(fit, inliers), 1, scale)  # less than a quarter of σ: rounding


def test_likeness_by_hand() -> None:
    x = np.array([[0.0], [0.1], [1.0], [1.1]])
    # Neighbours are 0 and 1, 2 and 3.
    assert likeness(x, np.array([1.0, 1.0, -1.0, -1.0])) == 1.0
    assert likeness(x, np.array([1.0, -1.0, 1.0, -1.0])) == -1.0
    # About the mean, 1/2: (1.5 · -0.5 · 2 + -0.5 · -0.5 · 2) / (1.5^2 + 3 · 0.5^2) of the means.
    assert likeness(x, np.array([2.0, 0.0, 0.0, 0.0])) == pytest.approx((-1.5 + 0.5) / 3.0)
    assert likeness(x, np.array([3.0, 3.0, 3.0, 3.0])) == 0.0
    assert likeness(np.ones((4, 1)), np.arange(4.0)) == 0.0  # nothing says which are close
    assert likeness(x[:1], np.ones(1)) == 0.0


def test_bits_that_an_example_verifies_by() -> None:
    scale = Scale(0.25, 4.0, 8.0)  # tolerance 1
    assert verifying_bits(np.array([0.0, 64.0, 3.0]), scale) == 6.0
    assert verifying_bits(np.array([5.0, 5.5]), scale) == 1.0
    assert verifying_bits(np.empty(0), scale) == 1.0
    # 24 bits need ten examples, each of 12 bits less 2.5 more.
    for bits, needed in ((24, 10), (18, 25), (12, 40), (6, 40), (30, 10)):
        assert least_examples(np.array([0.0, 2.0**bits]), scale, CONFIG) == needed


def test_a_clock_takes_steps_and_isnt_stretched(rng: np.random.Generator) -> None:
    x = 1.7e9 + np.sort(rng.uniform(0.0, 1e3, 60))[:, None]
    found = told(x, x[:, 0] + 0.25, Scale(1e-5, 4.0, 6.0), rng)
    assert found is not None
    assert (found.fit.columns, found.fit.weights) == ((0,), (1.0,))
    assert found.fit.intercept == pytest.approx(0.25, abs=1e-6)
    assert found.size == 60


@pytest.mark.parametrize("share", [0.25, 0.75])
def test_of_a_switch_of_two_values_most_rows_tell_a_law_without_it(
    share: float, rng: np.random.Generator
) -> None:
    """Whether they are values of a law of the switch or of two laws two values don't tell."""
    on = np.repeat([0.0, 1.0], [round(60 * (1.0 - share)), round(60 * share)])
    x = np.column_stack([rng.normal(size=60), on])
    y = 0.95 * x[:, 0] + 1.2 * x[:, 1] + 0.25
    found = evaluated(x, y, least_squares(x, y, (0, 1)))
    assert found is not None
    assert found.fit.columns == (0,)
    assert found.fit.weights == pytest.approx((0.95,))
    assert found.fit.intercept == pytest.approx(1.45 if share > 0.5 else 0.25)
    assert found.inliers.tolist() == (on == round(share)).tolist()


def test_of_a_switch_that_is_on_half_of_the_time_no_law_is_told(rng: np.random.Generator) -> None:
    x = np.column_stack([rng.normal(size=60), np.repeat([0.0, 1.0], 30)])
    y = 0.95 * x[:, 0] + 1.2 * x[:, 1] + 0.25
    assert evaluated(x, y, least_squares(x, y, (0, 1))) is None
