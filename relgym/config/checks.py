"""What the records of parameters check of their fields, in words that name field, range and value."""

from __future__ import annotations

from relgym.errors import ConfigError

__all__ = ["at_least", "one_of", "unit"]


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


def unit(config: object, *names: str) -> None:
    """Raise `ConfigError` unless each of these fields lies in [0, 1]."""
    for name in names:
        if not 0 <= getattr(config, name) <= 1:
            raise ConfigError(f"{name} must lie in [0, 1], got {getattr(config, name)!r}")
