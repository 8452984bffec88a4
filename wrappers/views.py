"""Views: how an env's observations and actions become scenes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from relgym.envs.arguments import checked_action, physical_action
from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import ACTION, Scene, SceneSchema

__all__ = ["SceneView", "View", "view_of"]


class View(Protocol):
    """Turns an env's observations into scenes of one schema."""

    schema: SceneSchema

    def scene(self, observation: Any, action: Any = None) -> Scene:
        """The scene of an observation; with an action, its action object is filled in."""
        ...

    def with_action(self, scene: Scene, action: Any) -> Scene:
        """The scene with an action filled in."""
        ...


class SceneView:
    """View of an env whose observations are scenes already: a mapping from object name to property vector.

    Parameters
    ----------
    schema
        The scenes' schema.
    action_space
        The env's actions. Those of the schema's action object are mapped to its physical units.
    """

    def __init__(self, schema: SceneSchema, action_space: spaces.Space[Any]) -> None:
        self.schema = schema
        self.action_space = action_space
        self._acts = ACTION in schema.order

    def scene(self, observation: Any, action: Any = None) -> Scene:
        """Build and check the scene.

        Parameters
        ----------
        observation
            Object name → property vector.
        action
            The action taken in it, in the env's units; ``None``: none is known, and the action object is all zero.

        Raises
        ------
        ObservationError
            No mapping, an unknown object, a wrong length, NaN or infinity; names object and property.
        ActionError
            The action lies outside the space.
        """
        if not isinstance(observation, Mapping):
            raise ObservationError(
                f"expected a mapping from object name to property vector, got {type(observation).__name__}; "
                "put wrappers that flatten observations around the learner, not inside"
            )
        values = dict(observation)
        if self._acts:
            width = len(self.schema.type_of(ACTION).properties)
            values[ACTION] = np.zeros(width) if action is None else self._physical(action)
        return self.schema.scene(values)

    def with_action(self, scene: Scene, action: Any) -> Scene:
        """The scene with an action of the env's units filled in; itself where the schema has no action object."""
        if not self._acts:
            return scene
        return self.schema.scene({**scene.values(), ACTION: self._physical(action)})

    def _physical(self, action: Any) -> Any:
        return physical_action(self.schema, checked_action(self.action_space, action))


def view_of(env: gym.Env[Any, Any]) -> View:
    """The view that fits an env.

    Raises
    ------
    ConfigError
        The env has no schema of its own.
    """
    try:
        schema = env.get_wrapper_attr("schema")
    except AttributeError:
        raise ConfigError(
            f"{env} has no `schema`: expected an env whose observations are scenes (relgym.envs.SceneEnv, or any env "
            "with a `schema: SceneSchema` and observations `{object name: property vector}`); pass view=… otherwise"
        ) from None
    return SceneView(schema, env.action_space)
