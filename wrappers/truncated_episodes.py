"""Most episodes are truncated early: an agent that can imagine the rest learns more from other beginnings."""

from __future__ import annotations

from typing import Any, SupportsFloat

import gymnasium as gym
from gymnasium.utils import RecordConstructorArgs

from relgym.arguments import refusing
from relgym.envs.arguments import checked_count, refuse_vector_env
from relgym.errors import ConfigError

__all__ = ["TruncatedEpisodes"]


class TruncatedEpisodes(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Truncates most episodes after a few steps; every `whole`-th one lasts as long as it will.

    A model can imagine how an episode goes on, but not other beginnings (other rooms, other objects). So for an agent
    that trains in a model, real steps are better spent on many short episodes. Some stay whole, since rewards and ends
    that were never seen can't be learned.

    Parameters
    ----------
    env
        Any env. Inside an `ActionRepeat` steps are the env's own, not decisions.
    steps
        Steps after which an episode counts as truncated, >= 1.
    whole
        One of so many episodes isn't cut short, the first to begin with; >= 1, and with 1 none is.

    Notes
    -----
    An episode counts from its reset on. Don't use this where resets are expensive.
    """

    @refusing(ConfigError)
    def __init__(self, env: gym.Env[Any, Any], steps: int, whole: int = 5) -> None:
        refuse_vector_env(env)
        self.steps = checked_count("steps", steps, 1, 10**9)
        self.whole = checked_count("whole", whole, 1, 10**9)
        self._episode, self._taken = -1, 0
        RecordConstructorArgs.__init__(self, steps=self.steps, whole=self.whole)
        gym.Wrapper.__init__(self, env)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        begun = self.env.reset(seed=seed, options=options)
        self._episode, self._taken = self._episode + 1, 0
        return begun

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Take a step; of a truncated episode, the last one says that it is truncated."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._taken += 1
        late = bool(self._episode % self.whole) and self._taken >= self.steps
        return observation, reward, terminated, truncated or (late and not terminated), info
