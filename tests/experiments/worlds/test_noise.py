"""Worlds seen through noise (§4.6): what is corrupted, how errors are averaged, and that the estimate serves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from relgym.experiments.data import ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.worlds.noise import (
    NoiseOutcome,
    best_sigmas,
    corrupted,
    moving,
    noise_measures,
    noise_outcomes,
    shortfall,
)
from relgym.experiments.worlds.online import learned
from relgym.model.world_model import WorldModel


@pytest.fixture(scope="module")
def episode() -> Episode:
    return next(ball_episodes(1, seed=100, episodes=1))


def _outcome(variance: float, sigma: float | str, seed: int, error: float) -> NoiseOutcome:
    expected = sigma if isinstance(sigma, float) else "auto"
    return NoiseOutcome(variance, expected, seed, {"ball.vy": 0.1}, {"ball.vy": error}, {"ball.vy": 4})


def test_what_changes_from_step_to_step_is_corrupted_and_nothing_else(episode: Episode) -> None:
    columns = moving(episode.schema, episode.layout)
    ball = episode.layout.index("ball")
    assert sorted(columns) == sorted(episode.layout.column(ball, p) for p in ("px", "py", "vx", "vy"))
    seen = corrupted(episode, 1e-4, rng=np.random.default_rng(0))
    off = seen.vectors - episode.vectors
    assert not np.delete(off, columns, axis=1).any()
    assert off[:, columns].std() == pytest.approx(1e-2, rel=0.1)
    assert abs(np.corrcoef(off[:-1, columns[0]], off[1:, columns[0]])[0, 1]) < 0.2
    assert seen.truth is episode.truth


def test_the_noise_is_the_generators(episode: Episode) -> None:
    first, again, other = (corrupted(episode, 1e-4, rng=np.random.default_rng(k)).vectors for k in (1, 1, 2))
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_all_modes_count_the_same_however_rare() -> None:
    # A model that has learned nothing keeps the present value: its error is the change itself.
    episodes = list(ball_episodes(1, seed=100, episodes=4))
    changes = [np.abs(np.diff(b.columns("ball", "vy")[:, 0])) for b in episodes]
    change, mode = np.concatenate(changes), np.concatenate([b.truth.mode["ball.vy"] for b in episodes])
    expected = np.mean([np.median(change[mode == m]) for m in sorted(set(mode.tolist()) - {-1})])
    assert shortfall(WorldModel(episodes[0].schema), episodes, "ball.vy") == pytest.approx(
        expected, abs=1e-15
    )


def test_an_exact_model_falls_short_of_nothing() -> None:
    episodes = list(truck_episodes(seed=100, repeats=1))
    assert shortfall(learned(episodes), episodes, "truck.vx") < 1e-12


def test_the_best_sigma_has_the_least_median_error_over_seeds() -> None:
    errors = {0.1: (1.0, 9.0, 2.0), 0.2: (3.0, 3.0, 3.0)}
    runs = [_outcome(1e-8, s, seed, e) for s, own in errors.items() for seed, e in enumerate(own)]
    runs.append(_outcome(1e-8, "auto", 0, 0.0))
    assert best_sigmas(runs) == {(1e-8, "ball.vy"): 0.1}


def test_the_estimate_is_held_against_the_best_hand_set_value() -> None:
    runs = [_outcome(1e-8, "auto", 0, 3.0), _outcome(1e-8, 0.1, 0, 2.0)]
    runs += [_outcome(1e-8, "auto", 1, 1e-13), _outcome(1e-8, 0.1, 1, 1e-14)]  # as good as exact
    (measure,) = noise_measures(runs, {(1e-8, "ball.vy"): 0.1})
    assert measure.values == (1.5, 0.0) and measure.ok


@pytest.mark.slow
@pytest.mark.parametrize("variance", [1e-15, 1e-8])
def test_the_estimate_finds_the_modes_through_noise(variance: float) -> None:
    (found,) = noise_outcomes(
        training=[101], test=110, sigmas={variance: ["auto"]}, episodes=40, test_episodes=20
    )
    assert dict(found.modes) == {"ball.vx": 3, "ball.vy": 4}
    for target, error in found.errors.items():
        # The best that any model could do: half of all draws are off by more, and the present value is noisy too.
        assert error < 1.5 * 0.6745 * math.sqrt(2.0 * variance)
        assert found.found[target] == pytest.approx(math.sqrt(2.0 * variance), rel=0.5)
