"""Which view of an env is meant by ``--view`` and ``--names``."""

from __future__ import annotations

import inspect
import json
from pathlib import Path
from typing import Any

import gymnasium as gym

from relgym.console.envs import imported
from relgym.console.suggestions import did_you_mean
from relgym.envs.views import NumbersView, Part, Rows, Static, TableView, View
from relgym.errors import ConfigError, RelgymError
from relgym.scene.shapes import Box, Sphere
from relgym.wrappers.views import chosen_view

__all__ = ["KINDS", "view_named"]

KINDS = ("auto", "numbers")
"""Views that have a name."""

_MAKERS: dict[str, type[Any]] = {"numbers": NumbersView, "table": TableView}
"""Views that a file can describe, by its entry ``kind``."""

_RECORDS: dict[str, type[Any]] = {"parts": Part, "rows": Rows, "static": Static}
_SHAPES: dict[str, type[Any]] = {"box": Box, "sphere": Sphere}


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
        ``auto`` or None: the env's own objects, or else its numbers; ``numbers``; ``FILE.json``, its ``kind``
        (``numbers`` or ``table``) and the arguments of `NumbersView` or `TableView` beside the spaces; or
        ``MODULE:NAME``, a view or a function of (observation space, action space) that makes one.
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
        given = _imported(text, env)
    elif text not in (None, "auto"):
        raise ConfigError(
            f"--view {text}: expected {', '.join(KINDS)}, a FILE.json or MODULE:NAME{did_you_mean(str(text), KINDS)}"
        )
    return chosen_view(given, *spaces, schema=schema, reward=reward, terminated=terminated)


def _from_file(text: str, env: gym.Env[Any, Any]) -> View:
    """The view that a file describes: a kind, and what its maker takes beside the spaces."""
    try:
        data = dict(json.loads(Path(text).read_text(encoding="utf-8")))
    except OSError as error:
        raise ConfigError(f"--view {text} can't be read ({error.strerror}); expected a file") from None
    except (ValueError, TypeError) as error:
        raise ConfigError(f"--view {text}: expected a JSON object, but {error}") from None
    kind = data.pop("kind", None)
    if kind not in _MAKERS:
        raise ConfigError(f"--view {text}: kind {kind!r}; expected one of {sorted(_MAKERS)}")
    known = list(inspect.signature(_MAKERS[kind]).parameters)[2:]
    if unknown := sorted(set(data) - set(known)):
        wrong = unknown[0]
        raise ConfigError(
            f"--view {text}: no entry {wrong!r}{did_you_mean(wrong, known)}; expected {', '.join(known)}"
        )
    try:
        given = {name: [_record(name, each) for each in data.pop(name)] for name in _RECORDS if name in data}
        view: View = _MAKERS[kind](env.observation_space, env.action_space, **data, **given)
        return view
    except RelgymError as error:
        raise ConfigError(f"--view {text}: {error}") from None
    except (TypeError, KeyError, AttributeError) as error:
        raise ConfigError(
            f"--view {text} can't be read: {error}; see relgym.wrappers.{_MAKERS[kind].__name__}"
        ) from None


def _record(name: str, entry: Any) -> Any:
    """A part, a row or a static object, whose shape is named."""
    given = dict(entry)
    if isinstance(shape := given.get("shape"), str):
        given["shape"] = _SHAPES[shape]()
    return _RECORDS[name](**given)


def _imported(text: str, env: gym.Env[Any, Any]) -> Any:
    """What the user's module holds; called with the spaces where it is no view already."""
    module, _, name = text.partition(":")
    found = imported(module, f"--view {text}")
    if not hasattr(found, name):
        raise ConfigError(f"--view {text}: {module} has no {name!r}{did_you_mean(name, dir(found))}")
    given = getattr(found, name)
    if isinstance(given, View) or not callable(given):
        return given
    try:
        return given(env.observation_space, env.action_space)
    except RelgymError:
        raise
    except Exception as error:
        raise ConfigError(
            f"--view {text} fails with {type(error).__name__}: {error}; expected a view, or a function of (observation "
            "space, action space) that makes one"
        ) from None
