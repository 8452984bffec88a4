"""Envs of several agents that act at once (PettingZoo's `ParallelEnv`) as one Gymnasium env."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, SupportsFloat

import gymnasium as gym
from gymnasium import spaces

from relgym.errors import ActionError, ConfigError

__all__ = ["AgentsEnv", "AgentsSpace"]


class AgentsSpace(spaces.Dict):
    """A Dict with a part for each agent, whose elements may lack agents: those that aren't there (any more).

    Examples
    --------
    >>> space = AgentsSpace({"runner_0": spaces.Discrete(2), "runner_1": spaces.Discrete(2)})
    >>> space.contains({"runner_1": 0}), space.contains({"walker": 0})
    (True, False)
    """

    def contains(self, x: Any) -> bool:
        """Whether every part is one of an agent's; agents may be missing."""
        return isinstance(x, Mapping) and all(
            name in self.spaces and self.spaces[name].contains(part) for name, part in x.items()
        )


class AgentsEnv(gym.Env[Any, Any]):
    """A PettingZoo `ParallelEnv` as a Gymnasium env; needs the extra `pettingzoo` for the env, and nothing here.

    Observations and actions are dicts by agent, without those that aren't there. `ModelLearner` sees agents as
    objects (`relgym.envs.views.AgentsView`).

    Parameters
    ----------
    env
        The env. Of an AEC env, in which agents take turns, `pettingzoo.utils.aec_to_parallel` makes one where it can.

    Attributes
    ----------
    agents_env
        The env inside.

    Raises
    ------
    ConfigError
        No such env, or one that doesn't know which agents there may be.

    Notes
    -----
    The reward is the sum of all agents'. An episode ends when no agent is left: truncated if one of the last agents
    was cut off, else terminated. What PettingZoo says of each agent is in info: ``rewards``, ``terminations``,
    ``truncations`` and ``agents``, the agents' infos.
    """

    def __init__(self, env: Any) -> None:
        agents = getattr(env, "possible_agents", None)
        if not agents or not callable(getattr(env, "observation_space", None)) or hasattr(env, "agent_iter"):
            raise ConfigError(
                f"expected a PettingZoo ParallelEnv with possible_agents, got {type(env).__name__}; "
                "pettingzoo.utils.aec_to_parallel(env) makes one of an AEC env"
            )
        if wrong := [agent for agent in agents if not isinstance(agent, str)]:
            raise ConfigError(f"expected agents with names, such as 'runner_0', got {wrong}")
        self.agents_env = env
        self.metadata = dict(getattr(env, "metadata", {}))
        self.render_mode = getattr(env, "render_mode", None)
        self.observation_space = AgentsSpace({a: env.observation_space(a) for a in agents})
        self.action_space = AgentsSpace({a: env.action_space(a) for a in agents})

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode."""
        super().reset(seed=seed)
        observations, infos = self.agents_env.reset(seed=seed, options=options)
        return dict(observations), {"agents": dict(infos)}

    def step(self, action: Any) -> tuple[dict[str, Any], SupportsFloat, bool, bool, dict[str, Any]]:
        """Let all agents act; what is said of agents that aren't there is left out.

        Raises
        ------
        ActionError
            An agent that is there is told nothing.
        """
        live = list(self.agents_env.agents)
        missing = [agent for agent in live if agent not in action] if isinstance(action, Mapping) else live
        if missing:
            raise ActionError(f"expected an action for each of {live}, got {action!r}, without {missing}")
        seen, rewards, ended, cut, infos = self.agents_env.step({agent: action[agent] for agent in live})
        over = not self.agents_env.agents
        truncated = over and any(bool(flag) for flag in cut.values())
        info = {
            "agents": dict(infos),
            "rewards": dict(rewards),
            "terminations": dict(ended),
            "truncations": dict(cut),
        }
        total = float(sum(float(reward) for reward in rewards.values()))
        return dict(seen), total, over and not truncated, truncated, info

    def render(self) -> Any:
        """The picture of the env inside."""
        return self.agents_env.render()

    def close(self) -> None:
        """Close the env inside."""
        self.agents_env.close()
