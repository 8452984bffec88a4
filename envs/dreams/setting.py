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
from relgym.envs.dreams.rewards import TaskFunctions
from relgym.envs.dreams.shown import BoxesShown, Shown, ViewShown, checked_boxes, is_plain
from relgym.envs.flat import FlatSpec
from relgym.envs.model_files import EnvRecord, copied, schema_like, world_like
from relgym.envs.views import REWARD, TERMINATED, TaskView, View, view_from_json
from relgym.errors import ConfigError, ObservationError, QueryError
from relgym.model.protocol import SceneLearner
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, TASK, Float1D, Float2D, Scene, SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = ["Setting", "check_knowledge", "recorded"]


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
    shown
        How scenes become observations, and actions parts of scenes.
    view
        The view that the model was learned through, where scenes aren't shown as they are.
    world
        A copy of the real env, if one was given: it is reset for first scenes.
    starts
        First scenes known otherwise: those of the model's file, or the one that the dream was to be like.
    render_fps
        Pictures per second.
    """

    model: SceneLearner
    schema: SceneSchema
    observation_space: spaces.Space[Any]
    action_space: spaces.Space[Any]
    shown: Shown
    view: View | None
    world: gym.Env[Any, Any] | None
    starts: tuple[Scene, ...]
    render_fps: float

    @classmethod
    def of(
        cls,
        model: SceneLearner | str | os.PathLike[str],
        like: gym.Env[Any, Any] | Scene | None,
        view: View | None,
        *,
        snapshot: bool,
    ) -> Setting:
        """Put together what a model or its file, a real env or a scene, and a view say.

        Raises
        ------
        ConfigError
            No spaces, or spaces and objects that don't fit the model.
        ModelFileError
            The file is damaged, or the model was learned through a function that no file can hold.
        QueryError
            A model that won't learn any more knows none of its targets.
        """
        if like is not None and not isinstance(like, (gym.Env, Scene)):
            raise ConfigError(f"like={like!r}: expected an env (gym.make makes one of an id) or a Scene")
        if view is not None and not isinstance(view, View):
            raise ConfigError(
                f"view={view!r}: expected a view (relgym.envs.views), such as env.view of a ModelLearner"
            )
        model = _model(model, snapshot=snapshot)
        if model.frozen or snapshot:
            check_knowledge(model)
        scenic = isinstance(like, gym.Env) and _schema_of(like) is not None
        if view is None and not scenic and "view" in model.extra:
            view = view_from_json(model.extra["view"])
        if view is not None and not is_plain(view):
            return cls._viewed(model, like, _told(view, model.schema))
        world: gym.Env[Any, Any] | None = None
        if isinstance(like, Scene):
            schema = schema_like(_present(like), model.schema, "like=scene")
            record = _of_scene(like, model, schema)
        elif like is not None:
            world = world_like(like, model.schema)
            schema = schema_like(_schema_of(world), model.schema, f"like={like}")
            record = EnvRecord(world.observation_space, world.action_space, metadata=_metadata(world))
        else:
            schema, record = model.schema, recorded(model)
        check_action_space(schema, record.action_space)
        shown = BoxesShown(schema, record.observation_space, record.action_space)
        return cls._made(model, schema, record, shown, None, world)

    @classmethod
    def _viewed(cls, model: SceneLearner, like: gym.Env[Any, Any] | Scene | None, view: View) -> Setting:
        """The setting of a model that was learned through a view."""
        schema_like(view.schema, model.schema, "the view's scenes")
        if isinstance(like, Scene):
            raise ConfigError(
                "like=scene: the model was learned through a view, so bounds are known of observations only"
            )
        world: gym.Env[Any, Any] | None = None
        if like is None:
            record = recorded(model)
        else:
            world = copied(_seen_through(like, recorded(model)) if model.extra else like)
            record = EnvRecord(world.observation_space, world.action_space, metadata=_metadata(world))
        # Views of the user's own need not have it.
        if (check := getattr(view, "check_actions", None)) is not None:
            check(record.action_space)
        shown = ViewShown(view, record.observation_space, record.action_space)
        return cls._made(model, view.schema, record, shown, view, world)

    @classmethod
    def _made(
        cls,
        model: SceneLearner,
        schema: SceneSchema,
        record: EnvRecord,
        shown: Shown,
        view: View | None,
        world: gym.Env[Any, Any] | None,
    ) -> Setting:
        fps, spaces_of = (
            record.metadata.get("render_fps", 50),
            (record.observation_space, record.action_space),
        )
        return cls(model, schema, *spaces_of, shown, view, world, record.starts, fps)

    @property
    def scenic(self) -> bool:
        """Whether observations are scenes."""
        return isinstance(self.shown, BoxesShown)

    @property
    def layout(self) -> SceneLayout:
        """Layout of the scenes of a batch: what is shown, and the `task` object if there is one; no action."""
        return self.shown.layout

    @property
    def flat_spec(self) -> FlatSpec:
        """What flat views show unless told otherwise: what those of the real env do."""
        spec: FlatSpec = (
            FlatSpec() if self.world is None else getattr(self.world.unwrapped, "flat_spec", FlatSpec())
        )
        return spec

    @property
    def task(self) -> TaskFunctions | None:
        """What the real env asks of its agents, if it says so: an attribute ``task`` with functions of steps."""
        world = self.world
        task = (
            world.get_wrapper_attr("task") if world is not None and world.has_wrapper_attr("task") else None
        )
        told = all(callable(getattr(task, name, None)) for name in ("reward", "terminated"))
        return task if told else None  # an attribute of that name may be anything

    @cached_property
    def brought(self) -> NDArray[np.intp]:
        """Columns of the `task` object: before a step they are 0, for what it will bring isn't known."""
        if TASK not in self.layout.names:
            return np.zeros(0, dtype=np.intp)
        return np.arange(self.layout.width)[self.layout.slice(self.layout.index(TASK))]

    # ------------------------------------------------------------------ first scenes
    def fitted(self, scene: Scene) -> Scene:
        """A first scene as one of this setting's, without its action.

        Raises
        ------
        ObservationError
            Not a scene, other objects, or outside the observation space.
        """
        if not isinstance(scene, Scene):
            raise ObservationError(
                f"expected a start scene, got {type(scene).__name__}; take env.scene, or schema.scene(observation)"
            )
        values: dict[str, Any] = {name: v for name, v in scene.values().items() if name != ACTION}
        types = dict(zip(self.layout.names, self.layout.types, strict=True))
        if TASK in types:
            values[TASK] = np.zeros(len(types[TASK].properties))
        needed = {name for name, t in types.items() if not (self.view is not None and t.optional)}
        if not needed <= set(values) <= set(types):
            raise ObservationError(
                f"a dream can't begin here: expected the objects {sorted({*types} - {TASK})}, got "
                f"{[name for name in scene.layout.names if name != ACTION]}; for scenes with other objects pass "
                "like=scene, or an env that has them, when you make the dream"
            )
        # Through this schema: scenes of an equal one, or of another with the same objects, do too.
        fitted = self.schema.scene(values)
        (left,) = self.shown.outside(fitted.layout, fitted.vector[None])
        if left:
            raise ObservationError(f"a dream can't begin here: {left}")
        return fitted

    def fitted_vector(self, scene: Scene) -> Float1D:
        """State vector of a first scene in a batch, all of whose scenes have the same objects."""
        return self.vector_of(self.fitted(scene))

    def vector_of(self, scene: Scene) -> Float1D:
        """State vector of a fitted scene in a batch; `ObservationError` where some of its objects are missing."""
        if scene.layout != self.layout:
            raise ObservationError(
                f"many dreams at once have the same objects: expected {list(self.layout.names)}, got "
                f"{list(scene.layout.names)}; where objects come and go use LearnedModelEnv"
            )
        return scene.vector

    def real_start(self, seed: int, options: Mapping[str, Any]) -> Scene:
        """First scene after a reset of the real env's copy."""
        assert self.world is not None, "asked only where there is a real env"
        observation, info = self.world.reset(seed=seed, options=dict(options))
        seen = self.schema.scene(observation) if self.view is None else self.view.scene(observation, info)
        return self.fitted(seen)

    @cached_property
    def pool(self) -> tuple[Scene, ...]:
        """First scenes to draw from.

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
        return tuple(self.fitted(scene) for scene in self.starts)

    @cached_property
    def pool_vectors(self) -> Float2D:
        """State vectors of `pool`, shape ``(m, layout.width)``."""
        return np.array([self.vector_of(scene) for scene in self.pool])


def check_knowledge(model: SceneLearner) -> None:
    """Raise `QueryError` for a model that knows none of its targets: every dream would end at once, or stand still."""
    if not any(model.governs(t) or model.modes(t.type, t.property) for t in model.targets):
        targets = [str(t) for t in model.targets]
        raise QueryError(
            f"the model knows none of its targets {targets} after {model.seen} transitions, so there is nothing to "
            "dream of: let a ModelLearner around the real env act and learn first"
        )


def recorded(model: SceneLearner) -> EnvRecord:
    """What the model's file says of its env."""
    if not model.extra:
        raise ConfigError(
            "the model holds no spaces: pass like=env, or learn it with a ModelLearner around an env"
        )
    return EnvRecord.from_json(model.extra, model.schema)


