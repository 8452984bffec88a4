"""Actions in scenes: what an agent does becomes the properties of the object `action`, in physical units."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.envs.arguments import action_numbers, checked_actions, physical_action
from relgym.errors import ConfigError
from relgym.scene.objects import ACTION, Float1D, Float2D, Scene, SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = ["BatchActions", "acting", "action_values", "check_action_space", "without_action"]


def acting(scene: Scene, action: Any) -> Scene:
    """The scene with an action of the env in it; the scene itself where the schema has no action object.

    Parameters
    ----------
    scene
        With or without an action.
    action
        A legal action of the env, in the units of its action space.
    """
    schema = scene.schema
    if ACTION not in schema.order:
        return scene
    bare = without_action(scene)
    layout = schema.layout((*bare.layout.names, ACTION))
    # Objects stand in schema order, so the action may lie anywhere.
    at = layout.offsets[layout.index(ACTION)]
    parts = (bare.vector[:at], action_values(schema, action), bare.vector[at:])
    return Scene(schema, layout, np.concatenate(parts))


def without_action(scene: Scene) -> Scene:
    """The scene as an env shows it: without the action object."""
    layout = scene.layout
    if ACTION not in scene:
        return scene
    rest = scene.schema.layout(name for name in layout.names if name != ACTION)
    return Scene(scene.schema, rest, np.delete(scene.vector, layout.slice(layout.index(ACTION))))


def action_values(schema: SceneSchema, action: Any) -> Float1D:
    """Property vector of the action object: through the schema's affine maps, or as it is if there are none."""
    if not schema.action_scale:
        return action_numbers(action, len(schema.type_of(ACTION).properties))
    scaled = dict(zip(_scaled(schema), physical_action(schema, action).tolist(), strict=True))
    return np.array([scaled[prop] for prop in schema.type_of(ACTION).properties])


class BatchActions:
    """`acting` and `without_action` for n scenes with the same objects; the same bits.

    Parameters
    ----------
    schema
        The scenes' schema.
    layout
        Layout of the scenes without an action.
    space
        Action space of one scene.

    Attributes
    ----------
    layout : SceneLayout
        Layout of the scenes with what is done in them.
    """

    def __init__(self, schema: SceneSchema, layout: SceneLayout, space: spaces.Space[Any]) -> None:
        self._space = space
        self._acts = ACTION in schema.order
        self.layout = schema.layout((*layout.names, ACTION)) if self._acts else layout
        columns = np.arange(self.layout.width)
        cut = self.layout.slice(self.layout.index(ACTION)) if self._acts else slice(0, 0)
        self._own, self._rest = columns[cut], as_slice(np.delete(columns, cut))
        scaled = {prop: (k, low, high) for k, (prop, low, high) in enumerate(schema.action_scale)}
        properties = schema.type_of(ACTION).properties if self._acts else ()
        self._scale = [scaled[prop] for prop in properties] if scaled else []

    def checked(self, actions: Any, count: int) -> Any:
        """Actions as an array of shape ``(count, …)``; `ActionError` unless all lie in the space."""
        return checked_actions(self._space, actions, count)

    def joined(self, vectors: Float2D, actions: Any) -> Float2D:
        """State vectors with the actions in them, in physical units, shape ``(n, layout.width)``."""
        if not self._acts:
            return vectors
        both = np.empty((len(vectors), self.layout.width))
        both[:, self._rest] = vectors
        flat = np.asarray(actions, dtype=np.float64).reshape(len(vectors), -1)
        for place, (k, low, high) in zip(self._own.tolist(), self._scale, strict=False):
            both[:, place] = low + (flat[:, k] + 1.0) / 2.0 * (high - low)
        if not self._scale:
            both[:, self._own] = flat
        return both

    def parted(self, vectors: Float2D) -> Float2D:
        """State vectors without the actions."""
        rest: Float2D = vectors[:, self._rest] if self._acts else vectors
        return rest


def as_slice(columns: NDArray[np.intp]) -> NDArray[np.intp] | slice:
    """Columns that lie side by side as a slice, which copies nothing."""
    if len(columns) and (columns == np.arange(columns[0], columns[0] + len(columns))).all():
        return slice(int(columns[0]), int(columns[-1]) + 1)
    return columns


def check_action_space(schema: SceneSchema, space: spaces.Space[Any]) -> None:
    """Raise `ConfigError` unless actions of this space are what the schema's action object stands for."""
    if ACTION not in schema.order:
        return
    properties = schema.type_of(ACTION).properties
    if isinstance(space, (spaces.Dict, spaces.Tuple)):
        raise ConfigError(
            f"the schema declares its own action with the properties {properties}, but the action space {space} has "
            "parts; leave the action out of the schema of a FunctionView, which makes one of the numbers of all parts, "
            "or flatten the actions: gymnasium.wrappers.TransformAction(env, function, space)"
        )
    if not schema.action_scale:
        if _size(space) != len(properties):
            raise ConfigError(
                f"the schema's action has the properties {properties}, but the action space is {space}; "
                "declare one property for each number of an action"
            )
        return
    if sorted(_scaled(schema)) != sorted(properties):
        raise ConfigError(
            f"action_scale names {_scaled(schema)}, but the action has the properties {properties}; "
            "give one range for each"
        )
    unit = isinstance(space, spaces.Box) and bool((space.low == -1.0).all() and (space.high == 1.0).all())
    if not unit or _size(space) != len(properties):
        raise ConfigError(
            f"the schema's action_scale is for actions in [-1, 1], {len(properties)} numbers each, but the "
            f"action space is {space}; put wrappers that change actions outside the learner"
        )


def _scaled(schema: SceneSchema) -> tuple[str, ...]:
    return tuple(prop for prop, _, _ in schema.action_scale)


def _size(space: spaces.Space[Any]) -> int:
    """How many numbers an action has; -1 where it isn't made of numbers."""
    if isinstance(space, (spaces.Box, spaces.MultiDiscrete, spaces.MultiBinary)):
        return int(np.prod(space.shape))
    return 1 if isinstance(space, spaces.Discrete) else -1
