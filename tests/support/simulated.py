"""Small worlds for planners, whose best plans are known."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.planning import Steps

__all__ = ["Corridor", "Line", "Table"]


@dataclass
class Line:
    """A point on a line: ``x' = x + a``; the aim is 3, and nobody knows what lies below -2.

    The reward is minus the distance to 3, and an episode ends within 0.05 of it.
    """

    action_space: spaces.Space[Any] = field(default_factory=lambda: spaces.Box(-1.0, 1.0, (1,), np.float32))
    observation_space: spaces.Space[Any] = field(
        default_factory=lambda: spaces.Box(-10.0, 10.0, (1,), np.float64)
    )
    calls: int = 0

    def state(self, observation: Any) -> NDArray[np.float64]:
        return np.asarray(observation, dtype=np.float64)

    def prepare(self) -> None:
        self.calls += 1

    def step(self, states: NDArray[np.float64], actions: NDArray[Any]) -> Steps:
        after = states + np.asarray(actions, dtype=np.float64).reshape(len(states), -1)
        known = after[:, 0] >= -2.0
        off = np.abs(after[:, 0] - 3.0)
        return Steps(
            np.where(known[:, None], after, states), np.where(known, -off, 0.0), known & (off < 0.05), known
        )


@dataclass
class Table:
    """Five states, three actions: where each leads (-1: nobody knows), what it pays, whether it ends the episode."""

    leads: NDArray[np.int64]
    pays: NDArray[np.float64]
    ends: NDArray[np.bool_]
    action_space: spaces.Space[Any] = field(default_factory=lambda: spaces.Discrete(3))
    observation_space: spaces.Space[Any] = field(
        default_factory=lambda: spaces.Box(0.0, 4.0, (1,), np.float64)
    )

    def state(self, observation: Any) -> NDArray[np.float64]:
        return np.asarray(observation, dtype=np.float64)

    def prepare(self) -> None:
        pass

    def step(self, states: NDArray[np.float64], actions: NDArray[Any]) -> Steps:
        at = states[:, 0].astype(np.int64), np.asarray(actions, dtype=np.int64).reshape(-1)
        known = self.leads[at] >= 0
        after = np.where(known, self.leads[at], states[:, 0])[:, None].astype(np.float64)
        return Steps(after, np.where(known, self.pays[at], 0.0), self.ends[at] & known, known)


@dataclass
class Corridor:
    """A point in the plane before a trap that is open to the left: the way to (3, 0) leads round it.

    Moves of at most 0.5 along each axis; the trap's walls are x = 1 for |y| <= 1 and y = +-1 for 0 <= x <= 1. Progress
    is paid, and 10 for the goal, which ends the episode.
    """

    action_space: spaces.Space[Any] = field(default_factory=lambda: spaces.Box(-0.5, 0.5, (2,), np.float64))
    observation_space: spaces.Space[Any] = field(
        default_factory=lambda: spaces.Box(-10.0, 10.0, (2,), np.float64)
    )

    def state(self, observation: Any) -> NDArray[np.float64]:
        return np.asarray(observation, dtype=np.float64)

    def prepare(self) -> None:
        pass

    def step(self, states: NDArray[np.float64], actions: NDArray[Any]) -> Steps:
        after = states + actions
        blocked = _crosses(states, after)
        after = np.where(blocked[:, None], states, after)
        goal = np.array([3.0, 0.0])
        far, near = (np.abs(points - goal).sum(axis=1) for points in (states, after))
        there = near < 0.5
        return Steps(after, far - near + 10.0 * there, there, np.ones(len(states), dtype=np.bool_))


def _crosses(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.bool_]:
    hit = np.zeros(len(before), dtype=np.bool_)
    for axis, at, low, high in ((0, 1.0, -1.0, 1.0), (1, 1.0, 0.0, 1.0), (1, -1.0, 0.0, 1.0)):
        a, b = before[:, axis] - at, after[:, axis] - at
        over = (a < 0) != (b < 0)
        share = np.where(over, a / np.where(over, a - b, 1.0), 0.0)
        other = before[:, 1 - axis] + share * (after[:, 1 - axis] - before[:, 1 - axis])
        hit |= over & (low <= other) & (other <= high)
    return hit
