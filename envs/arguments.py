"""Checks of env arguments that several envs share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from relgym.errors import ConfigError

__all__ = ["Coefficient", "checked_count", "counted", "numbered", "per_object"]

Coefficient: TypeAlias = float | Mapping[str, float]
"""One number for all objects, or numbers by object name or kind."""


def checked_count(what: str, count: Any, least: int, most: int) -> int:
    """`count` as an int; `ConfigError` unless it is a whole number within the limits."""
    if not isinstance(count, (int, np.integer)) or isinstance(count, bool) or not least <= count <= most:
        raise ConfigError(f"{what}={count!r}: expected a whole number from {least} to {most}")
    return int(count)


def numbered(kind: str, count: int) -> tuple[str, ...]:
    """Names of `count` objects of a kind: ``ball``, ``ball2``, ``ball3``."""
    return tuple(kind if k == 1 else f"{kind}{k}" for k in range(1, count + 1))


def counted(objects: Sequence[str] | Mapping[str, int], kinds: Sequence[str]) -> dict[str, str]:
    """Name and kind of each object in a list of kinds, or in a mapping from kind to count."""
    if isinstance(objects, str):
        raise ConfigError(
            f"objects={objects!r}: expected a sequence such as ({objects!r},) or counts by kind"
        )
    given = list(objects)
    unknown = sorted({str(kind) for kind in given if kind not in kinds})
    if unknown:
        raise ConfigError(f"objects: unknown kinds {unknown}; expected {tuple(kinds)}")
    counts = objects if isinstance(objects, Mapping) else {kind: given.count(kind) for kind in given}
    checked = {kind: checked_count(f"objects[{kind!r}]", count, 0, 100) for kind, count in counts.items()}
    return {name: kind for kind, count in checked.items() for name in numbered(kind, count)}


def per_object(
    what: str, value: Coefficient, kinds: Mapping[str, str], default: float, span: tuple[float, float]
) -> dict[str, float]:
    """The value for each object of `kinds` (name to kind): its own entry, else its kind's, else the default.

    Raises
    ------
    ConfigError
        An unknown name or kind, or a number outside `span`.
    """
    given: Mapping[str, float] = value if isinstance(value, Mapping) else dict.fromkeys(kinds, value)
    legal = {*kinds, *kinds.values()}
    unknown = sorted(set(given) - legal)
    if unknown:
        raise ConfigError(f"{what}: unknown objects {unknown}; expected names or kinds among {sorted(legal)}")
    for key, number in given.items():
        if not _is_number(number) or not span[0] <= number <= span[1]:
            raise ConfigError(
                f"{what}={number!r} (for {key!r}): expected a number from {span[0]:g} to {span[1]:g}"
            )
    return {name: float(given.get(name, given.get(kind, default))) for name, kind in kinds.items()}


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
