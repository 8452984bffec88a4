"""What an env showed, as a file: recorded where the env can be installed, learned from where everything else can.

Envs of others come with pins of their own, which clash with those of what relgym is compared with. A recording needs
neither: it holds observations, actions and ends, the env's spaces, and the view through which it is looked at.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from relgym.envs.views import View, view_from_json

__all__ = ["Recording", "Step", "record"]

Policy = Callable[[Any, np.random.Generator], Any]


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a recording: what was seen, what was done, what was seen then.

    Attributes
    ----------
    before, after
        Observations.
    action
        What the agent did.
    terminated
        Whether the step ended the episode for good.
    first
        Whether `before` is the first observation of an episode.
    """

    before: Any
    action: Any
    after: Any
    terminated: bool
    first: bool


@dataclass(frozen=True, slots=True)
class Recording:
    """Steps of an env in the order in which they came.

    Attributes
    ----------
    view
        How the env is looked at.
    before, after
        Observations before and after every step, shape ``(n, ...)``.
    actions
        Shape ``(n, ...)``.
    terminated, truncated
        Which steps ended an episode, shape ``(n,)``.
    """

    view: View
    before: NDArray[Any]
    actions: NDArray[Any]
    after: NDArray[Any]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.actions)

    def __iter__(self) -> Iterator[Step]:
        over = True
        for k in range(len(self)):
            terminated = bool(self.terminated[k])
            yield Step(self.before[k], self.actions[k], self.after[k], terminated, over)
            over = terminated or bool(self.truncated[k])

    def save(self, path: str | Path) -> None:
        """Write one compressed file of arrays; nothing in it is ever evaluated."""
        view = np.frombuffer(json.dumps(self.view.to_json()).encode(), np.uint8)
        names = ("before", "actions", "after", "terminated", "truncated")
        arrays: dict[str, Any] = {name: getattr(self, name) for name in names}
        np.savez_compressed(path, view=view, **arrays)

    @classmethod
    def load(cls, path: str | Path) -> Recording:
        """Read what `save` wrote."""
        with np.load(path, allow_pickle=False) as data:
            view = view_from_json(json.loads(data["view"].tobytes()))
            names = ("before", "actions", "after", "terminated", "truncated")
            return cls(view, *(data[name] for name in names))


def record(env: gym.Env[Any, Any], view: View, policy: Policy, steps: int, seed: int) -> Recording:
    """Act in an env and write down what is seen.

    Parameters
    ----------
    env
        Its observations have one shape.
    view
        Goes into the recording.
    policy
        Action by observation and source of randomness.
    steps
        How many steps; episodes follow one another.
    seed
        Of the first episode and of the policy.
    """
    rng = np.random.default_rng(seed)
    found: list[tuple[Any, ...]] = []
    observation, _ = env.reset(seed=seed)
    for _ in range(steps):
        action = policy(observation, rng)
        following, _, terminated, truncated, _ = env.step(action)
        found.append((observation, action, following, bool(terminated), bool(truncated)))
        observation = env.reset()[0] if terminated or truncated else following
    return Recording(view, *(np.array(column) for column in zip(*found, strict=True)))
