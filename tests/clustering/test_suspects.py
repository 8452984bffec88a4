"""Modes whose examples others explain by chance: where they are looked for, and what convinces."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from streams import Stream

from relgym.clustering.discovery import Scale
from relgym.clustering.suspects import Evidence, likeliest, suspects
from relgym.config import ClusteringConfig
from relgym.config.constants import MOST_ROWS
from relgym.numeric.stepwise import LinearFit

SIGMA = 0.1
SCALE = Scale(SIGMA, 4.0, 6.0)


# ---------------------------------------------------------------------- when and where
def test_suspects_are_all_examples_of_states_that_are_explained_badly() -> None:
    strata = np.array([7, 3, 3, 7, 5, 3, 7, 7])
    errors = SIGMA * np.array([0.1, 2.5, 0.0, 0.3, 1.3, 2.0, 0.2, 0.1])
    # Mean squares 0.04, 3.4 and 1.7; less than one is usual.
    assert suspects(strata, errors, SCALE).tolist() == [1, 2, 5]


def test_noise_that_was_underrated_makes_nobody_a_suspect() -> None:
    strata = np.repeat([1, 2, 3], 4)
    assert suspects(strata, np.full(12, 3.0 * SIGMA), SCALE).tolist() == []


def test_examples_where_no_mode_applies_are_suspects() -> None:
    strata = np.array([1] * 50 + [2])
    assert suspects(strata, np.array([0.0] * 50 + [math.inf]), SCALE).tolist() == [50]


def test_of_many_suspects_the_newest_are_looked_at() -> None:
    strata = np.array([1] * 5_000 + [2] * 4_000)
    errors = np.where(strata == 2, 5.0 * SIGMA, 0.0)
    assert suspects(strata, errors, SCALE).tolist() == list(range(9_000 - MOST_ROWS, 9_000))


# ---------------------------------------------------------------------- evidence
def test_evidence_by_hand() -> None:
    # Range and noise such that lying anywhere costs 3 bits: an unexplained example is worth log2(1/2 + 8/2).
    spread = 8.0 * SIGMA * math.sqrt(2.0 * math.pi)
    x = np.arange(16.0)[:, None]
    known = np.array([math.inf] * 12 + [0.0] * 4)
    evidence = Evidence(x, np.zeros(16), known, scale=SCALE, spread=spread)
    nought = LinearFit((), (), 0.0, 0.0)
    assert evidence.of(nought) == pytest.approx(12 * math.log2(4.5))
    constant = LinearFit((), (), 1e-12, 0.0)  # a parameter costs half of log2(16), and the best example
    assert evidence.of(constant) == pytest.approx(11 * math.log2(4.5) - 2.0)


def test_a_function_that_explains_what_is_explained_gains_nothing(rng: np.random.Generator) -> None:
    x = rng.normal(size=(60, 1))
    y = x[:, 0] + rng.normal(scale=SIGMA, size=60)
    same = LinearFit((0,), (1.0,), 0.0, 0.0)
    known = np.abs(y - x[:, 0])
    assert Evidence(x, y, known, scale=SCALE, spread=float(np.ptp(y))).of(same) < 0.0


def hidden(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows (v, w) of v' = 0.5 v - 0.8 w, and their errors by v' = v or v' = 0, through noise a fifth of the signal."""
    x = rng.normal(scale=0.5, size=(n, 2))
    y = 0.5 * x[:, 0] - 0.8 * x[:, 1] + rng.normal(scale=SIGMA, size=n)
    return x, y, np.minimum(np.abs(y - x[:, 0]), np.abs(y))


