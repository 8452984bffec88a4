"""A model file together with the env that it speaks of: the one it was learned in, or another one like it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym

from relgym.console.envs import made
from relgym.console.suggestions import did_you_mean
from relgym.console.views import view_named
from relgym.envs.model_files import EnvRecord, schema_like
from relgym.envs.views import View, view_from_json
from relgym.errors import ConfigError, ModelFileError, ObservationError
from relgym.experiments.inspection import space_text
from relgym.model.world_model import WorldModel

__all__ = ["ModelInEnv", "checked_file", "loaded", "opened", "origin"]


@dataclass(frozen=True, slots=True)
class ModelInEnv:
    """A model, and an env to ask it about.

    Attributes
    ----------
    file
        Where the model lies.
    model
        The model.
    env_id, arguments
        What the env was made of.
    env
        The env.
    view
        How the model sees it.
    """

    file: Path
    model: WorldModel
    env_id: str
    arguments: Mapping[str, Any]
    env: gym.Env[Any, Any]
    view: View


def checked_file(path: Path) -> Path:
    """The path of a file that is there; `ModelFileError` with the nearest name where it isn't."""
    if path.is_dir():
        models = sorted(p.name for p in path.iterdir() if p.suffix in (".json", ".relgym"))
        inside = f"; in it are {', '.join(models[:5])}" if models else ""
        raise ModelFileError(f"{path} is a folder: expected a model's file{inside}")
    if not path.exists():
        folder = path.parent
        near = did_you_mean(path.name, [p.name for p in folder.iterdir()]) if folder.is_dir() else ""
        raise ModelFileError(
            f"there is no file {path}{near}\n`relgym learn ENV --out {path}` learns a model and writes it"
        )
    return path


def loaded(path: Path) -> WorldModel:
    """The model in a file; `ModelFileError` where there is none."""
    return WorldModel.load(checked_file(path))


def origin(model: WorldModel) -> Mapping[str, Any]:
    """What a model's file says of how its env was made: see `relgym.envs.model_files.made_how`."""
    return dict(model.extra.get("metadata") or {})


def opened(
    path: Path, env_id: str | None = None, arguments: Mapping[str, Any] | None = None, view: str | None = None
) -> ModelInEnv:
    """Read a model and make its env again.

    Parameters
    ----------
    path
        The model's file.
    env_id
        Another env; default: the one that the file names.
    arguments
        Of the env, in place of those that the file names.
    view
        As ``--view``; default: the file's, or the env's own.

    Raises
    ------
    ModelFileError
        The file is no model.
    ConfigError
        The file doesn't name an env, the env can't be made, or the model can't speak of it.
    """
    model = loaded(path)
    how = origin(model)
    name = env_id or how.get("env")
    if not name:
        raise ConfigError(f"{path} doesn't say which env it was learned in: name it with --env ID")
    own = name.rpartition(":")[2] == how.get("env")
    given = (dict(how.get("arguments", {})) if own else {}) | dict(arguments or {})
    if lost := [each for each in how.get("omitted", ()) if own and each not in given]:
        raise ConfigError(
            f"{path}: its env was made with {', '.join(lost)}, which a file can't hold; give each with "
            "--arg NAME=VALUE, or evaluate it from Python"
        )
    env = made(name, given)
    found = ModelInEnv(path, model, name, given, env, _view(model, env, view))
    _check(found, how)
    return found


def _view(model: WorldModel, env: gym.Env[Any, Any], text: str | None) -> View:
    held = dict(model.extra.get("view") or {})
    reward, terminated = bool(held.get("reward")), bool(held.get("terminated"))
    state = held.get("view", held) if held.get("kind") == "task" else held
    if text is not None or not held or state.get("kind") == "scene":
        return view_named(env, text, reward=reward, terminated=terminated)
    if state.get("kind") == "function":
        raise ConfigError(
            "the model's view is a function, and a file can't hold one: name it, --view MODULE:NAME"
        )
    return view_from_json(held)


def _check(found: ModelInEnv, how: Mapping[str, Any]) -> None:
    """Whether the model can speak of what the env shows; `ConfigError` where it can't."""
    try:
        schema_like(found.view.schema, found.model.schema, found.env_id)
        found.view.scene(*found.env.reset(seed=0))
    except (ConfigError, ObservationError) as error:
        wrapped = f", in the wrappers {', '.join(how['wrappers'])}" if how.get("wrappers") else ""
        raise ConfigError(
            f"{found.file} is a model of {how.get('env', 'another env')}{wrapped}, and can't speak of {found.env_id}: "
            f"{_difference(found) or error}\n`relgym learn {found.env_id} --out FILE` learns one that can"
        ) from None


def _difference(found: ModelInEnv) -> str:
    """How the spaces differ; empty where they don't, or where the file doesn't say."""
    try:
        record = EnvRecord.from_json(found.model.extra, found.model.schema)
    except ModelFileError:
        return ""
    then, now = (space_text(space) for space in (record.observation_space, found.env.observation_space))
    return "" if then == now else f"it was learned from {then}, and here is {now}"
