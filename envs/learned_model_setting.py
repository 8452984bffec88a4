"""Where dreams take place: a model, the spaces and objects of its dreams, and how they begin."""

from __future__ import annotations

import copy
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.envs.actions import check_action_space
from relgym.envs.learned_model_judges import TaskFunctions
from relgym.envs.model_files import EnvRecord, schema_like, world_like
from relgym.errors import ConfigError, ObservationError, QueryError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, TASK, Float1D, Float2D, Scene, SceneLayout, SceneSchema

__all__ = ["Setting", "check_knowledge"]


@dataclass(frozen=True)
class Setting:
    """What single dreams and batches of them share; made by `of`.

    Attributes
    ----------
    model
        Whose predictions they are.
    schema
        The model's types with the dream's objects.
    observation_space, action_space
        Spaces of one dream.
    layout
        Layout of its scenes: the observed objects, and the `task` object if there is one; no action.
    world
        A copy of the real env, if one was given: it is reset for first scenes.
    starts
        First scenes known otherwise: those of the model's file, or the one that the dream was to be like.
    render_fps
        Pictures per second.
    """

    model: WorldModel
    schema: SceneSchema
    observation_space: spaces.Dict
    action_space: spaces.Space[Any]
    layout: SceneLayout
    world: gym.Env[Any, Any] | None
    starts: tuple[Scene, ...]
    render_fps: float

    @classmethod
    def of(
        cls,
        model: WorldModel | str | os.PathLike[str],
        like: gym.Env[Any, Any] | Scene | None,
        *,
        snapshot: bool,
    ) -> Setting:
        """Put together what a model or its file and a real env or a scene say.

        Raises
        ------
        ConfigError
            No spaces, or spaces and objects that don't fit the model.
        ModelFileError
            The file is damaged.
        QueryError
            A model that won't learn any more knows none of its targets.
        """
        if not isinstance(model, WorldModel):
            model = WorldModel.load(model)
        elif snapshot:
            model = copy.deepcopy(model)
        if model.frozen or snapshot:
            check_knowledge(model)
        world: gym.Env[Any, Any] | None = None
        if isinstance(like, Scene):
            schema = schema_like(_present(like), model.schema, "like=scene")
            record = _of_scene(like, model, schema)
        elif like is not None:
            world = world_like(like, model.schema)
            schema = schema_like(getattr(world, "schema", None), model.schema, f"like={like}")
            metadata = {"render_fps": world.metadata.get("render_fps", 50)}
            record = EnvRecord(world.observation_space, world.action_space, metadata=metadata)
        else:
            schema, record = model.schema, _recorded(model)
        check_action_space(schema, record.action_space)
        seen = _boxes(record.observation_space, schema)
        layout = schema.layout([*seen.spaces, *(name for name in (TASK,) if name in schema.order)])
        fps = record.metadata.get("render_fps", 50)
        return cls(model, schema, seen, record.action_space, layout, world, record.starts, fps)

    @property
    def task(self) -> TaskFunctions | None:
        """What the real env asks of its agents, if it says so."""
        return None if self.world is None else getattr(self.world, "task", None)

    # ------------------------------------------------------------------ observations and bounds
    @cached_property
    def cuts(self) -> tuple[tuple[str, slice, np.dtype[Any]], ...]:
        """Name, place in a state vector and dtype of every observed object, in schema order."""
        # As the real env's observations; the Dict space sorts its keys.
        seen = self.observation_space.spaces
        return tuple(
            (name, self.layout.slice(i), np.dtype(seen[name].dtype))
            for i, name in enumerate(self.layout.names)
            if name in seen
        )

    @cached_property
    def bounds(self) -> tuple[Float1D, Float1D]:
        """Smallest and largest values in a state vector; infinite for what isn't observed."""
        low, high = np.full(self.layout.width, -np.inf), np.full(self.layout.width, np.inf)
        for name, cut, _ in self.cuts:
            box = self.observation_space.spaces[name]
            assert isinstance(box, spaces.Box), "checked when made"
            low[cut], high[cut] = box.low, box.high
        return low, high

    def inside(self, vectors: Float2D) -> NDArray[np.bool_]:
        """Which of n scenes lie in the observation space, shape ``(n,)``."""
        low, high = self.bounds
        return np.asarray(((low <= vectors) & (vectors <= high)).all(axis=1))

    def outside(self, vector: Float1D) -> str:
        """Which properties of a scene left the observation space, as a sentence; empty if none did."""
        low, high = self.bounds
        left = np.flatnonzero(~((low <= vector) & (vector <= high)))
        if not len(left):
            return ""
        names = [
            f"{o}.{p}"
            for o, t in zip(self.layout.names, self.layout.types, strict=True)
            for p in t.properties
        ]
        return "; ".join(
            f"{names[k]} = {vector[k]:g} left the observation space [{low[k]:g}, {high[k]:g}]" for k in left
        )

    def observations(self, vectors: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
        """Observations of one state vector, or of n: arrays of their own, by object."""
        return {name: vectors[..., cut].astype(dtype) for name, cut, dtype in self.cuts}

    # ------------------------------------------------------------------ first scenes
    def fitted(self, scene: Scene) -> Float1D:
        """State vector of a first scene, without its action; what isn't observed (the task) begins at 0.

        Raises
        ------
        ObservationError
            Not a scene, other objects, or properties outside the observation space.
        """
        if not isinstance(scene, Scene):
            raise ObservationError(
                f"expected a start scene, got {type(scene).__name__}; take env.scene, or schema.scene(observation)"
            )
        values: dict[str, Any] = {name: v for name, v in scene.values().items() if name != ACTION}
        for name, t in zip(self.layout.names, self.layout.types, strict=True):
            if name not in self.observation_space.spaces:
                values.setdefault(name, np.zeros(len(t.properties)))
        if set(values) != set(self.layout.names):
            raise ObservationError(
                f"a dream can't begin here: expected the objects {sorted(self.observation_space.spaces)}, got "
                f"{[name for name in scene.layout.names if name != ACTION]}; for scenes with other objects pass "
                "like=scene, or an env that has them, when you make the dream"
            )
        # Through this schema: scenes of an equal one, or of another with the same objects, do too.
        fitted = self.schema.scene(values)
        if left := self.outside(fitted.vector):
            raise ObservationError(f"a dream can't begin here: {left}")
        return fitted.vector

    def real_start(self, seed: int, options: Mapping[str, Any]) -> Float1D:
        """State vector after a reset of the real env's copy."""
        assert self.world is not None, "asked only where there is a real env"
        observation, _ = self.world.reset(seed=seed, options=dict(options))
        return self.fitted(self.schema.scene(observation))

    @cached_property
    def pool(self) -> Float2D:
        """State vectors of `starts`, shape ``(m, layout.width)``.

        Raises
        ------
        ConfigError
            There are none.
        """
        if not self.starts:
            raise ConfigError(
                "nothing says where a dream begins: pass options={'scene': scene} to reset, or start=function or "
                "like=env to the env"
            )
        return np.array([self.fitted(scene) for scene in self.starts])


def check_knowledge(model: WorldModel) -> None:
    """Raise `QueryError` for a model that knows none of its targets: every dream would end at once, or stand still."""
    if not any(model.governs(t) or model.modes(t.type, t.property) for t in model.targets):
        targets = [str(t) for t in model.targets]
        raise QueryError(
            f"the model knows none of its targets {targets} after {model.seen} transitions, so there is nothing to "
            "dream of: let a ModelLearner around the real env act and learn first"
        )


def _recorded(model: WorldModel) -> EnvRecord:
    """What the model's file says of its env."""
    if not model.extra:
        raise ConfigError(
            "the model holds no spaces: pass like=env, or learn it with a ModelLearner around an env"
        )
    return EnvRecord.from_json(model.extra, model.schema)


def _present(scene: Scene) -> SceneSchema:
    """The scene's schema with only the objects that are there, besides action and task."""
    names = {*scene.layout.names, ACTION, TASK}
    return replace(scene.schema, objects=tuple(pair for pair in scene.schema.objects if pair[0] in names))


def _of_scene(scene: Scene, model: WorldModel, schema: SceneSchema) -> EnvRecord:
    """Spaces for a scene's objects: each has the bounds of the recorded objects of its type."""
    record = _recorded(model)
    known = _boxes(record.observation_space, model.schema).spaces
    bounds = {model.schema.type_of(name).name: box for name, box in known.items()}
    seen: dict[str, spaces.Space[Any]] = {}
    for name, type_name in schema.objects:
        if name not in (ACTION, TASK):
            if type_name not in bounds:
                raise ConfigError(
                    f"like=scene: no bounds are known for object {name!r}, since the model's env showed none of "
                    f"type {type_name!r} (it showed {sorted(bounds)}); pass like=env instead"
                )
            seen[name] = bounds[type_name]
    return EnvRecord(spaces.Dict(seen), record.action_space, (scene,), record.metadata)


def _boxes(space: spaces.Space[Any], schema: SceneSchema) -> spaces.Dict:
    """The space, if it is a Dict of flat Boxes, one for each of some objects; `ConfigError` otherwise."""
    parts = space.spaces if isinstance(space, spaces.Dict) else {}
    fits = [
        isinstance(box, spaces.Box)
        and name in schema.order
        and box.shape == (len(schema.type_of(name).properties),)
        for name, box in parts.items()
    ]
    if not fits or not all(fits) or not isinstance(space, spaces.Dict):
        raise ConfigError(
            f"expected a Dict observation space, object name -> Box with a number for each property, for the objects "
            f"{[name for name in schema.order if name != ACTION]}, got {space}; wrap the dream as the env was"
        )
    return space
