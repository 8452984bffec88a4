"""All baselines by name, and new ones of them."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any, TypeVar

import numpy as np

from relgym.baselines.base import Classifier, Regressor
from relgym.baselines.classifiers import CLASSIFIERS
from relgym.baselines.kinds import BUDGET, Baseline, Columns, Setting
from relgym.baselines.regressors import REGRESSORS
from relgym.errors import ConfigError

__all__ = [
    "BUDGET",
    "CLASSIFIERS",
    "REGRESSORS",
    "Baseline",
    "Columns",
    "Setting",
    "installed",
    "make_classifier",
    "make_regressor",
]

_T = TypeVar("_T")


def installed(among: Mapping[str, Baseline[Any]]) -> tuple[str, ...]:
    """Names of those whose package is installed."""
    return tuple(name for name, known in among.items() if find_spec(known.package) is not None)


def make_regressor(
    name: str, setting: Setting | None = None, *, columns: Columns, rng: np.random.Generator
) -> Regressor:
    """A new regressor of that name.

    Parameters
    ----------
    name
        One of `REGRESSORS`.
    setting
        Its parameters; default: the first of its settings.
    columns
        What the columns of its features mean.
    rng
        Source of everything random.
    """
    known = _known(REGRESSORS, name)
    return known.make(known.settings[0] if setting is None else setting, columns, rng)


def make_classifier(name: str, setting: Setting | None = None, *, rng: np.random.Generator) -> Classifier:
    """A new classifier of that name, one of `CLASSIFIERS`; see `make_regressor`."""
    known = _known(CLASSIFIERS, name)
    return known.make(known.settings[0] if setting is None else setting, Columns(()), rng)


def _known(among: Mapping[str, Baseline[_T]], name: str) -> Baseline[_T]:
    if name not in among:
        raise ConfigError(f"baseline {name!r}: expected one of {sorted(among)}")
    return among[name]
