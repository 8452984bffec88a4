"""An env of an id and arguments, made with errors that say what there is."""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec, load_env_creator

import relgym  # noqa: F401 - registers the envs
from relgym.console.suggestions import did_you_mean, nearest
from relgym.errors import ConfigError, RelgymError

__all__ = ["arguments_of", "here", "imported", "listing", "made", "signature_text"]

_VERSION = re.compile(r"-v\d+$")

_FOR_MAKE = ("max_episode_steps", "disable_env_checker")
"""Arguments that ``gym.make`` takes for itself."""


def made(env_id: str, arguments: Mapping[str, Any] | None = None) -> gym.Env[Any, Any]:
    """Make an env.

    Parameters
    ----------
    env_id
        An id as ``gym.make`` takes it; ``module:id`` imports a module that registers it, also from the current folder.
    arguments
        Of the env.

    Raises
    ------
    ConfigError
        An unknown id, an argument that the env doesn't have or doesn't take, or a package that isn't installed.
    """
    given = dict(arguments or {})
    spec = _spec(env_id)
    _check_names(spec, given)
    try:
        with here():
            return gym.make(spec.id, **given)
    except RelgymError:
        raise
    except gym.error.DependencyNotInstalled as error:
        raise ConfigError(f"{env_id} needs a package that isn't there: {error}") from None
    except ImportError as error:
        raise ConfigError(
            f"{env_id} can't be imported: {error}; install the package that it comes with"
        ) from None
    except Exception as error:  # whatever an env says of its arguments
        said = " ".join(f"--arg {name}={value}" for name, value in given.items()) or "no arguments"
        raise ConfigError(f"{env_id} can't be made with {said}: {error}{_listed(spec)}") from None


def arguments_of(spec: EnvSpec) -> dict[str, inspect.Parameter] | None:
    """What an env's maker takes, by name; None where anything goes (``**kwargs``), or nobody knows."""
    try:
        maker = spec.entry_point if callable(spec.entry_point) else load_env_creator(str(spec.entry_point))
        found = dict(inspect.signature(maker).parameters)
    except (
        Exception
    ):  # what it is made of can't be imported, or says nothing of its arguments: making it will tell
        return None
    if any(p.kind in (p.VAR_KEYWORD, p.VAR_POSITIONAL) for p in found.values()):
        return None
    return {name: p for name, p in found.items() if name not in ("self", "render_mode")}


@contextmanager
def here() -> Iterator[None]:
    """Modules of the current folder can be imported, as with ``python -m``; those that are installed go first."""
    folder = str(Path.cwd())
    added = folder not in sys.path
    if added:
        sys.path.append(folder)
        importlib.invalidate_caches()
    try:
        yield
    finally:
        if added and folder in sys.path:
            sys.path.remove(folder)


def imported(module: str, why: str) -> ModuleType:
    """A module that is installed or lies in the current folder; `ConfigError` where it can't be imported.

    Parameters
    ----------
    module
        Its name.
    why
        What asked for it, for the error.
    """
    try:
        with here():
            return importlib.import_module(module)
    except ImportError as error:
        raise ConfigError(
            f"{why}: the module {module!r} can't be imported ({error}); expected one that is installed or lies in "
            "this folder"
        ) from None


def listing(*, every: bool = False) -> dict[str, str]:
    """Ids of relgym's own envs and what each is in a line; with `every` those of all envs, and where they are from."""
    found = {}
    for spec in gym.registry.values():
        if spec.namespace == "relgym":
            found[spec.id] = (load_env_creator(str(spec.entry_point)).__doc__ or "").split("\n")[0]
        elif every:
            found[spec.id] = str(spec.entry_point).partition(":")[0]
    return found


def signature_text(env: gym.Env[Any, Any]) -> str:
    """Arguments that an env's maker takes, with their defaults, as text."""
    known = None if env.spec is None else arguments_of(env.spec)
    if known is None:
        return "its own; see its documentation"
    return _shown(known) if known else "none"


def _spec(env_id: str) -> EnvSpec:
    module, colon, name = env_id.rpartition(":")
    if colon:
        imported(module, env_id)
    if name not in gym.registry:
        raise ConfigError(_unknown(name))
    return gym.registry[name]


def _unknown(name: str) -> str:
    known = sorted(gym.registry)
    family, space = _VERSION.sub("", name), name.rpartition("/")[0]
    kin = [each for each in known if _VERSION.sub("", each).lower() == family.lower()]
    if space and space not in {each.rpartition("/")[0] for each in known} and not nearest(name, known):
        return (
            f"there is no env {name!r}: nothing that is installed here registers {space!r} by itself; install its "
            f"package, and name the module that registers it, MODULE:{name}"
        )
    found = f"; there is {' and '.join(kin)}" if kin else did_you_mean(name, known)
    return (
        f"there is no env {name!r}{found}\n`relgym envs --all` lists all that are installed; one of your own is "
        f"MODULE:ID, where the module registers it"
    )


def _check_names(spec: EnvSpec, given: Mapping[str, Any]) -> None:
    known = arguments_of(spec)
    if known is None:
        return
    for name in given:
        if name not in known and name not in _FOR_MAKE and name != "render_mode":
            raise ConfigError(
                f"{spec.id} has no argument {name!r}{did_you_mean(name, (*known, *_FOR_MAKE))}{_listed(spec)}"
            )
    needed = [
        name for name, p in known.items() if p.default is p.empty and name not in {*given, *spec.kwargs}
    ]
    if needed:
        raise ConfigError(
            f"{spec.id} needs {' and '.join(f'--arg {name}=VALUE' for name in needed)}{_listed(spec)}"
        )


def _listed(spec: EnvSpec) -> str:
    known = arguments_of(spec)
    if known is None:
        return ""
    return f"\nIts arguments: {_shown(known)}{', ' if known else ''}max_episode_steps"


def _shown(known: Mapping[str, inspect.Parameter]) -> str:
    return ", ".join(n if p.default is p.empty else f"{n}={p.default!r}" for n, p in known.items())
