"""Episodes of any env as scenes, with random actions: what a model is tested on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import gymnasium as gym
import numpy as np

from relgym.envs.views import View
from relgym.scene.objects import Scene, Transition

__all__ = ["FreshEpisode", "fresh_episodes", "transitions"]

_FRESH = 0x7E57
"""Sets the seeds of tests apart from those of learning."""


@dataclass(frozen=True, slots=True)
class FreshEpisode:
    """Some consecutive steps of one episode.

    Attributes
    ----------
    before
        The scene before each step, with its action.
    after
        The scene after it, with what the step brought where that is learned.
    """

    before: tuple[Scene, ...]
    after: tuple[Scene, ...]

    def __len__(self) -> int:
        return len(self.before)


def fresh_episodes(
    env: gym.Env[Any, Any], view: View, *, seed: int, most: int = 1000
) -> Iterator[FreshEpisode]:
    """Act at random in an env, episode after episode, without end.

    Parameters
    ----------
    env
        Any env.
    view
        How it is seen; final (`relgym.wrappers.views.settled`).
    seed
        Of the env and of the actions. Both are drawn from a stream of their own, so that a test with seed 0 shows other
        episodes than learning with seed 0 did.
    most
        Longest episode, in steps; a longer one is broken off.
    """
    of_env, of_actions = np.random.SeedSequence([seed, _FRESH]).generate_state(2).tolist()
    env.action_space.seed(of_actions)
    first: int | None = of_env
    while True:
        observation, info = env.reset(seed=first)
        first = None
        scene, over = view.scene(observation, info), False
        before: list[Scene] = []
        after: list[Scene] = []
        while not over and len(before) < most:
            action = env.action_space.sample()
            before.append(view.with_action(scene, action))
            observation, reward, terminated, truncated, info = env.step(action)
            over = bool(terminated or truncated)
            scene = view.scene(observation, info, last=scene)
            after.append(view.with_outcome(scene, reward, bool(terminated)))
        yield FreshEpisode(tuple(before), tuple(after))


def transitions(found: Iterator[FreshEpisode], steps: int) -> list[Transition]:
    """The first so many steps of some episodes."""
    pairs = ((b, a) for episode in found for b, a in zip(episode.before, episode.after, strict=True))
    return [Transition(before, after) for before, after in islice(pairs, steps)]
