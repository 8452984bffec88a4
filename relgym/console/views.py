"""Which view of an env is meant by ``--view`` and ``--names``."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import gymnasium as gym

from relgym.console.envs import here
from relgym.console.suggestions import did_you_mean
from relgym.envs.spaces_json import space_to_json
from relgym.envs.views import NumbersView, View, view_from_json
from relgym.errors import ConfigError, RelgymError
from relgym.wrappers.views import chosen_view, settled

__all__ = ["KINDS", "settled_by_a_reset", "view_named"]

KINDS = ("auto", "numbers")
"""Views that have a name."""

_EMPTY: dict[str, dict[str, Any]] = {
    "flat": {
        "names": None,
        "parts": [],
        "angles": "auto",
        "actions": None,
        "static": [],
        "axes": ["y", True],
    },
    "table": {
        "columns": [],
        "rows": None,
        "presence": None,
        "match": None,
        "actions": None,
        "static": [],
        "axes": ["y", True],
    },
}
"""What a view's file may leave out, by its kind."""


def view_named(
    env: gym.Env[Any, Any],
    text: str | None,
    names: str | None = None,
    *,
    reward: bool = False,
    terminated: bool = False,
) -> View:
    """The view of an env that the options name.

    Parameters
    ----------
    env
        The env.
    text
        ``auto`` or None: the env's own objects, or else its numbers; ``numbers``; ``FILE.json``, what a view's
        `to_json` gives, without the spaces; or ``MODULE:NAME``, a view or a function of (observation space, action
        space) that makes one.
    names
        Names of the numbers, separated by commas.
    reward, terminated
        Whether these are learned too.

    Raises
    ------
    ConfigError
        There is no such view, or it doesn't fit the env.
    """
    spaces = env.observation_space, env.action_space
    schema = env.get_wrapper_attr("schema") if env.has_wrapper_attr("schema") else None
    given: Any = None
    if names is not None:
        if text not in (None, *KINDS):
            raise ConfigError(f"--names {names} goes with --view numbers alone, not with --view {text}")
        given = NumbersView(*spaces, names=[name.strip() for name in names.split(",")])
    elif text == "numbers":
        given = NumbersView(*spaces)
    elif text is not None and text.endswith(".json"):
        given = _from_file(text, env)
    elif text is not None and ":" in text:
        given = _imported(text)
    elif text not in (None, "auto"):
        raise ConfigError(
            f"--view {text}: expected {', '.join(KINDS)}, a FILE.json or MODULE:NAME{did_you_mean(str(text), KINDS)}"
        )
    return chosen_view(given, *spaces, schema=schema, reward=reward, terminated=terminated)


def settled_by_a_reset(view: View, env: gym.Env[Any, Any], seed: int) -> View:
    """The view with the angles that a first observation shows."""
    return settled(view, [env.reset(seed=seed)[0]])


def _from_file(text: str, env: gym.Env[Any, Any]) -> View:
    try:
        data = json.loads(Path(text).read_text(encoding="utf-8"))
        kind = {"numbers": "flat"}.get(data.get("kind"), data.get("kind"))
        spaces = {
            "observation": space_to_json(env.observation_space),
            "action": space_to_json(env.action_space),
        }
        if kind not in _EMPTY:
            raise ConfigError(f"kind {kind!r}; expected 'numbers' or 'table'")
        if unknown := sorted(set(data) - {"kind", "changes", "offsets", *spaces, *_EMPTY[kind]}):
            known = sorted(_EMPTY[kind])
            raise ConfigError(f"no entry {unknown[0]!r}{did_you_mean(unknown[0], known)}; expected {known}")
        return view_from_json({**_EMPTY[kind], **data, **spaces, "kind": kind})
    except OSError as error:
        raise ConfigError(f"--view {text} can't be read ({error.strerror}); expected a file") from None
    except RelgymError as error:
        raise ConfigError(f"--view {text}: {error}") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigError(f"--view {text} holds no view: {error!r}; see the guide to the console") from None


def _imported(text: str) -> Any:
    module, _, name = text.partition(":")
    try:
        with here():
            found = importlib.import_module(module)
    except ImportError as error:
        raise ConfigError(
            f"--view {text}: the module {module!r} can't be imported ({error}); expected one that is installed or lies "
            "in this folder"
        ) from None
    if not hasattr(found, name):
        raise ConfigError(f"--view {text}: {module} has no {name!r}{did_you_mean(name, dir(found))}")
    return getattr(found, name)