def _model(given: Any, *, snapshot: bool) -> SceneLearner:
    """The model, a copy of it, or the one in a file."""
    if isinstance(given, SceneLearner):
        return copy.deepcopy(given) if snapshot else given
    if not isinstance(given, (str, os.PathLike)):
        raise ConfigError(
            f"model={given!r}: expected a WorldModel or the path of its file; a ModelLearner's is env.model"
        )
    return WorldModel.load(given)


def _schema_of(env: gym.Env[Any, Any]) -> SceneSchema | None:
    """The schema of an env whose observations are scenes."""
    schema = getattr(env.unwrapped, "schema", None)
    return schema if isinstance(schema, SceneSchema) else None


def _told(view: View, schema: SceneSchema) -> View:
    """The view, with what a step brings in it where the model has learned that."""
    if TASK not in schema.order or TASK in view.schema.order:
        return view
    told = schema.type_of(TASK).properties
    return TaskView(view, reward=REWARD in told, terminated=TERMINATED in told)


def _seen_through(like: gym.Env[Any, Any], known: EnvRecord) -> gym.Env[Any, Any]:
    """The outermost of an env's wrappers, or the env itself, that has the spaces that the model was learned in."""
    layer = like
    while (layer.observation_space, layer.action_space) != (known.observation_space, known.action_space):
        if not isinstance(layer, gym.Wrapper):
            raise ConfigError(
                f"like={like}: expected the spaces of the env that the model was learned in, "
                f"{known.observation_space} and {known.action_space}, got {like.observation_space} and "
                f"{like.action_space}; make it with the same arguments"
            )
        layer = layer.env
    return layer


def _present(scene: Scene) -> SceneSchema:
    """The scene's schema with only the objects that are there, besides action and task."""
    names = {*scene.layout.names, ACTION, TASK}
    return replace(scene.schema, objects=tuple(pair for pair in scene.schema.objects if pair[0] in names))


def _of_scene(scene: Scene, model: SceneLearner, schema: SceneSchema) -> EnvRecord:
    """Spaces for a scene's objects: each has the bounds of the recorded objects of its type."""
    record = recorded(model)
    known = checked_boxes(record.observation_space, model.schema)
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


def _metadata(world: gym.Env[Any, Any]) -> dict[str, Any]:
    return {"render_fps": world.metadata.get("render_fps", 50)}
