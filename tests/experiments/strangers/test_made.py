"""Small worlds by the book: what follows is what their laws say."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from relgym.experiments.strangers.made import LAWS, MADE, TEXTBOOK

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("env_id", [*MADE, *TEXTBOOK])
def test_they_are_envs(env_id: str) -> None:
    env = gym.make(env_id)
    runs = []
    for _ in range(2):
        env.action_space.seed(1)
        seen = [env.reset(seed=1)[0]]
        for k in range(1, 201):
            observation, *_, cut, _ = env.step(env.action_space.sample())
            assert env.observation_space.contains(observation)
            seen.append(observation)
            if cut:
                assert k <= 200
                break
        runs.append(seen)
    np.testing.assert_equal(runs[0], runs[1])


@pytest.mark.parametrize(
    ("law", "now", "action", "then"),
    [
        ("Prey", (1.0, 1.0), (0.5,), (1.005, 1.0)),
        ("Thermostat", (18.0, 0.0), (0.0,), (18.18, 1.0)),
        ("Thermostat", (20.0, 1.0), (1.0,), (20.19, 1.0)),
        ("Lorenz", (1.0, 2.0, 28.0), (0.0,), (1.1, 1.98, 28.0 + 0.02 - 0.01 * 28.0 * 8.0 / 3.0)),
        ("Bouncing", (1.0, 0.0), (0.0,), (0.99, -0.01)),
        ("Bouncing", (0.05, -0.09), (0.0,), (0.04, 0.08)),
        ("VanDerPol", (2.0, 1.0), (0.0,), (2.0375, 0.75)),
        ("Drag", (0.0, -2.0), (1.0,), (-0.17, -1.7)),
        ("Epidemic", (0.5, 0.5, 0.0), (-1.0,), (0.4625, 0.4875, 0.05)),
        ("Car", (0.0, 0.0, 1.0, 0.0, 1.0), (0.5, 0.0), (1.0, 0.0, 1.0, 0.0, 1.0)),
        ("Room", (0.9, -1.0, 0.5, 0.0), (0.0, 1.0), (1.0, -0.95, 0.0, 0.05)),
        ("Lift", (9, 0, 3), (0,), (9, 0, 3)),
        ("Lift", (4, 1, 3), (1,), (4, 1, 3)),
        ("Clock", (11, 58), (1,), (0, 3)),
        ("Door", (3, 2, 0, 0), (0,), (3, 2, 0, 0)),
        ("Door", (3, 2, 1, 0), (0,), (4, 2, 1, 1)),
        ("Door", (1, 3, 0, 0), (2,), (1, 4, 1, 0)),
    ],
)
def test_a_step_by_hand(
    law: str, now: tuple[float, ...], action: tuple[float, ...], then: tuple[float, ...]
) -> None:
    np.testing.assert_allclose(LAWS[law].follows(now, action, RNG), then, atol=1e-12)


def test_a_battery_is_neither_empty_nor_overfull() -> None:
    charge = [LAWS["Battery"].follows((c, 1.0), (u,), RNG)[0] for c, u in ((0.95, 1.0), (0.05, -1.0))]
    assert charge == [1.0, 0.0]
