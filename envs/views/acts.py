"""Actions as properties of the bodiless object `action`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np
from gymnasium import spaces

from relgym.envs.actions import without_action
from relgym.envs.agents import AgentsSpace
from relgym.envs.arguments import action_numbers, action_parts
from relgym.envs.views.arrangement import numbered
from relgym.envs.views.leaves import Key, parts_of
from relgym.envs.views.records import identifier, identifiers
from relgym.errors import ActionError, ConfigError
from relgym.model.percepts.scenes import scene_of
from relgym.scene.objects import ACTION, Float1D, Float2D, ObjectType, Scene, SceneLayout

__all__ = ["MOST_CHOICES", "Acts"]

MOST_CHOICES = 16
"""Discrete actions with more choices than this have a number, but no indicators: each would cost a column."""


class Acts:
    """What actions of a space are in a scene.

    Continuous actions are properties in the env's own units. A discrete one is a number, for functions that are
    linear in it, and from three choices on (up to `MOST_CHOICES`) as many *indicators*, 1 for the choice taken
    and 0 for the others: to clauses they are relations (``action.left``), and functions use them where the number's
    order means nothing.

    Parameters
    ----------
    space
        A flat Box, Discrete, MultiDiscrete or MultiBinary, or a Dict or Tuple of those (not one of agents, who are
        objects of their own: `AgentsView`).
    names
        For a Discrete space the names of its choices (default ``a_is_0``, ``a_is_1``, …); for other spaces those
        of an action's numbers, in the space's order (default ``a`` if it is one, else ``a0``, ``a1``, …; in a Dict the
        key in place of the ``a``). Gymnasium sorts the keys of a Dict space.

    Raises
    ------
    ConfigError
        Another space, or names that are too many, too few or no identifiers.

    Examples
    --------
    >>> acts = Acts(spaces.Discrete(3), names=("left", "nothing", "right"))
    >>> acts.properties
    ('a', 'left', 'nothing', 'right')
    >>> acts.values(2)
    array([2., 0., 0., 1.])
    >>> arm = Acts(spaces.Dict({"grip": spaces.Discrete(2), "move": spaces.Box(-1.0, 1.0, (2,))}))
    >>> arm.properties
    ('grip', 'move0', 'move1')
    >>> arm.values({"grip": 1, "move": np.array([0.5, -0.5])})
    array([ 1. ,  0.5, -0.5])
    """

    def __init__(self, space: spaces.Space[Any], names: Sequence[str] | None = None) -> None:
        self.space = space
        self.names = None if names is None else tuple(names)
        self._latest: tuple[SceneLayout, SceneLayout, int] | None = None  # without an action, and with one
        parts = _parts(space)
        self._parts = {key: _choices(part) for key, part in parts.items()}
        self._starts = [start for starts, _ in self._parts.values() for start in starts]
        self._counts = [count for _, counts in self._parts.values() for count in counts]
        discrete = isinstance(space, spaces.Discrete)
        given = self.names if self.names is not None and not discrete else self._own_names()
        identifiers("actions: names of an action's numbers", given, len(self._starts))
        labels = [
            [] if not 3 <= count <= MOST_CHOICES else [f"{name}_is_{k + start:g}" for k in range(count)]
            for name, start, count in zip(given, self._starts, self._counts, strict=True)
        ]
        if discrete and self.names is not None:
            identifiers("names of the choices", self.names, self._counts[0])
            labels = [list(self.names)]
        indicators = tuple(label for part in labels for label in part)
        self.properties = (*given, *indicators)
        if twice := sorted({name for name in self.properties if self.properties.count(name) > 1}):
            raise ConfigError(
                f"actions: {twice} name both a number and a choice of {space}; pass other names of its numbers"
            )
        binary = [
            isinstance(parts[key], spaces.MultiBinary) for key, (own, _) in self._parts.items() for _ in own
        ]
        self._flags = (*compress(given, binary), *indicators)
        self._indicated = [k for k, part in enumerate(labels) if part]

    def check(self, space: spaces.Space[Any]) -> None:
        """Raise `ConfigError` unless actions of a space mean here what they mean there."""
        try:
            same = {key: _choices(part) for key, part in _parts(space).items()} == self._parts
        except ConfigError:
            same = False
        if not same:
            raise ConfigError(
                f"the view was made for actions of {self.space}, but the env's action space is {space}; make it with "
                "env.action_space"
            )

    @cached_property
    def type(self) -> ObjectType:
        """The type of the action object."""
        return ObjectType(ACTION, self.properties, flags=self._flags)

    def values(self, action: Any) -> Float1D:
        """Properties of the action object, shape ``(len(properties),)``, for a legal action."""
        numbers = self._numbers(action)
        if not self._indicated:
            return numbers
        shown = [numbers]
        for k in self._indicated:
            one_hot = np.zeros(self._counts[k])
            choice = int(numbers[k] - self._starts[k])
            if not 0 <= choice < len(one_hot):
                raise ActionError(f"action {action!r}: there is no such choice in {self.space}")
            one_hot[choice] = 1.0
            shown.append(one_hot)
        return np.concatenate(shown)

    def _numbers(self, action: Any) -> Float1D:
        """An action's own numbers, part by part."""
        space = self.space
        if not isinstance(space, (spaces.Dict, spaces.Tuple)):
            return action_numbers(action, len(self._counts))
        given = action_parts(space, action)
        return np.concatenate([action_numbers(part, len(self._parts[key][0])) for key, _, part in given])

    def values_batch(self, actions: Any) -> Float2D:
        """`values` of n actions of a flat space, shape ``(n, len(properties))``; the same bits."""
        try:
            numbers = np.asarray(actions, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise ActionError(f"expected the numbers of actions, got {actions!r}") from None
        if numbers.ndim < 1 or numbers[:1].size != len(self._starts) * min(1, len(numbers)):
            raise ActionError(
                f"expected actions of {self.space} along a first axis, got shape {numbers.shape}"
            )
        numbers = numbers.reshape(len(numbers), len(self._starts))
        choices = [numbers[:, [k]] - self._starts[k] == np.arange(self._counts[k]) for k in self._indicated]
        return np.concatenate([numbers, *choices], axis=1)

    def acting(self, scene: Scene, action: Any) -> Scene:
        """The scene with this action in it, in place of another one if there is one."""
        bare = without_action(scene)
        schema = scene.schema
        known = self._latest
        if known is None or known[0] is not bare.layout:
            found = schema.layout((*bare.layout.names, ACTION))
            known = self._latest = bare.layout, found, found.offsets[found.index(ACTION)]
        _, layout, at = known  # objects stand in schema order
        parts = (bare.vector[:at], self.values(action), bare.vector[at:])
        return scene_of(schema, layout, np.concatenate(parts))

    def _own_names(self) -> tuple[str, ...]:
        """Names of the numbers if none are given."""
        if not isinstance(self.space, spaces.Dict):
            return numbered(len(self._starts), "a")
        names = [numbered(len(starts), identifier(key)) for key, (starts, _) in self._parts.items()]
        return tuple(name for own in names for name in own)


def _parts(space: spaces.Space[Any]) -> dict[Key, spaces.Space[Any]]:
    """The flat spaces that an action space is made of."""
    if isinstance(space, AgentsSpace):
        raise ConfigError(
            f"{space} has a part for each agent: pass view=AgentsView(observation_space, action_space)"
        )
    if found := dict(parts_of(space)):
        return found
    raise ConfigError(f"the action space {space} has no parts: expected some numbers to act with")


def _choices(space: spaces.Space[Any]) -> tuple[list[float], list[int]]:
    """Smallest value and number of choices of each of an action's numbers; 0 choices where it is continuous."""
    if isinstance(space, spaces.Discrete):
        return [float(space.start)], [int(space.n)]
    if isinstance(space, spaces.MultiDiscrete):
        starts = np.broadcast_to(space.start, space.nvec.shape).ravel()
        return starts.astype(np.float64).tolist(), space.nvec.ravel().tolist()
    if isinstance(space, (spaces.Box, spaces.MultiBinary)):
        size = int(np.prod(space.shape))
        return [0.0] * size, [0] * size
    raise ConfigError(
        f"actions of {space}: expected Box, Discrete, MultiDiscrete, MultiBinary, or one level of Dict or Tuple of "
        "those; flatten it: gymnasium.wrappers.TransformAction(env, function, space), where the space is one of these "
        "and the function makes the env's action of one of its actions"
    )
