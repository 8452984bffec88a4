"""What the records of parameters check of their fields, in words that name field, range and value."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np

from relgym.errors import ConfigError

__all__ = ["GREATEST_NOISE", "LEAST_NOISE", "at_least", "at_most", "checked_count", "one_of", "plain", "unit"]

LARGEST = 2**63 - 1
"""Whole numbers beyond this fit no file, and no seed."""

LEAST_NOISE, GREATEST_NOISE = 1e-100, 1e100
"""A noise beyond these can't be reckoned with: squares of some deviations would be zero or infinite."""


def plain(config: Any) -> None:
    """Make plain numbers of a record's fields, so that files can hold them.

    Raises
    ------
    ConfigError
        A field whose default is a whole number, a number or a truth value has something else.
    """
    for field in fields(config):
        value, usual = getattr(config, field.name), field.default
        if callable(getattr(value, "item", None)) and getattr(value, "ndim", 0) == 0:  # NumPy's
            value = value.item()
            object.__setattr__(config, field.name, value)
        kinds: tuple[type, ...] = ()
        if isinstance(usual, bool):
            kinds, said = (bool,), "True or False"
        elif isinstance(usual, int):
            kinds, said = (int,), "a whole number"
        elif isinstance(usual, float):
            kinds, said = (int, float), "a number"
        if kinds and (not isinstance(value, kinds) or (bool not in kinds and isinstance(value, bool))):
            raise ConfigError(f"{field.name} must be {said}, got {value!r}")
        if isinstance(value, float) and not math.isfinite(value):
            raise ConfigError(f"{field.name} must be finite, got {value!r}")
        if isinstance(value, int) and not -LARGEST <= value <= LARGEST:
            raise ConfigError(
                f"{field.name} must lie within ±2**63, got a number of {value.bit_length()} bits"
            )


def one_of(config: object, **allowed: tuple[str, ...]) -> None:
    """Raise `ConfigError` unless each of these fields has one of its allowed values."""
    for name, values in allowed.items():
        if getattr(config, name) not in values:
            raise ConfigError(f"{name} must be one of {values}, got {getattr(config, name)!r}")


def at_least(config: object, low: float, *names: str) -> None:
    """Raise `ConfigError` unless each of these fields is ``low`` or more."""
    for name in names:
        if not getattr(config, name) >= low:
            raise ConfigError(f"{name} must be at least {low}, got {getattr(config, name)!r}")


def at_most(config: object, **most: float) -> None:
    """Raise `ConfigError` unless each of these fields is no greater than what is given."""
    for name, limit in most.items():
        if not getattr(config, name) <= limit:
            raise ConfigError(f"{name} must be at most {limit:,}, got {getattr(config, name)!r}")


def unit(config: object, *names: str) -> None:
    """Raise `ConfigError` unless each of these fields lies in [0, 1]."""
    for name in names:
        if not 0 <= getattr(config, name) <= 1:
            raise ConfigError(f"{name} must lie in [0, 1], got {getattr(config, name)!r}")


def checked_count(what: str, count: Any, least: int, most: int) -> int:
    """`count` as an int; `ConfigError` unless it is a whole number within the limits."""
    if not isinstance(count, (int, np.integer)) or isinstance(count, bool) or not least <= count <= most:
        raise ConfigError(f"{what}={count!r}: expected a whole number from {least} to {most}")
    return int(count)
