"""A walk along a road with a pit in it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np


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
