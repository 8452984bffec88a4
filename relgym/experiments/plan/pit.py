"""A walk along a road that ends in a pit, which no episode of learning is long enough to reach."""

from __future__ import annotations

from typing import Any, Final

import gymnasium as gym
import numpy as np

from relgym.experiments.plan.course import played
from relgym.planning import PlanningAgent, TreeSearch

__all__ = ["Pit", "falling", "falls"]

_SEARCH: Final = TreeSearch(horizon=6, expansions=128, batch=64)

_BEGIN: Final = 11.0
"""Six steps lead no farther than 10.03: each step forward pays, and that is all that can be learned."""


class Pit(gym.Env[Any, Any]):
    """One walks by `action` along a road that pays for every step forward, and ends in a pit.

    Observed are the speed and how far the edge is away. Beyond it the episode is over; nothing warns of that.

    Parameters
    ----------
    begin
        How far the edge is away at first.
    steps
        That an episode lasts.
    """

    def __init__(self, begin: float = 6.0, steps: int = 12) -> None:
        self.observation_space = gym.spaces.Box(-100.0, 100.0, (2,), np.float64)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (1,), np.float64)
        self._begin, self._steps = begin, steps

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        """Stand still, somewhere before the edge."""
        super().reset(seed=seed)
        self._seen = np.array([0.0, self._begin + self.np_random.uniform(0.0, 1.0)])
        self._left = self._steps
        return self._seen.copy(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Walk: half the last speed and what is asked for."""
        speed = 0.5 * self._seen[0] + float(np.asarray(action).reshape(-1)[0])
        self._seen = np.array([speed, self._seen[1] - speed])
        self._left -= 1
        fallen = bool(self._seen[1] < 0.0)
        return self._seen.copy(), speed, fallen, self._left <= 0, {"fallen": fallen}


def falls(agent: PlanningAgent, episodes: int, *, begin: float) -> int:
    """In how many episodes, long enough to reach it, an agent falls into the pit."""
    env = Pit(begin=begin, steps=20)
    return sum(bool(played(env, agent.predict, k).info["fallen"]) for k in range(episodes))


def falling(*, seed: int, safe: bool, episodes: int = 100, steps: int = 150) -> dict[str, int]:
    """How often an agent falls that has learned at random where it couldn't.

    Parameters
    ----------
    seed
        Of everything random while learning.
    safe
        As of `PlanningAgent`.
    episodes
        Of the test.
    steps
        Of learning.
    """
    agent = PlanningAgent(
        Pit(begin=_BEGIN, steps=6), search=_SEARCH, random_steps=steps, safe=safe, seed=seed
    ).learn(steps)
    return {"falls": falls(agent, episodes, begin=_BEGIN)}
