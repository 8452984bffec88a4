"""One decision, several steps: a wrapper that repeats every action."""

from __future__ import annotations

from typing import Any, SupportsFloat

import gymnasium as gym
from gymnasium.utils import RecordConstructorArgs

from relgym.arguments import refusing
from relgym.envs.arguments import checked_count, refuse_vector_env
from relgym.errors import ConfigError

__all__ = ["ActionRepeat"]


class ActionRepeat(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Repeats every action: the agent decides once in `repeat` steps of the env.

    Goes round the real env and round its dream alike. The dynamics stay those of single steps, which are piecewise
    linear where those of several steps are not; so a `ModelLearner` belongs inside.

    Parameters
    ----------
    env
        Any env.
    repeat
        How often each action is taken, >= 1. The episode's end cuts a decision short.

    Notes
    -----
    The reward is the sum of the steps' rewards; observation, flags and info are those of the last step, and
    ``info["steps"]`` says how many there were.
    """

    @refusing(ConfigError)
    def __init__(self, env: gym.Env[Any, Any], repeat: int) -> None:
        refuse_vector_env(env)
        self.repeat = checked_count("repeat", repeat, 1, 10**6)
        RecordConstructorArgs.__init__(self, repeat=self.repeat)
        gym.Wrapper.__init__(self, env)

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Take the action `repeat` times, or until the episode ends."""
        total, steps, over = 0.0, 0, False
        while steps < self.repeat and not over:
            observation, reward, terminated, truncated, info = self.env.step(action)
            total, steps, over = total + float(reward), steps + 1, bool(terminated or truncated)
        return observation, total, terminated, truncated, {**info, "steps": steps}
