"""Consensus search: rare exact functions among rows that obey nothing."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from relgym.numeric import ransac
from relgym.numeric.ransac import (
    Consensus,
    _choose_among_many,
    _distinct,
    choose_columns,
    consensus,
    draw_samples,
    refine,
)
from relgym.numeric.stepwise import LinearFit, least_squares
from relgym.scheduling.work import Task

SIGMA, TOLERANCE = 1e-13, 4e-13


def mixture(rng: np.random.Generator, n: int, members: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of four columns of which `members` obey ``y = 0.5 x_1 - 0.8 x_3 + 0.1``: x, y, who obeys."""
    x, y = rng.normal(size=(n, 4)), rng.normal(size=n)
    obey = np.zeros(n, dtype=bool)
    obey[rng.choice(n, size=members, replace=False)] = True
    y[obey] = 0.5 * x[obey, 1] - 0.8 * x[obey, 3] + 0.1
    return x, y, obey


def search(x: np.ndarray, y: np.ndarray, rng: np.random.Generator, **changes: object) -> Consensus | None:
    settings: dict[str, object] = {"terms": 2, "size": 5, "draws": 10_000} | changes
    return consensus(x, y, sigma=SIGMA, tolerance=TOLERANCE, rng=rng, **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(3))
def test_nineteen_of_ninety_are_found(seed: int) -> None:
    # One in some 4,000 samples of five lies in the mode; samples of eight would need a hundred times as many.
    rng = np.random.default_rng(seed)
    x, y, obey = mixture(rng, 90, 19)
    found = search(x, y, rng, draws=40_000)
    assert found is not None
    assert (found.inliers == obey).all()
    assert found.size == 19
    assert found.fit.columns == (1, 3)
    assert found.fit.weights == pytest.approx((0.5, -0.8), abs=1e-12)
    assert found.fit.intercept == pytest.approx(0.1, abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_rows_in_the_same_relational_state_are_found_with_few_draws(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y, obey = mixture(rng, 90, 19)
    strata = np.where(obey | (np.arange(90) % 8 == 0), 0, 1 + np.arange(90) % 3)
    found = search(x, y, rng, draws=1536, strata=strata)
    assert found is not None
    assert (found.inliers == obey).all()


def test_through_noise_a_sample_isnt_content_with_a_column_that_nearly_does(rng: np.random.Generator) -> None:
    # Balls meet a slope at much the same angle: one velocity tells most of the other.
    sideways = rng.uniform(-0.06, 0.06, size=80)
    x = np.column_stack([sideways, 0.6 * sideways + rng.normal(scale=0.01, size=80)])
    y = -0.82 * x[:, 0] - 0.42 * x[:, 1] + rng.normal(scale=1e-4, size=80)
    found = consensus(x, y, sigma=1.6e-4, tolerance=6.4e-4, terms=2, size=5, draws=300, rng=rng)
    assert found is not None
    assert found.fit.columns == (0, 1) and found.size >= 78


def test_rows_that_obey_nothing_verify_nothing(rng: np.random.Generator) -> None:
    x, y, _ = mixture(rng, 60, 0)
    assert search(x, y, rng) is None


def test_too_few_rows_are_no_sample(rng: np.random.Generator) -> None:
    x, y, _ = mixture(rng, 4, 4)
    assert search(x, y, rng) is None


def test_the_larger_of_two_modes_wins(rng: np.random.Generator) -> None:
    x = rng.normal(size=(60, 3))
    y = np.where(np.arange(60) < 25, -0.9 * x[:, 0], x[:, 0])
    found = search(x, y, rng, terms=1, size=4, draws=200)
    assert found is not None
    assert found.size == 35
    assert found.fit.weights == pytest.approx((1.0,), abs=1e-13)


def test_the_same_generator_draws_the_same(rng: np.random.Generator) -> None:
    x, y, _ = mixture(rng, 90, 30)
    one, two = (search(x, y, np.random.default_rng(7), draws=2000) for _ in range(2))
    assert one is not None and two is not None
    assert one.fit == two.fit


def test_samples_hold_an_anchor_and_distinct_rows(rng: np.random.Generator) -> None:
    samples = draw_samples(20, 5, 300, rng=rng, anchors=np.array([3, 19]))
    assert samples.shape == (300, 5)
    assert all(len(set(row)) == 5 and {3, 19} & set(row) for row in samples.tolist())


def test_a_third_of_the_samples_stays_in_the_anchors_stratum(rng: np.random.Generator) -> None:
    strata = np.arange(40) % 2
    samples = draw_samples(40, 5, 300, rng=rng, strata=strata, anchors=np.array([0]))
    pure = (strata[samples] == 0).all(axis=1)
    assert pure[1::3].all()
    assert not pure[0::3].all()


def test_where_a_state_has_few_rows_those_of_similar_states_follow(rng: np.random.Generator) -> None:
    # Rows 0 and 20 share a state; so do 3 and 23, and so on. States are the further apart the more their numbers are.
    strata = np.arange(40) % 20
    apart = np.abs(strata[:, None] - strata[None])
    samples = draw_samples(40, 5, 300, rng=rng, strata=strata, apart=apart, anchors=np.array([0]))
    near = [set(s.tolist()) for s in samples[1::3]]
    assert all({0, 20, 1, 21} <= s <= {0, 20, 1, 21, 2, 22} for s in near)
    assert {0, 20, 1, 21, 2} in near and {0, 20, 1, 21, 22} in near
    # Where there are enough, it is as ever, to the last draw.
    many = np.arange(40) % 4
    drawn = [
        draw_samples(40, 5, 90, rng=np.random.default_rng(1), strata=many, apart=given)
        for given in (None, np.abs(many[:, None] - many[None]))
    ]
    np.testing.assert_array_equal(*drawn)


def test_a_third_of_the_samples_is_contiguous(rng: np.random.Generator) -> None:
    samples = draw_samples(1000, 5, 300, rng=rng, anchors=np.array([500]))
    assert (np.abs(samples[2::3] - 500) < 10).all()
    assert np.abs(samples[0::3] - 500).max() > 100


def test_refining_gives_up_what_too_few_rows_support(rng: np.random.Generator) -> None:
    x, y = rng.normal(size=(10, 2)), rng.normal(size=10)
    start = Consensus(LinearFit((0, 1), (1.0, 1.0), 0.0, 0.0), np.arange(10) < 3)
    assert refine(x, y, start, sigma=SIGMA, tolerance=TOLERANCE).size == 0


def test_refining_drops_a_needless_term(rng: np.random.Generator) -> None:
    x = rng.normal(size=(20, 2))
    start = Consensus(LinearFit((0, 1), (2.0, 1e-14), 1e-14, 0.0), np.ones(20, dtype=bool))
    found = refine(x, 2.0 * x[:, 0], start, sigma=SIGMA, tolerance=TOLERANCE)
    assert found.fit.columns == (0,)
    assert found.fit.intercept == 0.0
    assert found.size == 20


@given(st.integers(0, 2**32 - 1), st.permutations(range(40)))
def test_the_order_of_rows_decides_nothing_when_all_obey(seed: int, order: list[int]) -> None:
    rng = np.random.default_rng(seed)
    x, y, _ = mixture(rng, 40, 40)
    found = search(x[order], y[order], rng, draws=50)
    assert found is not None
    assert found.inliers.all()
    assert found.fit.columns == (1, 3)


@pytest.mark.parametrize("anchors", [None, np.array([1, 4])])
def test_of_few_rows_every_sample_is_drawn_once(anchors: NDArray[np.intp] | None) -> None:
    def drawn(draws: int) -> NDArray[np.intp]:
        return draw_samples(6, 3, draws, rng=np.random.default_rng(0), anchors=anchors)

    found = drawn(20)  # of 6 rows there are 20 samples of 3, and 10 behind each of two rows
    assert len({(row[0] if anchors is not None else 0, frozenset(row)) for row in found.tolist()}) == 20
    assert all(len(set(row)) == 3 for row in found.tolist())
    if anchors is not None:
        assert found[:, 0].tolist() == [1] * 10 + [4] * 10
    assert len(drawn(19)) == 19


# ---------------------------------------------------------------------- in pieces
@settings(max_examples=50)
@given(
    st.integers(1, 120),
    st.integers(1, 8),
    st.integers(1, 90),
    st.sets(st.sampled_from(["strata", "apart", "anchors"])),
    st.integers(0, 2**32 - 1),
)
def test_samples_drawn_in_pieces_are_those_drawn_whole(
    n: int, size: int, draws: int, told: set[str], seed: int
) -> None:
    assume(not 0 < comb(n - 1, size - 1) <= draws)  # else each sample is drawn once
    given_ = np.random.default_rng(seed)
    strata = given_.integers(4, size=n)
    arguments = {
        "strata": strata,
        "apart": np.abs(strata[:, None] - strata),
        "anchors": given_.integers(n, size=3),
    }
    some = {name: arguments[name] for name in sorted(told)}
    found, states, pieces = [], [], []
    for drawn in (1, 10**9):  # sixteen samples at a time, and all of them
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(ransac, "CACHED", drawn)
            task = Task(draw_samples, n, size, draws, rng=np.random.default_rng(seed), **some)
            task.advance(10**12)
        found.append(task.result)
        states.append(task.rng.bit_generator.state)
        pieces.append(task.pieces)
    np.testing.assert_array_equal(*found)
    assert states[0] == states[1]
    assert pieces == [-(-draws // 16) + 1, 2]
    assert found[0].shape == (draws, min(size, n))
    assert all(len(set(row)) == len(row) for row in found[0].tolist())
    if "anchors" in some:
        anchors = set(arguments["anchors"].tolist())
        assert all(anchors & set(row) for row in found[0].tolist())


@pytest.mark.parametrize("columns", [6, 60])
def test_samples_are_fitted_in_pieces_as_whole(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    x = rng.normal(size=(80, columns))
    y = np.where(np.arange(80) < 60, 2.0 * x[:, 1] - x[:, 4], rng.normal(size=80))
    found = []
    for chunk in (1, 10**9):
        monkeypatch.setattr(ransac, "CACHED", chunk)
        found.append(search(x, y, np.random.default_rng(0), draws=200))
    assert found[0] is not None and found[1] is not None
    assert found[0].fit == found[1].fit
    np.testing.assert_array_equal(found[0].inliers, found[1].inliers)
    assert found[0].fit.columns == (1, 4) and found[0].size == 60


@settings(max_examples=40)
@given(st.integers(1, 3), st.integers(0, 2**32 - 1))
def test_among_many_columns_samples_choose_what_they_choose_among_few(terms: int, seed: int) -> None:
    """Sums in another order: the columns that are chosen explain all of it either way."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(20, 12, 50))
    a -= a.mean(axis=1, keepdims=True)
    picked = np.array([rng.choice(50, terms, replace=False) for _ in range(20)])
    weights = rng.uniform(0.5, 2.0, size=(20, terms)) * rng.choice([-1.0, 1.0], size=(20, terms))
    y = (np.take_along_axis(a, picked[:, None, :], axis=2) * weights[:, None]).sum(axis=2)
    rows = a.swapaxes(0, 1)
    told = [
        choose(rows.copy(), y.copy(), terms, 1e-9, 1e-16) for choose in (choose_columns, _choose_among_many)
    ]
    np.testing.assert_array_equal(told[0][0], told[1][0])
    np.testing.assert_allclose(told[0][1], told[1][1], rtol=1e-6, atol=1e-20)
    for (columns, left), sample in ((each, k) for each in told for k in range(20)):
        fit = least_squares(a[sample], y[sample], tuple(sorted(columns[sample].tolist())))
        np.testing.assert_allclose(
            left[sample], np.square(y[sample] - fit.predict(a[sample])).sum(), atol=1e-9
        )


def test_a_verified_sample_stops_choosing() -> None:
    """The third sample is a constant, the second one column's, the first one obeys nothing."""
    a = np.array([[-1.0, 0.0, 1.0, 0.0], [1.0, -1.0, 1.0, -1.0]]).T[None].repeat(3, axis=0)
    a -= a.mean(axis=1, keepdims=True)
    y = np.array([[1.0, 5.0, -2.0, 0.5], [2.0, -2.0, 2.0, -2.0], [0.0, 0.0, 0.0, 0.0]])
    y -= y.mean(axis=1, keepdims=True)
    chosen, left = choose_columns(a.swapaxes(0, 1).copy(), y, 1, 1e-9, 1e-12)
    assert chosen[1:].tolist() == [[1], [-1]]
    assert chosen[0, 0] >= 0 and left[0] > 1.0
    assert left[1:] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_samples_that_tell_a_known_function_again_are_not_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    x = rng.normal(size=(60, 4))
    y = np.where(np.arange(60) % 2 == 0, 2.0 * x[:, 0] - x[:, 1], x[:, 2])
    fitted: list[tuple[int, ...]] = []

    def spied(rows: np.ndarray, values: np.ndarray, columns: tuple[int, ...]) -> LinearFit:
        fitted.append(columns)
        return least_squares(rows, values, columns)

    monkeypatch.setattr("relgym.numeric.ransac.least_squares", spied)
    found = consensus(
        x,
        y,
        sigma=1e-12,
        tolerance=4e-12,
        terms=3,
        size=6,
        draws=600,
        rng=np.random.default_rng(1),
        strata=np.arange(60) % 2,
    )
    assert found is not None and found.size == 30
    # six samples of a set of columns may be tried; each function is fitted once, and refined
    assert fitted.count((2,)) <= 3
    assert fitted.count((0, 1)) <= 3


def test_of_the_same_columns_few_samples_are_tried() -> None:
    """Fewest terms first, and what isn't verified not at all."""
    samples = np.arange(20)[:, None]
    chosen = np.array([[-2, 5]] * 3 + [[4, 2]] * 8 + [[1, -1]] * 7 + [[-1, -1]] * 2)
    kept = [(int(sample[0]), columns) for sample, columns in _distinct(samples, chosen, 99)]
    assert kept == [
        *((k, []) for k in (18, 19)),
        *((k, [1]) for k in range(11, 17)),
        *((k, [2, 4]) for k in range(3, 9)),
    ]
    assert [int(sample[0]) for sample, _ in _distinct(samples, chosen, 3)] == [18, 19, 11]
