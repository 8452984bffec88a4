"""Random draws that reset options can replace, so that every scene an env draws can also be asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from relgym.errors import ConfigError

__all__ = ["Draws", "Range"]

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Range:
    """Where a number is drawn from uniformly (`low` to `high`), and what an option may set it to."""

    low: float
    high: float
    least: float
    most: float


@dataclass
class Draws:
    """Draws quantities by name, unless an option gives them.

    A quantity is drawn even where an option replaces it: so one option changes nothing else of the scene.

    Attributes
    ----------
    taken : dict
        Every quantity so far. Given as options to another `Draws`, it repeats them whatever the generator.
    """

    options: Mapping[str, Any]
    rng: np.random.Generator
    taken: dict[str, Any] = field(default_factory=dict)

    def number(self, name: str, span: Range) -> float:
        """Draw uniformly from `span`; `ConfigError` when the option isn't a number it accepts."""
        return self._checked(name, self.options.get(name, self.rng.uniform(span.low, span.high)), span)

    def _checked(self, name: str, value: object, span: Range) -> float:
        if not isinstance(value, (int, float, np.integer, np.floating)) or not math.isfinite(value):
            raise ConfigError(f"option {name!r}: expected a finite number, got {value!r}")
        if not span.least <= value <= span.most:
            raise ConfigError(f"option {name!r}: expected {span.least} to {span.most}, got {value}")
        self.taken[name] = float(value)
        return float(value)

    def given(self, name: str, usual: float, span: Range) -> float:
        """What an option says, or `usual`: nothing is drawn."""
        return self._checked(name, self.options.get(name, usual), span)

    def choice(self, name: str, values: Sequence[T]) -> T:
        """Draw one of `values`; `ConfigError` when the option is none of them."""
        drawn = values[int(self.rng.integers(len(values)))]
        value: T = self.options.get(name, drawn)
        if isinstance(value, np.ndarray) or value not in values:
            raise ConfigError(f"option {name!r}: expected one of {list(values)}, got {value!r}")
        self.taken[name] = value
        return value

    def order(self, name: str, values: tuple[str, ...]) -> tuple[str, ...]:
        """Draw a permutation of `values`; `ConfigError` when the option is none."""
        drawn = tuple(values[int(i)] for i in self.rng.permutation(len(values)))
        given = self.options.get(name, drawn)
        value = tuple(map(str, given)) if isinstance(given, (Sequence, np.ndarray)) else ()
        if sorted(value) != sorted(values):
            raise ConfigError(f"option {name!r}: expected {list(values)} in some order, got {given!r}")
        self.taken[name] = value
        return value
