"""What a model keeps of the env that it was learned in: the spaces, and scenes to start from."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec

from relgym.envs.spaces_json import space_from_json, space_to_json
from relgym.errors import ConfigError, ModelFileError, ObservationError
from relgym.scene.objects import TASK, Scene
from relgym.scene.schema import SceneSchema

__all__ = ["EnvRecord", "copied", "made_how", "schema_like", "world_like"]


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
        Plain data for people, renderers and the console: how the env was made (`made_how`), `render_fps`.
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


def made_how(spec: EnvSpec | None) -> dict[str, Any]:
    """What ``gym.make`` needs to make an env again, as plain data for a model's file.

    Parameters
    ----------
    spec
        The env's; ``None``: it was made without ``gym.make``, and nobody knows.

    Returns
    -------
    ``env``, the id; ``arguments``, those that differ from the registered ones; ``omitted``, the names of arguments that
    no file can hold (functions, arrays, objects); ``wrappers``, the names of wrappers that were put on afterwards.
    Entries that would be empty are left out.
    """
    if spec is None:
        return {}
    registered = gym.registry.get(spec.id)
    usual = {} if registered is None else registered.kwargs
    given = {
        k: v for k, v in spec.kwargs.items() if k != "render_mode"
    }  # how it is shown is no one's to learn
    if registered is not None and spec.max_episode_steps not in (None, registered.max_episode_steps):
        given["max_episode_steps"] = spec.max_episode_steps
    arguments, omitted = {}, []
    for name, value in given.items():
        try:
            arguments[name] = _plain_argument(value)
        except TypeError:
            if name not in usual or usual[name] is not value:
                omitted.append(name)
            continue
        if name in usual and arguments[name] == usual[name]:
            del arguments[name]
    parts = {
        "arguments": arguments,
        "omitted": omitted,
        "wrappers": [wrapper.name for wrapper in spec.additional_wrappers],
    }
    return {"env": spec.id} | {name: part for name, part in parts.items() if part}


def _plain_argument(value: Any) -> Any:
    """An argument as JSON holds it, tuples as lists; `TypeError` where it can't."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, (list, tuple)):
        return [_plain_argument(each) for each in value]
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {key: _plain_argument(each) for key, each in value.items()}
    raise TypeError(f"{value!r} isn't plain data")


def world_like(like: gym.Env[Any, Any], schema: SceneSchema) -> gym.Env[Any, Any]:
    """A copy of the env inside all wrappers, whose episode goes on undisturbed.

    Raises
    ------
    ConfigError
        The model can't predict its scenes (`schema_like`), or it can't be copied.
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
            "that a ModelLearner saved holds spaces and first scenes of its own: leave out like"
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
    """Why a model of one schema can't predict scenes of the other; empty if it can."""
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
