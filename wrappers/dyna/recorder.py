"""A wrapper that writes down what really happened, scene by scene, for a model beside the agent to learn from."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, Final

import gymnasium as gym
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs

from relgym.envs.arguments import checked_action
from relgym.envs.views import SceneView
from relgym.scene.objects import Scene, Transition
from relgym.scene.schema import SceneSchema
from relgym.wrappers.dyna.keys import check_keys
from relgym.wrappers.views import ViewLike, recordable, view_of

__all__ = ["Experience", "TransitionRecorder"]

_MOST: Final = 10_000
"""Of an env in which agents are only tested, nobody takes the steps."""


@dataclass(frozen=True, slots=True)
class Experience:
    """One real step.

    Attributes
    ----------
    transition
        The scene before, with the action in it, and the scene after.
    start
        The scene before, without the action.
    action
        What was done, in the units of the action space.
    reward, terminated
        What the env said.
    first
        Whether the episode began with it.
    """

    transition: Transition
    start: Scene
    action: Any
    reward: float
    terminated: bool
    first: bool


class TransitionRecorder(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Records the latest 10,000 steps until `take` is called; what the env returns stays as it is.

    It goes directly round an env, inside all wrappers that change observations or actions: the model learns from what
    lies inside, unscaled and unrepeated. Where observations aren't scenes they are seen as one object of numbers, or
    one per key, or as `view` says.

    Parameters
    ----------
    env
        As for `relgym.wrappers.ModelLearner`.
    view
        How observations and actions become scenes, as for `relgym.wrappers.ModelLearner`; but angles aren't guessed
        here: ``NumbersView(..., angles=[("x0", "x1")])``.

    Attributes
    ----------
    view : View
        How observations and actions become scenes.

    Raises
    ------
    ConfigError
        Observations that need a view of the user's (images, tables, nested spaces), or changed spaces; a Dict with a
        dot in a key.
    """

    def __init__(self, env: gym.Env[Any, Any], *, view: ViewLike = None) -> None:
        RecordConstructorArgs.__init__(self, view=recordable(view))
        gym.Wrapper.__init__(self, env)
        check_keys(env.observation_space)
        self.view = view_of(env, view)
        self._scene: Scene | None = None
        self._first = True
        self._taken: deque[Experience] = deque(maxlen=_MOST)

    @property
    def schema(self) -> SceneSchema:
        """What the scenes are made of; only where observations are scenes: of any others ``view.schema`` tells."""
        if not isinstance(self.view, SceneView):
            raise AttributeError("observations aren't scenes: see view.schema")
        return self.view.schema

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._scene, self._first = self.view.scene(observation, info), True
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the env and write down what happened."""
        if self._scene is None:
            raise ResetNeeded("no current scene: call reset() first")
        checked = checked_action(self.env.action_space, action)
        observation, reward, terminated, truncated, info = self.env.step(action)
        after = self.view.scene(observation, info, last=self._scene)
        transition = Transition(self.view.with_action(self._scene, checked), after)
        self._taken.append(
            Experience(transition, self._scene, checked, float(reward), bool(terminated), self._first)
        )
        self._scene, self._first = after, False
        return observation, reward, terminated, truncated, info

    def take(self) -> list[Experience]:
        """All steps since the last call, in order; the recorder forgets them."""
        taken = list(self._taken)
        self._taken.clear()
        return taken
