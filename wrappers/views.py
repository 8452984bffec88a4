"""Views: how an env's observations and actions become scenes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import gymnasium as gym
from gymnasium import spaces

from relgym.envs.actions import acting, check_action_space
from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import ACTION, Scene, SceneSchema

__all__ = ["SceneView", "View", "view_of"]


class View(Protocol):
    """What a learner must know of an env: how to see objects in it.

    Attributes
    ----------
    schema
        What the scenes are made of; constant.
    """

    schema: SceneSchema

    def scene(self, observation: Any) -> Scene:
        """The scene that an observation shows, without an action.

        Raises
        ------
        ObservationError
            NaN, infinity, a wrong length, a missing or unknown object.
        """
        ...

    def with_action(self, scene: Scene, action: Any) -> Scene:
        """The scene together with what the agent does in it, in physical units."""
        ...


class SceneView:
    """The view of envs whose observations are scenes already: `Dict`, object name -> property vector.

    Parameters
    ----------
    schema
        What the scenes are made of.
    observation_space, action_space
        The spaces of what this view will be shown.

    Raises
    ------
    ConfigError
        The spaces don't fit the schema.
    """

    def __init__(
        self, schema: SceneSchema, observation_space: spaces.Space[Any], action_space: spaces.Space[Any]
    ) -> None:
        check_action_space(schema, action_space)
        _check_observation_space(schema, observation_space)
        self.schema = schema
        self._needed = frozenset(
            name for name in schema.order if (t := schema.type_of(name)).has_body and not t.optional
        )

    def scene(self, observation: Mapping[str, Any]) -> Scene:
        """The scene that an observation shows; see `View.scene`.

        Objects of optional types may be missing, and so may bodiless ones.
        """
        if not isinstance(observation, Mapping):
            raise ObservationError(
                f"expected an observation {{object name: property vector}}, got {type(observation).__name__}; "
                "put wrappers that change observations outside the learner"
            )
        if missing := sorted(self._needed.difference(observation)):
            raise ObservationError(
                f"the observation lacks the objects {missing}; the schema has {list(self.schema.order)}, and only "
                "objects of types declared optional may be absent"
            )
        return self.schema.scene(observation)

    def with_action(self, scene: Scene, action: Any) -> Scene:
        """The scene with the action object, through the affine maps in ``schema.action_scale``."""
        return acting(scene, action)


def view_of(env: gym.Env[Any, Any]) -> View:
    """The view that fits an env.

    Raises
    ------
    ConfigError
        The env says nothing of its objects, or wrappers changed its spaces.
    """
    if not env.has_wrapper_attr("schema"):
        raise ConfigError(
            f"{env} has no `schema`, so nothing says which objects its observations show; expected an "
            "env with a SceneSchema `schema` and Dict observations, object name -> property vector, such as "
            "every relgym.envs.SceneEnv: give it those, or observe it through a SceneEnv of your own"
        )
    return SceneView(env.get_wrapper_attr("schema"), env.observation_space, env.action_space)


def _check_observation_space(schema: SceneSchema, space: spaces.Space[Any]) -> None:
    if not isinstance(space, spaces.Dict):
        raise ConfigError(
            f"expected a Dict observation space, object name -> Box, got {space}; "
            "put wrappers that change observations outside the learner"
        )
    for name, part in space.spaces.items():
        if name == ACTION or name not in schema.order:
            raise ConfigError(
                f"the observation space has the object {name!r}, which the schema doesn't show; "
                f"it has {[other for other in schema.order if other != ACTION]}"
            )
        properties = schema.type_of(name).properties
        if part.shape != (len(properties),):
            raise ConfigError(
                f"object {name!r}: expected a Box of shape {(len(properties),)} for {properties}, got {part}"
            )
