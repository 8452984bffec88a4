"""What is written behind ``--arg``, ``--config`` and ``--features``, as the values that it stands for."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any

from relgym.clustering.features import known_kinds
from relgym.config import ClassificationConfig, ClusteringConfig, ModelConfig
from relgym.console.suggestions import did_you_mean
from relgym.errors import ConfigError

__all__ = ["config_keys", "config_of_options", "features_of", "pairs", "value_of"]

_PARTS: Mapping[str, type[Any]] = {"clustering": ClusteringConfig, "classification": ClassificationConfig}
_KIND = re.compile(r"(?:[^:]+:)?(?P<kind>\w+)(?:\([^()]*\))?")
_COMMA = re.compile(r",(?![^()]*\))")


def value_of(text: str) -> Any:
    """The value that a text stands for: JSON, a Python literal, or a plain word.

    Examples
    --------
    >>> [value_of(text) for text in ("0.9", "true", "None", "[1, 2]", "(1, 2)", "step")]
    [0.9, True, None, [1, 2], (1, 2), 'step']
    """
    for read in (json.loads, ast.literal_eval):
        try:
            return read(text)
        except (ValueError, SyntaxError):
            continue
    return text


def pairs(option: str, texts: Iterable[str] | None) -> dict[str, Any]:
    """``NAME=VALUE``, as often as it was given.

    Raises
    ------
    ConfigError
        No such pair, or a name that was given twice.
    """
    found: dict[str, Any] = {}
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise ConfigError(f"{option} {text}: expected NAME=VALUE, the value in JSON or a plain word")
        if name in found:
            raise ConfigError(f"{option} {name} was given twice; give it once")
        found[name] = value_of(value)
    return found


def features_of(texts: Iterable[str] | None) -> tuple[str, ...]:
    """Names of features, separated by commas outside brackets.

    Examples
    --------
    >>> features_of(["trig(x, v),products", "drag"])
    ('trig(x, v)', 'products', 'drag')
    """
    found = [name.strip() for text in texts or () for name in _COMMA.split(text)]
    return tuple(dict.fromkeys(name for name in found if name))


def _known(entries: tuple[str, ...]) -> tuple[str, ...]:
    """The entries; `ConfigError` where one is of no known kind."""
    for entry in entries:
        match = _KIND.fullmatch(entry)
        if match is None or match["kind"] not in known_kinds():
            kind = match["kind"] if match else entry
            raise ConfigError(
                f"--features {entry}: unknown{did_you_mean(kind, known_kinds())}\nFeatures: "
                f"{', '.join(known_kinds())}; also trig(PROPERTY), and TYPE:FEATURE for one type only"
            )
    return entries


def config_keys() -> tuple[str, ...]:
    """All parameters that ``--config`` knows, such as ``seed`` and ``clustering.draws``."""
    whole = [f.name for f in fields(ModelConfig) if f.name not in (*_PARTS, "features")]
    return tuple(whole + [f"{part}.{f.name}" for part, kind in _PARTS.items() for f in fields(kind)])


def config_of_options(texts: Iterable[str] | None, features: Iterable[str] | None) -> ModelConfig:
    """The parameters that ``--config KEY=VALUE`` and ``--features`` name; the others are the default.

    Raises
    ------
    ConfigError
        An unknown key, or a value outside its range.
    """
    whole: dict[str, Any] = {"features": _known(features_of(features))}
    parts: dict[str, dict[str, Any]] = {part: {} for part in _PARTS}
    known = config_keys()
    for key, value in pairs("--config", texts).items():
        if key == "features":
            raise ConfigError(f"--config features={value}: give features by themselves, --features {value}")
        if key not in known:
            listed = ", ".join(name for name in known if "." not in name)
            raise ConfigError(
                f"--config {key}: no such parameter{did_you_mean(key, known)}\nParameters: {listed}, and those of "
                f"{' and '.join(_PARTS)}, such as clustering.draws; relgym.config says what each means"
            )
        part, dot, name = key.rpartition(".")
        (parts[part] if dot else whole)[name] = value
    try:
        return ModelConfig(**whole, **{part: _PARTS[part](**given) for part, given in parts.items()})
    except ConfigError as error:
        raise ConfigError(f"--config: {error}") from None
