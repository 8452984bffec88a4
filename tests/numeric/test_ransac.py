"""Consensus search: rare exact functions among rows that obey nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.numeric.ransac import Consensus, consensus, draw_samples, refine
from relgym.numeric.stepwise import LinearFit

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
