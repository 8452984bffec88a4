from __future__ import annotations

import numpy as np
import pytest

from relgym.experiments.speed.steps import step_times, trial


def test_every_step_is_timed_without_the_env() -> None:
    learner, env = step_times("CartPole-v1", 30, seed=1)
    assert learner.shape == (30,)
    assert (learner > 0.0).all() and env > 0.0
    told = trial(world="CartPole-v1", steps=30, seed=1)
    assert told["longest"] >= told["p99"] >= told["late"] > 0.0 and told["env"] > 0.0


@pytest.mark.slow
def test_no_step_of_an_arm_stalls() -> None:
    pytest.importorskip("mujoco")
    learner, _ = step_times("Reacher-v5", 300)
    # Searches of seconds are spread over steps; the bound is loose, since machines are loaded.
    assert np.percentile(learner, 99) < 40 * max(1.0, np.median(learner))
    assert learner.max() < 1_000.0
