"""Tasks: what an agent is asked to do, as pure functions of (scene, action, next scene).

Reward and termination of an env live here and not in the env, so that imagined steps get them from the very same
functions as real ones: one scene at a time, or thousands at once.

- *Tasks are the default, the thesis' worlds an argument.* ``gym.make("relgym/TruckPush-v0")`` is the control task.
  ``task=None`` is the world of §3.1, which the experiments ask for by name; so is ``resample="step"`` alone, since
  nobody can plan for frictions yet to be drawn (both together with ``task="push"`` are an error).
- *A goal is a bodiless object*, seen from the actor: `goal.ahead` of the truck's nose, `goal.dx` and `goal.dy` from
  the ball. It takes part in no relation, so that it can't spoil what is learned of contacts; its conditions are
  thresholds on single properties, which the learner can find; and what it will be next is learned like anything else
  (``ahead' = ahead - truck.vx'``).
- *The observation is Markov.* What a task counts is a property too: `goal.held`, for how long the ball has stayed.
- *Rewards are piecewise linear*, hence learnable.
- *Decisions are slower than steps* where steps must be short to keep the laws linear: `ActionRepeat` goes round world
  and dream alike, with the learner inside.
- *Dreams last longer than episodes.* What a model can't dream of are other beginnings; so agents that dream may see
  the world in `TruncatedEpisodes`, most episodes cut short.
- *Flat views* for policy networks come from the schema and the env's `FlatSpec` alone: relative to the actor, scaled
  (what has to be met exactly at two scales), padded and masked. `Flattener` does it for arrays of scenes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.envs.actions import without_action
from relgym.scene.objects import Float1D, Float2D, Scene, SceneLayout

__all__ = ["Region", "RewardFunctions", "Task", "TaskOutcome", "column_of"]


@dataclass(frozen=True, slots=True)
class TaskOutcome:
    """Rewards, ends and successes of n steps.

    Attributes
    ----------
    rewards
        Shape ``(n,)``.
    terminated
        Whether the step ends the episode, shape ``(n,)``.
    succeeded
        Whether it ends it well, shape ``(n,)``.
    """

    rewards: Float1D
    terminated: NDArray[np.bool_]
    succeeded: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Region:
    """A part of the world that a picture marks, in world units along the first and the up axis."""

    left: float
    bottom: float
    width: float
    height: float


class RewardFunctions(ABC):
    """Rewards of steps, and which of them end an episode.

    A subclass supplies `evaluate`. The functions of single scenes and those of arrays go through it, so that they
    agree to the last bit.

    Notes
    -----
    `reward` and `terminated` are what `LearnedModelEnv` takes as functions of (scene, action, next scene);
    `rewards` and `terminations` are the same for arrays of scenes.
    """

    @abstractmethod
    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """Evaluate n steps.

        Parameters
        ----------
        layout
            The layout that all scenes share; the action object may be part of it or not.
        before, after
            State vectors before and after each step, shape ``(n, layout.width)``.
        actions
            What was done, in the units of the action space, shape ``(n, …)``.
        """

    def rewards(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> Float1D:
        """Rewards of n steps, shape ``(n,)``; see `evaluate`."""
        return self.evaluate(layout, before, actions, after).rewards

    def terminations(
        self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D
    ) -> NDArray[np.bool_]:
        """Which of n steps end their episodes, shape ``(n,)``; see `evaluate`."""
        return self.evaluate(layout, before, actions, after).terminated

    def reward(self, before: Scene, action: Any, after: Scene) -> float:
        """Reward of one step; the scenes may hold an action object or not."""
        return float(self._one(before, action, after).rewards[0])

    def terminated(self, before: Scene, action: Any, after: Scene) -> bool:
        """Whether a step ends the episode."""
        return bool(self._one(before, action, after).terminated[0])

    def _one(self, before: Scene, action: Any, after: Scene) -> TaskOutcome:
        # A scene with what is done in it is wider than the one that follows.
        first, last = without_action(before), without_action(after)
        return self.evaluate(first.layout, first.vector[None], np.asarray(action)[None], last.vector[None])


class Task(RewardFunctions):
    """What an agent is asked to do. Immutable; its methods depend on nothing but their arguments."""

    @abstractmethod
    def regions(self, scene: Scene) -> tuple[Region, ...]:
        """Where the agent is to go: what a picture marks."""

    def successes(
        self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D
    ) -> NDArray[np.bool_]:
        """Which of n steps reach the aim, shape ``(n,)``; see `evaluate`."""
        return self.evaluate(layout, before, actions, after).succeeded

    def succeeded(self, before: Scene, action: Any, after: Scene) -> bool:
        """Whether a step reaches the aim."""
        return bool(self._one(before, action, after).succeeded[0])


def column_of(layout: SceneLayout, name: str, prop: str, vectors: Float2D) -> Float1D:
    """A property of one object in n scenes, shape ``(n,)``."""
    place = layout.places.get((name, prop))
    if place is None:
        place = layout.column(layout.index(name), prop)  # which says what is wrong
    column: Float1D = vectors[:, place]
    return column
