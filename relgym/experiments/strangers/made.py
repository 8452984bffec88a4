"""Small worlds of other kinds than a learner of rigid bodies expects, to be measured beside other people's.

Coupled oscillators with noise; a shop that counts what it has; a walk through a maze of whole numbers; and what
textbooks write as a few numbers with a law (`LAWS`): predators and prey, a thermostat, an epidemic, a clock, a lift.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

__all__ = ["LAWS", "MADE", "TEXTBOOK", "Law", "Maze", "Numbers", "Shop"]

MADE: Final = ("relgym-strangers/Oscillators-v0", "relgym-strangers/Shop-v0", "relgym-strangers/Maze-v0")
"""Ids that `gymnasium.make` knows once this module is imported."""

EPISODE: Final = 200
"""Steps of an episode."""


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


# ---------------------------------------------------------------------- a few numbers with a law
Row = Sequence[float]


@dataclass(frozen=True)
class Law:
    """What follows some numbers.

    Attributes
    ----------
    start
        Draws the first ones.
    follows
        Those that follow, from the present ones, the action's and a source of chance.
    acts
        How many numbers an action has, from -1 to 1; below 0: it is one of as many whole numbers.
    most
        Largest of whole numbers, from 0 on; 0: numbers are any.
    """

    start: Callable[[np.random.Generator], Row]
    follows: Callable[[Row, Row, np.random.Generator], Row]
    acts: int = 1
    most: int = 0


class Numbers(gym.Env[NDArray[Any], Any]):
    """A few numbers, which follow a law of `LAWS`."""

    def __init__(self, law: str) -> None:
        self._law = LAWS[law]
        size, most = len(self._law.start(np.random.default_rng(0))), self._law.most
        self.observation_space = (
            spaces.Box(0, most, (size,), np.int64)
            if most
            else spaces.Box(-np.inf, np.inf, (size,), np.float64)
        )
        acts = self._law.acts
        self.action_space: spaces.Space[Any] = (
            spaces.Discrete(-acts) if acts < 0 else spaces.Box(-1.0, 1.0, (acts,), np.float64)
        )

    def _seen(self) -> NDArray[Any]:
        return np.array(self._now, dtype=self.observation_space.dtype)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Begin somewhere."""
        super().reset(seed=seed)
        self._now = self._law.start(self.np_random)
        return self._seen(), {}

    def step(self, action: Any) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Follow the law."""
        self._now = self._law.follows(self._now, np.atleast_1d(action).tolist(), self.np_random)
        return self._seen(), 0.0, False, False, {}


def _oscillators(now: Row, u: Row, rng: np.random.Generator) -> Row:
    """Masses in a row, each tied to the next by a spring; the first is pushed, and all are shaken."""
    x, v = np.split(np.array(now), 2)
    pulled = np.diff(x, prepend=0.0, append=0.0)
    force = pulled[1:] - pulled[:-1]
    force[0] += 2.0 * u[0]
    v = 0.98 * v + 0.1 * force + rng.normal(0.0, 0.02, len(v))
    return [*(x + 0.1 * v), *v]


def _prey(now: Row, u: Row, _: np.random.Generator) -> Row:
    x, y = now
    return x + 0.05 * x * (1.0 - y) + 0.01 * u[0], max(y + 0.05 * y * (x - 1.0), 0.0)


def _thermostat(now: Row, u: Row, _: np.random.Generator) -> Row:
    """Heated from below 19 degrees until above 21."""
    warm, on = now
    on = 1.0 if warm < 19.0 else 0.0 if warm > 21.0 else on
    return warm + 0.3 * on - 0.02 * (warm - 12.0) + 0.05 * u[0], on


def _lorenz(now: Row, u: Row, _: np.random.Generator) -> Row:
    x, y, z = now
    return (
        x + 0.1 * (y - x),
        y + 0.01 * (x * (28.0 - z) - y) + 0.1 * u[0],
        z + 0.01 * (x * y - 8.0 / 3.0 * z),
    )


def _bouncing(now: Row, u: Row, _: np.random.Generator) -> Row:
    v = now[1] - 0.01 + 0.002 * u[0]
    y = now[0] + v
    return (y, v) if y >= 0.0 else (-0.8 * y, -0.8 * v)


def _van_der_pol(now: Row, u: Row, _: np.random.Generator) -> Row:
    x, v = now
    v += 0.05 * ((1.0 - x * x) * v - x) + 0.02 * u[0]
    return x + 0.05 * v, v


def _drag(now: Row, u: Row, _: np.random.Generator) -> Row:
    x, v = now
    v += 0.1 * u[0] - 0.05 * v * abs(v)
    return x + 0.1 * v, v


def _battery(now: Row, u: Row, rng: np.random.Generator) -> Row:
    """Charged and discharged as far as it goes; the price is drawn back to 1."""
    charge, price = now
    return min(max(charge + 0.1 * u[0], 0.0), 1.0), 0.9 * price + 0.1 + 0.05 * rng.normal()


def _epidemic(now: Row, u: Row, _: np.random.Generator) -> Row:
    well, ill, over = now
    caught = 0.3 * (1.0 - 0.5 * abs(u[0])) * well * ill
    return well - caught, ill + caught - 0.1 * ill, over + 0.1 * ill


def _car(now: Row, u: Row, _: np.random.Generator) -> Row:
    """Place, heading as cosine and sine, speed; steered and driven."""
    x, y, cos, sin, v = now
    v = 0.95 * v + 0.1 * u[0]
    turned = math.atan2(sin, cos) + 0.2 * v * u[1]
    cos, sin = math.cos(turned), math.sin(turned)
    return x + v * cos, y + v * sin, cos, sin, v


def _room(now: Row, u: Row, _: np.random.Generator) -> Row:
    """What is pushed about between walls, where it stops."""
    found: list[float] = []
    for place, speed, push in zip(now[:2], now[2:], u, strict=True):
        speed = 0.9 * speed + 0.05 * push
        place += speed
        found += [max(min(place, 1.0), -1.0), 0.0 if abs(place) > 1.0 else speed]
    return found[0], found[2], found[1], found[3]


def _lift(now: Row, u: Row, rng: np.random.Generator) -> Row:
    """Floor, whether the door is open, where somebody waits; up, down, the door, nothing."""
    floor, door, waits = now
    if u[0] < 2 and not door:
        floor = max(min(floor + 1 - 2 * u[0], 9), 0)
    elif u[0] == 2:
        door = 1 - door
    return floor, door, float(rng.integers(0, 10)) if door and floor == waits else waits


def _clock(now: Row, u: Row, _: np.random.Generator) -> Row:
    hours, minutes = now[0], now[1] + (5 if u[0] else 1)
    return ((hours + 1) % 12, minutes - 60) if minutes >= 60 else (hours, minutes)


def _door(now: Row, u: Row, _: np.random.Generator) -> Row:
    """A grid with a wall, and a door in it that a key opens."""
    x, y, key, is_open = now
    dx, dy = ((1, 0), (-1, 0), (0, 1), (0, -1))[int(u[0])]
    to, up = max(min(x + dx, 7), 0), max(min(y + dy, 5), 0)
    if to == 4:
        if up == 2 and (key or is_open):
            is_open = 1
        else:
            to = x
    return to, up, float(key or (to, up) == (1, 4)), is_open


def _uniform(low: Row, high: Row, rng: np.random.Generator) -> Row:
    drawn: list[float] = rng.uniform(low, high).tolist()
    return drawn


def _near_rest(rng: np.random.Generator) -> Row:
    drawn: list[float] = rng.normal(0.0, 0.5, 8).tolist()
    return drawn


def _heading(rng: np.random.Generator) -> Row:
    angle = rng.uniform(-3.0, 3.0)
    return 0.0, 0.0, math.cos(angle), math.sin(angle), 0.0


def _ill(rng: np.random.Generator) -> Row:
    ill = rng.uniform(0.01, 0.1)
    return 1.0 - ill, ill, 0.0


def _whole(high: Sequence[int], rng: np.random.Generator) -> Row:
    drawn: list[float] = rng.integers(0, high).tolist()
    return drawn


LAWS: Final[Mapping[str, Law]] = {
    "Oscillators": Law(_near_rest, _oscillators),
    "Prey": Law(partial(_uniform, (0.5, 0.5), (1.5, 1.5)), _prey),
    "Thermostat": Law(partial(_uniform, (15.0, 0.0), (25.0, 0.0)), _thermostat),
    "Lorenz": Law(partial(_uniform, (-9.0, -9.0, 16.0), (9.0, 9.0, 34.0)), _lorenz),
    "Bouncing": Law(partial(_uniform, (1.0, 0.0), (3.0, 0.0)), _bouncing),
    "VanDerPol": Law(partial(_uniform, (-2.0, -2.0), (2.0, 2.0)), _van_der_pol),
    "Drag": Law(partial(_uniform, (0.0, -2.0), (0.0, 2.0)), _drag),
    "Battery": Law(partial(_uniform, (0.5, 1.0), (0.5, 1.0)), _battery),
    "Epidemic": Law(_ill, _epidemic),
    "Car": Law(_heading, _car, acts=2),
    "Room": Law(partial(_uniform, (-1.0, -1.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0)), _room, acts=2),
    "Lift": Law(partial(_whole, (10, 1, 10)), _lift, acts=-4, most=9),
    "Clock": Law(partial(_whole, (12, 60)), _clock, acts=-2, most=60),
    "Door": Law(partial(_whole, (4, 6, 1, 1)), _door, acts=-4, most=7),
}
"""Laws by name."""

TEXTBOOK: Final = tuple(f"relgym-strangers/{name}-v0" for name in LAWS if name != "Oscillators")
"""Ids of `Numbers` that follow each of them, but for the oscillators, which are among those made first."""

for _name in ("Shop", "Maze"):
    gym.register(f"relgym-strangers/{_name}-v0", f"{__name__}:{_name}", max_episode_steps=EPISODE)
for _name in LAWS:
    _id = f"relgym-strangers/{_name}-v0"
    gym.register(_id, f"{__name__}:Numbers", kwargs={"law": _name}, max_episode_steps=EPISODE)
