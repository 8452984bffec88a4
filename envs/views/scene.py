"""The view of envs whose observations are scenes already."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces

from relgym.arguments import refusing, refusing_calls
from relgym.envs.actions import acting, check_action_space
from relgym.envs.spaces_json import space_from_json, space_to_json
from relgym.envs.views.base import as_shown, precision_of
from relgym.errors import ConfigError, ObservationError
from relgym.model.files.storage import schema_from_json, schema_to_json
from relgym.scene.objects import ACTION, Scene
from relgym.scene.schema import SceneSchema

__all__ = ["SceneView"]


@refusing_calls(ConfigError)
class SceneView:
    """`Dict` observations, object name -> property vector, of a schema that the env has.

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

    matches = False

    @refusing(ConfigError)
    def __init__(
        self, schema: SceneSchema, observation_space: spaces.Space[Any], action_space: spaces.Space[Any]
    ) -> None:
        check_action_space(schema, action_space)
        self._boxes = _checked_boxes(schema, observation_space)
        self.schema = replace(schema, precision=self.precision) if self.precision else schema
        self._spaces = (observation_space, action_space)
        self._needed = frozenset(
            name for name in schema.order if (t := schema.type_of(name)).has_body and not t.optional
        )

    @property
    def precision(self) -> float:
        """Relative precision of the numbers that it shows: see `View`."""
        return precision_of(*(box.dtype == np.float32 for box in self._boxes.values()))

    @refusing(ObservationError)
    def scene(
        self,
        observation: Any,
        info: Mapping[str, Any] | None = None,
        *,
        last: Scene | None = None,
        expected: Scene | None = None,
    ) -> Scene:
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

    def check_actions(self, space: spaces.Space[Any]) -> None:
        """Raise `ConfigError` unless the view can read actions of a space."""
        check_action_space(self.schema, space)

    @refusing(ObservationError)
    def with_action(self, scene: Scene, action: Any) -> Scene:
        """The scene with the action object, through the affine maps in ``schema.action_scale``."""
        return acting(scene, action)

    def with_outcome(self, scene: Scene, reward: Any, terminated: bool) -> Scene:
        """The scene as it is: this view learns of the state alone (`TaskView` of more)."""
        return scene

    def observation(self, scene: Scene) -> dict[str, Any]:
        """Property vectors by object name, in the dtypes of the observation space."""
        return {o.name: as_shown(o.values, self._boxes[o.name].dtype) for o in scene if o.name in self._boxes}

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {
            "kind": "scene",
            "schema": schema_to_json(self.schema),
            "observation": space_to_json(self._spaces[0]),
            "action": space_to_json(self._spaces[1]),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> SceneView:
        """Read what `to_json` wrote."""
        spaces_of = (space_from_json(data[name]) for name in ("observation", "action"))
        return cls(schema_from_json(data["schema"]), *spaces_of)


def _checked_boxes(schema: SceneSchema, space: spaces.Space[Any]) -> dict[str, spaces.Space[Any]]:
    """Boxes by object; `ConfigError` unless they are what the schema says."""
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
    return dict(space.spaces)
