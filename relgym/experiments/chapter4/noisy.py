"""Noise tolerance: the expected noise swept against the true one (§4.6, Figure 4.18)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from relgym.config import ModelConfig
from relgym.experiments.chapter4.lesson import config_of, fresh_episodes, taught_episodes
from relgym.experiments.noise import corrupted, shortfall
from relgym.experiments.online import learned

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
        Variance that the learner of chapter III expects, in squared units; ``"auto"``: the same learner of ours, which
        estimates it; ``"default"``: relgym as it comes.
    true
        Variance of the noise.
    seed, order, episodes, tests
        As of `relgym.experiments.chapter4.lesson.lesson`.

    Returns
    -------
    Plain data: by target the mode-averaged median error, and the number of modes.
    """
    rng = np.random.default_rng([seed, order])
    taught = [corrupted(b, true, rng=rng) for b in taught_episodes(1, seed, order, episodes)]
    model = learned(taught, config=_config(expected))
    fresh = [corrupted(b, true, rng=rng) for b in fresh_episodes(1, tests)]
    return {
        "errors": {str(t): shortfall(model, fresh, str(t)) for t in model.targets},
        "modes": {str(t): len(model.modes(t.type, t.property)) for t in model.targets},
    }


def _config(expected: float | str) -> ModelConfig:
    if isinstance(expected, str):
        return config_of({"auto": "world"}.get(expected, expected))
    config = config_of("thesis")
    return replace(config, clustering=replace(config.clustering, noise_std=expected**0.5))
