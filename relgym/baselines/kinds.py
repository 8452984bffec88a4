"""What a baseline is: its name, how it is made, between which settings tuning may choose.

Every baseline has the same tuning budget: `BUDGET` settings, all tried on the same data.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeAlias, TypeVar

import numpy as np

__all__ = ["BUDGET", "Baseline", "Columns", "Recipe", "Setting", "grid", "seed_of"]

BUDGET: Final = 4
"""Settings tried for every baseline that has any."""

_T = TypeVar("_T")

Setting: TypeAlias = Mapping[str, Any]
"""Values of a baseline's parameters."""


@dataclass(frozen=True, slots=True)
class Columns:
    """What a baseline may know of the columns of its features.

    Attributes
    ----------
    velocity
        Those that hold the present values of what is predicted.
    own
        How many at the beginning are the target's own.
    objects
        How many objects follow, with equally many columns each.
    """

    velocity: tuple[int, ...]
    own: int = 1
    objects: int = 1


Recipe: TypeAlias = Callable[[Setting, Columns, np.random.Generator], _T]
"""Gives a new learner from a setting, what the columns mean and a source of randomness."""


@dataclass(frozen=True)
class Baseline(Generic[_T]):
    """One alternative.

    Attributes
    ----------
    name
        For the command line and the tables.
    title
        For people.
    make
        Makes it.
    settings
        What tuning may choose from, the library's or the literature's default first; `BUDGET` of them, or a single
        one where there is nothing to choose.
    change
        Whether it is taught the change of a value rather than the value: today's habit, and kind to all that don't
        extrapolate. Linear ones don't care.
    package
        Import name of what it needs.
    """

    name: str
    title: str
    make: Recipe[_T]
    settings: tuple[Setting, ...] = ({},)
    change: bool = False
    package: str = "sklearn"


def seed_of(rng: np.random.Generator) -> int:
    """A seed for libraries that take none but integers."""
    return int(rng.integers(2**31))


def grid(name: str, *values: Any, **fixed: Any) -> tuple[Setting, ...]:
    """Settings that differ in one parameter."""
    return tuple({name: value, **fixed} for value in values)
