"""Noise tolerance: the expected noise swept against the true one (§4.6, Figure 4.18)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from relgym.config import ModelConfig
from relgym.experiments.chapter4.learners import modes_of, settings_of, taught
from relgym.experiments.chapter4.lesson import fresh_episodes, taught_episodes
from relgym.experiments.worlds.noise import corrupted, shortfall
from relgym.thesis.settings import ThesisSettings

__all__ = ["lesson"]


def lesson(
    *,
    expected: float | str,
    true: float,
    seed: int,
    order: int,
    episodes: int,
    tests: Mapping[str, Any],
) -> dict[str, Any]:
    """Train and test on experiment 1 through noise.

    Parameters
    ----------
    expected
        Variance that the thesis' program expects, in squared units: chapter IV's experiments are the program's;
        ``"auto"``: modes of ours along the world's axes, which estimate it; ``"default"``: relgym as it comes.
    true
        Variance of the noise.
    seed, order, episodes, tests
        As of `relgym.experiments.chapter4.lesson.lesson`.

    Returns
    -------
    Plain data: by target the mode-averaged median error, and the number of modes.
    """
    rng = np.random.default_rng([seed, order])
    shown = [corrupted(b, true, rng=rng) for b in taught_episodes(1, seed, order, episodes)]
    model = taught(shown, _settings(expected))
    fresh = [corrupted(b, true, rng=rng) for b in fresh_episodes(1, tests)]
    return {
        "errors": {str(t): shortfall(model, fresh, str(t)) for t in model.targets},
        "modes": {str(t): len(modes_of(model, str(t))) for t in model.targets},
    }


def _settings(expected: float | str) -> ThesisSettings | ModelConfig:
    if isinstance(expected, str):
        return settings_of({"auto": "world"}.get(expected, expected))
    return ThesisSettings.original(noise_variance=expected)
