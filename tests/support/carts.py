"""The smallest world: a cart without a body, pushed; and what tests do with it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema

CART = ObjectType("cart", ("v",))
ENGINE = ObjectType("action", ("push",))
SCHEMA = SceneSchema(
    (CART, ENGINE), (("cart", "cart"), ("action", "action")), action_scale=(("push", 0.0, 10.0),)
)


class CartEnv(gym.Env[Any, Any]):
    """v' = 0.9 v + 0.1 push, with pushes from 0 to 10; the episode ends after `length` steps.

    `says`, where it is set, replaces the next observation.
    """

    def __init__(self, length: int = 1000, limit: float = 1e3) -> None:
        self.schema = SCHEMA
        self.observation_space = spaces.Dict({"cart": spaces.Box(-limit, limit, (1,), np.float64)})
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.length = length
        self.v = 0.0
        self.steps = 0
        self.resets = 0
        self.says: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.v = float((options or {}).get("v", self.np_random.uniform(-50, 50)))
        self.steps = 0
        self.resets += 1
        return self._observation(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        push = 5.0 * (float(action[0]) + 1.0)
        self.v = 0.9 * self.v + 0.1 * push
        self.steps += 1
        return self._observation(), 1.0, False, self.steps >= self.length, {"push": push}

    def _observation(self) -> Any:
        return {"cart": np.array([self.v])} if self.says is None else self.says


def run(env: gym.Env[Any, Any], steps: int, *, seed: int = 0, length: int = 25) -> list[Any]:
    """Random actions, a new episode every `length` steps; all that the env returned but its infos."""
    seen: list[Any] = []
    env.action_space.seed(seed)
    for k in range(steps):
        if k % length == 0:
            seen.append(env.reset(seed=seed + k)[0])
        observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        seen.append((observation, reward, terminated, truncated))
    return seen
