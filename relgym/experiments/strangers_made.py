"""Small worlds of other kinds than a learner of rigid bodies expects, to be measured beside other people's.

Coupled oscillators with noise; a shop that counts what it has; a walk through a maze of whole numbers.
"""

from __future__ import annotations

from typing import Any, Final

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

__all__ = ["MADE", "Maze", "Oscillators", "Shop"]

MADE: Final = ("relgym-strangers/Oscillators-v0", "relgym-strangers/Shop-v0", "relgym-strangers/Maze-v0")
"""Ids that `gymnasium.make` knows once this module is imported."""


class Oscillators(gym.Env[NDArray[np.float64], NDArray[np.float64]]):
    """Masses in a row, each tied to the next by a spring; the first is pushed, and all are shaken."""

    def __init__(self, count: int = 4, noise: float = 0.02) -> None:
        self.observation_space = spaces.Box(-np.inf, np.inf, (2 * count,), np.float64)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float64)
        self._count, self._noise = count, noise
        self._x = self._v = np.zeros(count)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Begin somewhere near rest."""
        super().reset(seed=seed)
        self._x, self._v = self.np_random.normal(0.0, 0.5, (2, self._count))
        return np.concatenate([self._x, self._v]), {}

    def step(
        self, action: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Springs pull, the first mass is pushed, and all are shaken."""
        pulled = np.diff(self._x, prepend=0.0, append=0.0)
        force = pulled[1:] - pulled[:-1]
        force[0] += 2.0 * float(action[0])
        self._v = 0.98 * self._v + 0.1 * force + self.np_random.normal(0.0, self._noise, self._count)
        self._x = self._x + 0.1 * self._v
        return np.concatenate([self._x, self._v]), 0.0, False, False, {}


class Shop(gym.Env[dict[str, NDArray[Any]], NDArray[np.int64]]):
    """Goods are ordered, come a day later, and are sold as long as there are any; prices drift."""

    def __init__(self, goods: int = 3) -> None:
        self.observation_space: spaces.Space[Any] = spaces.Dict(
            {
                "stock": spaces.Box(0, 50, (goods,), np.int64),
                "coming": spaces.Box(0, 5, (goods,), np.int64),
                "price": spaces.Box(0.0, np.inf, (goods,), np.float64),
            }
        )
        self.action_space = spaces.MultiDiscrete([6] * goods)
        self._goods = goods

    def _seen(self) -> dict[str, NDArray[Any]]:
        return {"stock": self._stock.copy(), "coming": self._coming.copy(), "price": self._price.copy()}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Begin with something of everything."""
        super().reset(seed=seed)
        self._stock = self.np_random.integers(5, 15, self._goods)
        self._coming = np.zeros(self._goods, dtype=np.int64)
        self._price = self.np_random.uniform(1.0, 5.0, self._goods)
        self._day = 0
        return self._seen(), {}

    def step(
        self, action: NDArray[np.int64]
    ) -> tuple[dict[str, NDArray[Any]], float, bool, bool, dict[str, Any]]:
        """A day: what was ordered comes, some of all is sold."""
        sold = np.minimum(self.np_random.poisson(2.5, self._goods), self._stock)
        self._stock = np.minimum(self._stock - sold + self._coming, 50)
        self._coming = np.asarray(action, dtype=np.int64)
        self._price = self._price * (1.0 + self.np_random.normal(0.0, 0.02, self._goods))
        self._day += 1
        return self._seen(), float((sold * self._price).sum()), False, self._day >= 200, {}


class Maze(gym.Env[NDArray[np.int64], np.int64]):
    """A walk on a grid with walls, where one who runs into a wall stays; beside it a counter of the steps left."""

    def __init__(self, size: int = 8) -> None:
        self.observation_space = spaces.MultiDiscrete([size, size, 60])
        self.action_space = spaces.Discrete(4)
        self._size = size
        self._walls = (
            {(2, y) for y in range(5)} | {(5, y) for y in range(3, size)} | {(x, 6) for x in range(3)}
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.int64], dict[str, Any]]:
        """Begin anywhere but in a wall."""
        super().reset(seed=seed)
        free = [(x, y) for x in range(self._size) for y in range(self._size) if (x, y) not in self._walls]
        self._at, self._left = free[int(self.np_random.integers(len(free)))], 59
        return np.array([*self._at, self._left]), {}

    def step(self, action: np.int64) -> tuple[NDArray[np.int64], float, bool, bool, dict[str, Any]]:
        """One cell to a side, unless there is a wall."""
        dx, dy = ((1, 0), (0, 1), (-1, 0), (0, -1))[int(action)]
        x, y = self._at[0] + dx, self._at[1] + dy
        if 0 <= x < self._size and 0 <= y < self._size and (x, y) not in self._walls:
            self._at = x, y
        self._left -= 1
        return np.array([*self._at, self._left]), 0.0, False, self._left == 0, {}


for _id, _name in zip(MADE, ("Oscillators", "Shop", "Maze"), strict=True):
    gym.register(_id, f"{__name__}:{_name}", max_episode_steps=200)