def test_a_law_is_found_whose_examples_others_mostly_explain(rng: np.random.Generator) -> None:
    x, y, known = hidden(rng, 80)
    assert (known <= SCALE.tolerance).mean() > 0.5
    assert (known > SCALE.tail).sum() < 20  # what is left of it, where forty examples found a mode
    evidence = Evidence(x, y, known, scale=SCALE, spread=float(np.ptp(y)))
    found = likeliest(evidence, np.zeros(80, dtype=int), rng=rng, draws=1_536, most=8)
    assert found is not None
    assert found.columns == (0, 1)
    assert found.weights == pytest.approx((0.5, -0.8), abs=0.1)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_examples_of_known_modes_convince_of_no_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = rng.normal(scale=0.5, size=(60, 2))
    y = np.where(rng.random(60) < 0.5, x[:, 0], 0.0) + rng.normal(scale=SIGMA, size=60)
    known = np.minimum(np.abs(y - x[:, 0]), np.abs(y))
    evidence = Evidence(x, y, known, scale=SCALE, spread=float(np.ptp(y)))
    assert likeliest(evidence, np.zeros(60, dtype=int), rng=rng, draws=1_536, most=8) is None


def test_few_examples_convince_of_nothing(rng: np.random.Generator) -> None:
    x, y, _ = hidden(rng, 6)
    evidence = Evidence(x, y, np.full(6, math.inf), scale=SCALE, spread=3.0)
    assert likeliest(evidence, np.zeros(6, dtype=int), rng=rng, draws=1_536, most=8) is None


# ---------------------------------------------------------------------- in a stream
def bouncing(
    sd: float, rng: np.random.Generator, n: int = 1_792
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flight (v' = v), and now and then a ramp's bounce (v' = 0.5 v - 0.8 w) in a state of its own."""
    x = rng.normal(scale=0.03, size=(n, 2))
    ramp = rng.random(n) < 0.04
    y = np.where(ramp, 0.5 * x[:, 0] - 0.8 * x[:, 1], x[:, 0])
    return x, y + rng.normal(scale=sd, size=n), ramp


@pytest.mark.parametrize("noise_std", ["auto", 4e-3])
def test_a_stream_through_much_noise_learns_its_rare_mode(
    noise_std: float | str, rng: np.random.Generator
) -> None:
    x, y, ramp = bouncing(4e-3, rng)
    stream = Stream(config=ClusteringConfig(noise_std=noise_std))  # type: ignore[arg-type]
    for row, value, bounces in zip(x, y, ramp, strict=True):
        stream.feed([row], [value], b"ramp" if bounces else b"air")
    modes = {tuple(p for p, _ in m.roles[0].terms): m for m in stream.clusterer.modes}
    assert set(modes) == {("v",), ("v", "w")}
    assert dict(modes["v", "w"].roles[0].terms) == pytest.approx({"v": 0.5, "w": -0.8}, abs=0.1)
    own = stream.clusterer.labels == modes["v", "w"].id
    assert (own & ramp).sum() > 0.9 * ramp.sum()  # and hardly any that fits it by chance
    assert (own & ~ramp).sum() < 0.01 * len(ramp)
    assert stream.clusterer.scale.sigma == pytest.approx(4e-3, rel=0.1)


def test_reviews_say_that_examples_were_assigned_anew(rng: np.random.Generator) -> None:
    assert reviews(ClusteringConfig(noise_std=4e-3), rng) == [216, 324, 486]


def test_a_world_of_one_state_is_not_reviewed(rng: np.random.Generator) -> None:
    assert reviews(ClusteringConfig(noise_std=4e-3), rng, apart=False) == []


def reviews(config: ClusteringConfig, rng: np.random.Generator, *, apart: bool = True) -> list[int]:
    """After how many of 640 examples there were reviews; `apart`: bounces have a state of their own."""
    x, y, ramp = bouncing(4e-3, rng, n=640)
    stream, found = Stream(config=config), []
    for k, (row, value, bounces) in enumerate(zip(x, y, ramp, strict=True)):
        (report,) = stream.feed([row], [value], b"ramp" if bounces and apart else b"air")
        found += [k + 1] if report.reassigned else []
    return found


def test_exact_data_are_never_reviewed(rng: np.random.Generator) -> None:
    x, y, _ = bouncing(0.0, rng, n=640)
    assert not any(r.reassigned for r in Stream().feed(x, y))
