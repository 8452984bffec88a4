"""Envs without scenes, whose laws are known: what views are tried on."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces


class Slider(gym.Env[Any, Any]):
    """A box pushed left or right: v' = 0.8 v + 0.5 a, x' = x + v'; reward is -x', and it ends beyond `limit`.

    Observes (x, v) as float64; an episode is truncated after `length` steps. `says`, where it is set, replaces the
    next observation.
    """

    def __init__(self, length: int = 1000, limit: float = 1e6) -> None:
        self.observation_space: spaces.Space[Any] = spaces.Box(-100.0, 100.0, (2,), np.float64)
        self.action_space: spaces.Space[Any] = spaces.Box(-1.0, 1.0, (1,), np.float64)
        self.length, self.limit = length, limit
        self.x = self.v = 0.0
        self.steps = 0
        self.says: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.x, self.v = (float(n) for n in self.np_random.uniform(-3.0, 3.0, 2))
        self.steps = 0
        return self._seen(), {"limit": self.limit}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.v = 0.8 * self.v + 0.5 * float(action[0])
        self.x += self.v
        self.steps += 1
        ended = abs(self.x) > self.limit
        return self._seen(), -self.x, ended, self.steps >= self.length, {"limit": self.limit}

    def _seen(self) -> Any:
        return np.array([self.x, self.v]) if self.says is None else self.says


class Wheel(gym.Env[Any, Any]):
    """A wheel that turns by u + 0.7 at each step; observes (cos, sin) of its angle as float32."""

    def __init__(self, bound: float = 1.0) -> None:
        self.observation_space = spaces.Box(-bound, bound, (2,), np.float32)
        self.action_space = spaces.Box(-0.5, 0.5, (1,), np.float32)
        self.angle = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.angle = float(self.np_random.uniform(-3.0, 3.0))
        return self._seen(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.angle += float(action[0]) + 0.7
        return self._seen(), 0.0, False, False, {}

    def _seen(self) -> Any:
        return np.array([math.cos(self.angle), math.sin(self.angle)], np.float32)


class Birds(gym.Env[Any, Any]):
    """Up to three birds on a line, x' = x + 0.25 d, d constant; rows (here, x, d) sorted anew, nearest to 0 first.

    A bird beyond 6 leaves; with `arrivals` another one comes in its place, from the left.
    """

    def __init__(self, arrivals: bool = False) -> None:
        self.observation_space = spaces.Box(-10.0, 10.0, (3, 3), np.float64)
        self.action_space = spaces.Discrete(1)
        self.arrivals = arrivals
        self.birds: list[list[float]] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        draws = self.np_random.uniform(0.2, 0.9, 3)
        self.birds = [[-4.0, float(draws[0])], [0.0, -float(draws[1])], [4.0, float(draws[2])]]
        return self._seen(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        flown = [[x + 0.25 * d, d] for x, d in self.birds]
        self.birds = [bird for bird in flown if abs(bird[0]) <= 6.0]
        if self.arrivals and len(self.birds) < 3:
            self.birds.append([-6.0, float(self.np_random.uniform(0.2, 0.9))])
        return self._seen(), 0.0, False, False, {}

    def _seen(self) -> Any:
        table = np.zeros((3, 3))
        for row, (x, d) in enumerate(sorted(self.birds, key=lambda bird: abs(bird[0]))):
            table[row] = 1.0, x, d
        return table


class Drifter(gym.Env[Any, Any]):
    """A point in the square [-1, 1]² that each action moves along the first axis; observes it as float32.

    It starts on the unit circle, where `start` says, so that its place could be cosine and sine of an angle. `says`,
    where it is set, replaces the next observation; `reward` is what every step pays.
    """

    def __init__(
        self, start: tuple[float, float] = (-1.0, 0.0), *, length: int = 1000, bound: float = 1.0
    ) -> None:
        self.observation_space: spaces.Space[Any] = spaces.Box(-bound, bound, (2,), np.float32)
        self.action_space: spaces.Space[Any] = spaces.Box(0.0, 0.05, (1,), np.float64)
        self.start, self.length = start, length
        self.place = np.zeros(2)
        self.steps = 0
        self.says: Any = None
        self.reward: Any = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.place, self.steps = np.array(self.start), 0
        return self._seen(), {}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        self.place[0] = 0.9 * self.place[0] + float(action[0])
        self.steps += 1
        return self._seen(), self.reward, False, self.steps >= self.length, {}

    def _seen(self) -> Any:
        return self.place.astype(np.float32) if self.says is None else self.says


class Visited(gym.Env[Any, Any]):
    """A box pushed along a line, and in every second episode a visitor that stands there; the reward is -x'.

    Observes a table: here or not, and the place, as the `dtype` has it.
    """

    def __init__(self, dtype: Any = np.float64) -> None:
        self.observation_space = spaces.Box(-100, 100, (2, 2), dtype)
        self.action_space = spaces.Discrete(3, start=-1)
        self.dtype = dtype
        self.x, self.visits = 0, 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.x, self.visits = int(self.np_random.integers(-9, 9)), self.visits + 1
        return self._seen(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.x += 3 * int(action)
        return self._seen(), -float(self.x), False, False, {}

    def _seen(self) -> Any:
        visitor = [1, 50] if self.visits % 2 else [0, 0]
        return np.array([[1, self.x], visitor]).astype(self.dtype)


class Crates(gym.Env[Any, Any]):
    """Two balls of width 1, each lying on a floor, where it is slowed down, or hanging in the air; no gravity.

    Observes (x, y, vx) of both as the `dtype` has it: lying at 0.6 is a hair above the floor for float32.
    """

    def __init__(self, dtype: Any) -> None:
        self.observation_space = spaces.Box(-100.0, 100.0, (2, 3), dtype)
        self.action_space = spaces.Discrete(1)
        self.table = np.zeros((2, 3))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        draw = self.np_random
        lying = draw.random(2) < 0.5
        y = np.where(lying, 0.6, draw.uniform(2.0, 5.0, 2))
        self.table = np.column_stack([draw.uniform(-8.0, 8.0, 2), y, draw.uniform(-0.5, 0.5, 2)])
        return self._seen(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.table[:, 2] *= np.where(self.table[:, 1] < 0.7, 0.9, 1.0)
        self.table[:, 0] += self.table[:, 2]
        return self._seen(), 0.0, False, False, {}

    def _seen(self) -> Any:
        return self.table.astype(self.observation_space.dtype)
