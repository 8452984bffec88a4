from __future__ import annotations

import numpy as np
import pytest

from relgym.experiments.speed.steps import step_times


def test_every_step_is_timed_without_the_env() -> None:
    found = step_times("CartPole-v1", 30, seed=1)
    assert found.learner.shape == (30,)
    assert (found.learner > 0.0).all() and found.env > 0.0
    told = found.summary()
    assert told["longest"] == found.learner.max() >= told["p99"] >= told["late"] > 0.0


@pytest.mark.slow
def test_no_step_of_an_arm_stalls() -> None:
    pytest.importorskip("mujoco")
    found = step_times("Reacher-v5", 300)
    # Searches of seconds are spread over steps; the bound is loose, since machines are loaded.
    assert np.percentile(found.learner, 99) < 40 * max(1.0, np.median(found.learner))
    assert found.learner.max() < 1_000.0
