"""Which view of an env a learner takes: the user's, the env's own, or one that its spaces suggest."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from relgym.arguments import refusing
from relgym.envs.agents import AgentsSpace
from relgym.envs.arguments import action_parts, checked_action, checked_function
from relgym.envs.model_files import made_how
from relgym.envs.views import AgentsView, NumbersView, SceneView, TaskView, View, view_from_json
from relgym.errors import ActionError, ConfigError, RelgymError
from relgym.model.protocol import SceneLearner
from relgym.model.world_model import WorldModel
from relgym.scene.schema import SceneSchema

__all__ = [
    "SceneView",
    "View",
    "ViewLike",
    "chosen_view",
    "is_open",
    "metadata_of",
    "readable",
    "recordable",
    "remembered",
    "schema_of",
    "settled",
    "upheld",
    "view_of",
]

ViewLike: TypeAlias = View | Mapping[str, Any] | Callable[[spaces.Space[Any], spaces.Space[Any]], View] | None
"""A view, its JSON form, or a function of (observation space, action space) that makes one; ``None``: chosen."""


@refusing(ConfigError)
def view_of(
    env: gym.Env[Any, Any], given: ViewLike = None, *, reward: bool = False, terminated: bool = False
) -> View:
    """The view of an env.

    An env with a ``schema`` (`relgym.envs.SceneEnv`) shows scenes already, and one of several agents
    (`relgym.envs.AgentsEnv`) an object per agent. Any other is seen as numbers: one object, or one per key of a Dict
    (`NumbersView`).

    Parameters
    ----------
    env
        A single env.
    given, reward, terminated
        As of `chosen_view`.

    Raises
    ------
    ConfigError
        Images, tables and nested spaces, with what to do instead; or wrappers changed the spaces of a SceneEnv.
    """
    if not isinstance(env, gym.Env):
        raise ConfigError(f"expected an env, got {env!r}: gym.make makes one of an id")
    return chosen_view(
        given,
        env.observation_space,
        env.action_space,
        schema=schema_of(env),
        reward=reward,
        terminated=terminated,
    )


def schema_of(env: gym.Env[Any, Any]) -> SceneSchema | None:
    """The schema of an env whose observations are scenes; ``None`` of others."""
    schema = env.get_wrapper_attr("schema") if env.has_wrapper_attr("schema") else None
    return schema if isinstance(schema, SceneSchema) else None  # an attribute of that name may be anything


def metadata_of(env: gym.Env[Any, Any]) -> dict[str, Any]:
    """What model files say of an env: how it was made, and for renderers."""
    return made_how(env.spec) | {"render_fps": env.metadata.get("render_fps")}


def chosen_view(
    given: ViewLike,
    observation_space: spaces.Space[Any],
    action_space: spaces.Space[Any],
    *,
    schema: Any = None,
    reward: bool = False,
    terminated: bool = False,
) -> View:
    """The view to take.

    Parameters
    ----------
    given
        What the user passed.
    observation_space, action_space
        Spaces of a single env.
    schema
        The env's own, if it has one.
    reward, terminated
        Whether these are to be learned, as properties of `task`.

    Raises
    ------
    ConfigError
        As `view_of`, or `given` is no view, or one that was made for other actions.
    """
    view: Any
    if given is None:
        if isinstance(schema, SceneSchema):  # an attribute of that name may be anything
            view = SceneView(schema, observation_space, action_space)
        elif isinstance(observation_space, AgentsSpace):
            view = AgentsView(observation_space, action_space)
        else:
            view = NumbersView(observation_space, action_space)
    elif isinstance(given, Mapping):
        view = view_from_json(given)
    else:
        view = given
        if callable(given) and getattr(given, "__module__", "") != "builtins":
            view = checked_function("view", given, "observation_space", "action_space")(
                observation_space, action_space
            )
    if not isinstance(view, View):
        raise ConfigError(
            f"view={given!r}: expected a view (NumbersView, TableView, FunctionView, ...), or a function of "
            f"(observation_space, action_space) that makes one, got {type(view).__name__}"
        )
    # Views of the user's own need not have it.
    if (check := getattr(view, "check_actions", None)) is not None:
        check(action_space)
    return TaskView(view, reward=reward, terminated=terminated) if reward or terminated else view


def is_open(view: View) -> bool:
    """Whether a view wants to see first observations before its schema is final (`NumbersView.settled`)."""
    return isinstance(view, (NumbersView, TaskView)) and view.open


def settled(view: View, observations: Sequence[Any]) -> View:
    """The view with angles guessed from some first observations."""
    return view.settled(observations) if isinstance(view, (NumbersView, TaskView)) else view


def upheld(view: View, observation: Any) -> View:
    """The view without guessed angles that an observation refutes; itself where it refutes none."""
    return view.upheld(observation) if isinstance(view, (NumbersView, TaskView)) else view


def remembered(view: View, model: SceneLearner | str | os.PathLike[str]) -> View:
    """The view that a model or its file holds, where it differs from an open one in its angles at most.

    What was guessed of these when the model was learned stands, and so does what was taken back.

    Parameters
    ----------
    view
        The view of the env.
    model
        The model, or its file.
    """
    if not is_open(view):
        return view
    if isinstance(model, (str, os.PathLike)):
        extra = WorldModel.load_with_extra(model)[1]
    else:
        extra = model.extra
    held = extra.get("view")
    return view_from_json(held) if held and _but_angles(held) == _but_angles(view.to_json()) else view


def _but_angles(data: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: _but_angles(part) if name == "view" else part for name, part in data.items() if name != "angles"
    }


def recordable(given: ViewLike) -> ViewLike:
    """What the user passed as a view, as plain data where such data can say it: a spec may then be written as JSON."""
    if given is None or isinstance(given, Mapping) or not isinstance(given, View):
        return given
    try:
        data = given.to_json()
        view_from_json(data)
    except RelgymError:  # made of a function, of the user's own kind, or of a space that no file can hold
        return given
    return data


def readable(space: spaces.Space[Any], action: Any) -> Any:
    """An action as views may read it; ``None`` where none can.

    Whether an action is legal is for the env to say. One that lies outside its Box, and that the env takes all the
    same, is learned from as it was given; what the env makes of it (most clip it) is part of its laws. NaN, other
    shapes, and choices that a discrete space doesn't have can't be read.
    """
    if isinstance(space, (spaces.Dict, spaces.Tuple)):
        try:
            parts = action_parts(space, action)
        except ActionError:
            return None
        known = {key: readable(part, given) for key, part, given in parts}
        if any([part is None for part in known.values()]):
            return None
        return tuple(known.values()) if isinstance(space, spaces.Tuple) else known
    try:
        return checked_action(space, action)
    except ActionError:
        if not isinstance(space, spaces.Box):
            return None
    try:
        array = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return array if array.shape == space.shape and np.isfinite(array).all() else None
