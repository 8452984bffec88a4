"""Reward and termination as properties of the bodiless object `task`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces

from relgym.arguments import refusing, refusing_calls
from relgym.envs.views.base import View
from relgym.envs.views.numeric import NumbersView
from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import TASK, TERMINATED, ObjectType, Scene, Target

__all__ = ["REWARD", "TERMINATED", "TaskView"]

REWARD = "reward"
"""Property of `task`: the reward of the step, in the env's units."""


@refusing_calls(ConfigError)
class TaskView:
    """Another view, whose scenes also say what a step brought.

    Before a step both properties are 0, for what it will bring is not known; after it they are the step's. So
    they are functions of scene, action and next scene, and of nothing else.

    Parameters
    ----------
    view
        The view of the state.
    reward, terminated
        Which of the two are shown.

    Raises
    ------
    ConfigError
        The view's scenes have an object `task` already.
    """

    @refusing(ConfigError)
    def __init__(self, view: View, *, reward: bool = True, terminated: bool = True) -> None:
        if TASK in view.schema.order:
            raise ConfigError(
                f"the env's own scenes have an object {TASK!r}: leave out learn_reward and learn_termination"
            )
        self.view = view
        self._names = tuple(name for name, wanted in ((REWARD, reward), (TERMINATED, terminated)) if wanted)
        schema = view.schema
        self.schema = replace(
            schema,
            types=(*schema.types, ObjectType(TASK, self._names)),
            objects=(*schema.objects, (TASK, TASK)),
            targets=None
            if schema.targets is None
            else (*schema.targets, *_told(schema.targets, self._names)),
        )

    @property
    def matches(self) -> bool:
        """Whether `scene` heeds what was expected: see `View`."""
        return self.view.matches

    @property
    def precision(self) -> float:
        """Relative precision of the numbers that it shows: see `View`."""
        return self.view.precision

    @property
    def open(self) -> bool:
        """Whether the view of the state has pairs of numbers that may yet turn out to be angles."""
        return bool(getattr(self.view, "open", False))

    def settled(self, observations: Sequence[Any]) -> TaskView:
        """The view with angles decided from some first observations: see `NumbersView.settled`."""
        if not isinstance(self.view, NumbersView):
            return self
        view = self.view.settled(observations)
        return TaskView(view, reward=REWARD in self._names, terminated=TERMINATED in self._names)

    def upheld(self, observation: Any) -> TaskView:
        """The view without guessed angles that an observation refutes: see `NumbersView.upheld`."""
        if not isinstance(self.view, NumbersView) or (view := self.view.upheld(observation)) is self.view:
            return self
        return TaskView(view, reward=REWARD in self._names, terminated=TERMINATED in self._names)

    def scene(
        self,
        observation: Any,
        info: Mapping[str, Any] | None = None,
        *,
        last: Scene | None = None,
        expected: Scene | None = None,
    ) -> Scene:
        """The scene that an observation shows, without `task`; see `View.scene`."""
        return self._own(self.view.scene(observation, info, last=last, expected=expected))

    def check_actions(self, space: spaces.Space[Any]) -> None:
        """Raise `ConfigError` unless the view can read actions of a space."""
        if (check := getattr(self.view, "check_actions", None)) is not None:
            check(space)

    def with_action(self, scene: Scene, action: Any) -> Scene:
        """The scene with what the agent does in it, and what that brings: 0, as long as it isn't known."""
        return self._with(self.view.with_action(self._bare(scene), action), [0.0] * len(self._names))

    def with_outcome(self, scene: Scene, reward: Any, terminated: bool) -> Scene:
        """The scene together with what the step to it brought.

        Raises
        ------
        ObservationError
            The reward is no finite number, and it is shown.
        """
        if not isinstance(terminated, (bool, np.bool_, int, float)):
            raise ConfigError(f"terminated={terminated!r}: expected True or False")
        brought = {TERMINATED: float(bool(terminated))}
        if REWARD in self._names:  # else it may be whatever the env likes
            brought[REWARD] = _number(reward)
        return self._with(self._bare(scene), [brought[name] for name in self._names])

    def observation(self, scene: Scene) -> Any:
        """The observation that shows a scene."""
        return self.view.observation(self._bare(scene))

    def to_json(self) -> dict[str, Any]:
        """Plain data that `view_from_json` reads back."""
        return {
            "kind": "task",
            "view": self.view.to_json(),
            "reward": REWARD in self._names,
            "terminated": TERMINATED in self._names,
        }

    # `task` stands last: its properties are the end of the vector.
    def _own(self, scene: Scene) -> Scene:
        return Scene(self.schema, self.schema.layout(scene.layout.names), scene.vector)

    def _bare(self, scene: Scene) -> Scene:
        if TASK not in scene:
            return scene
        rest = self.schema.layout(scene.layout.names[:-1])
        return Scene(self.schema, rest, scene.vector[: rest.width].copy())

    def _with(self, scene: Scene, values: list[float]) -> Scene:
        layout = self.schema.layout((*scene.layout.names, TASK))
        return Scene(self.schema, layout, np.concatenate([scene.vector, values]))


def _told(targets: Sequence[Target], names: Sequence[str]) -> tuple[Target, ...]:
    """What a step brings, as targets beside those that a schema names: it depends on what these will be.

    A reward may depend on whether the step ends the episode, as a bonus for success does.
    """
    given = tuple((t.type, t.property) for t in targets)
    ended = ((TASK, TERMINATED),) if TERMINATED in names else ()
    order = [name for name in (TERMINATED, REWARD) if name in names]
    return tuple(Target(TASK, name, given=given + (ended if name == REWARD else ())) for name in order)


def _number(reward: Any) -> float:
    if type(reward) is float and math.isfinite(reward):
        return reward
    try:
        numbers = np.asarray(reward, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        numbers = np.empty(0)
    if numbers.size != 1 or not np.isfinite(numbers).all():
        raise ObservationError(
            f"the reward: expected a finite number, got {reward!r}; make one of it inside the learner "
            "(gymnasium.wrappers.TransformReward), or leave out learn_reward"
        )
    return numbers.item()
