"""What a model keeps of the env that it was learned in: the spaces, and scenes to start from."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from relgym.envs.spaces_json import space_from_json, space_to_json
from relgym.errors import ConfigError, ModelFileError, ObservationError
from relgym.scene.objects import TASK, Scene
from relgym.scene.schema import SceneSchema

__all__ = ["EnvRecord", "copied", "schema_like", "world_like"]


@dataclass(frozen=True, slots=True)
class EnvRecord:
    """All that a dream needs to know of the real env.

    Attributes
    ----------
    observation_space, action_space
        The env's spaces.
    starts
        First scenes of some episodes.
    metadata
        Plain data for people and renderers: the env's id, `render_fps`.
    """

    observation_space: spaces.Space[Any]
    action_space: spaces.Space[Any]
    starts: tuple[Scene, ...] = ()
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back; `ConfigError` for a space that it doesn't know."""
        return {
            "spaces": {
                "observation": space_to_json(self.observation_space),
                "action": space_to_json(self.action_space),
            },
            "starts": [
                {"objects": list(scene.layout.names), "vector": scene.vector.tolist()}
                for scene in self.starts
            ],
            "metadata": dict(self.metadata),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any], schema: SceneSchema) -> EnvRecord:
        """Read what `to_json` wrote.

        Raises
        ------
        ModelFileError
            Something is missing or malformed.
        """
        try:
            return cls(
                space_from_json(data["spaces"]["observation"]),
                space_from_json(data["spaces"]["action"]),
                tuple(_scene(schema, start) for start in data["starts"]),
                dict(data["metadata"]),
            )
        except (KeyError, TypeError, ValueError, AssertionError) as error:
            raise ModelFileError(
                f"what the model's file says of its env is missing or malformed ({error!r}); "
                "save it again, or pass like=env"
            ) from None


def world_like(like: gym.Env[Any, Any], schema: SceneSchema) -> gym.Env[Any, Any]:
    """A copy of the env inside all wrappers, whose episode goes on undisturbed.

    Raises
    ------
    ConfigError
        The model can't speak of its scenes (`schema_like`), or it can't be copied.
    """
    inner = like.unwrapped
    own = getattr(inner, "schema", None)
    schema_like(own if isinstance(own, SceneSchema) else None, schema, f"like={like}")
    return copied(inner)


def copied(env: gym.Env[Any, Any]) -> gym.Env[Any, Any]:
    """A copy that draws nothing, so that its resets disturb nobody; `ConfigError` where there can't be one."""
    try:
        world = copy.deepcopy(env)
    except (TypeError, NotImplementedError, copy.Error) as error:
        raise ConfigError(
            f"like={env} can't be copied ({error}), and a dream must not disturb the real env's episode; a model "
            "that a ModelLearner taught holds spaces and first scenes of its own: leave out like"
        ) from error
    world.unwrapped.render_mode = None  # its resets are no one's to see
    return world


def schema_like(other: SceneSchema | None, schema: SceneSchema, what: str) -> SceneSchema:
    """The model's schema with the objects of another one: number and names may differ, types may not.

    Parameters
    ----------
    other
        Schema of an env or of a scene.
    schema
        The model's.
    what
        How to call the other one in errors.

    Raises
    ------
    ConfigError
        Types, properties, axes or action ranges aren't those of the model; what is to be learned may differ.
    """
    difference = "it has no schema" if other is None else _difference(other, schema)
    if other is None or difference:
        raise ConfigError(
            f"{what}: expected scenes with the types, properties and action ranges of the model's (types "
            f"{sorted(t.name for t in schema.types)}), but {difference}; make it with the arguments that the model's "
            "env had (only numbers and names of objects may differ)"
        )
    # No env shows what a step brings; a model that learned it predicts it wherever it dreams.
    objects = (*other.objects, *(own for own in schema.objects if own[0] == TASK and TASK not in other.order))
    return schema if objects == schema.objects else replace(schema, objects=objects)


def _difference(other: SceneSchema, schema: SceneSchema) -> str:
    """What keeps a model of one schema from speaking of the other's scenes; empty if nothing does."""
    if (other.up, other.planar) != (schema.up, schema.planar):
        return f"it has up={other.up!r}, planar={other.planar}"
    known = {t.name: (t.properties, t.shape, dict(t.pose)) for t in schema.types}
    present = {name for _, name in other.objects}
    for t in other.types:
        if t.name in present and (t.properties, t.shape, dict(t.pose)) != known.get(t.name):
            seen = f"not with the properties {t.properties}" if t.name in known else "not at all"
            return f"it has objects of type {t.name!r}, which the model knows {seen}"
    if other.action_scale != schema.action_scale:
        return f"its actions range over {other.action_scale}, not {schema.action_scale}"
    return ""


def _scene(schema: SceneSchema, data: Mapping[str, Any]) -> Scene:
    layout = schema.layout(data["objects"])
    vector = np.array(data["vector"], dtype=np.float64)
    if vector.shape != (layout.width,) or not np.isfinite(vector).all():
        raise ObservationError(f"expected {layout.width} finite numbers for {list(layout.names)}")
    return Scene(schema, layout, vector)
