"""A small env of several agents in PettingZoo's manner, whose laws are known."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces


class Runners:
    """Runners on a line, and a door: a runner's v' = 0.5 v + a, x' = x + v'; it leaves the race beyond `goal`.

    A runner sees (x, v) and runs with its own action; the door sees how far it is open, h' = h + 0.1 a. Quacks like
    `pettingzoo.ParallelEnv`, without importing it.
    """

    def __init__(self, count: int = 3, goal: float = 20.0, length: int = 25) -> None:
        self.possible_agents = [*(f"runner_{k}" for k in range(count)), "door"]
        self.agents: list[str] = []
        self.metadata = {"name": "runners_v0", "render_fps": 10}
        self.goal, self.length = goal, length
        self.state: dict[str, Any] = {}
        self.closed = False

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        return spaces.Box(-1000.0, 1000.0, (1 if agent == "door" else 2,), np.float64)

    def action_space(self, agent: str) -> spaces.Space[Any]:
        return spaces.Discrete(2) if agent == "door" else spaces.Box(-1.0, 1.0, (1,), np.float64)

    def reset(self, seed: int | None = None, options: Any = None) -> tuple[dict[str, Any], dict[str, Any]]:
        if seed is not None or not hasattr(self, "rng"):
            self.rng = np.random.default_rng(seed)
        self.agents = list(self.possible_agents)
        self.steps = 0
        self.state = {a: self.rng.uniform(-2.0, 2.0, self.observation_space(a).shape) for a in self.agents}
        return self.seen(self.agents), {a: {} for a in self.agents}

    def seen(self, agents: list[str]) -> dict[str, Any]:
        return {a: self.state[a].copy() for a in agents}

    def step(self, actions: dict[str, Any]) -> tuple[dict[str, Any], ...]:
        assert list(actions) == self.agents
        acted, self.steps = self.agents, self.steps + 1
        for agent, action in actions.items():
            if agent == "door":
                self.state[agent] += 0.1 * int(action)
                continue
            x, v = self.state[agent]
            v = 0.5 * v + float(action[0])
            self.state[agent] = np.array([x + v, v])
        home = {a: a != "door" and abs(float(self.state[a][0])) > self.goal for a in acted}
        cut = dict.fromkeys(acted, self.steps >= self.length)
        self.agents = [a for a in acted if not home[a] and not cut[a]]
        rewards = {a: 1.0 if home[a] else 0.0 for a in acted}
        return self.seen(acted), rewards, home, cut, {a: {} for a in acted}

    def render(self) -> str:
        return "runners"

    def close(self) -> None:
        self.closed = True
