"""Recipes: how learners of other libraries are made from a setting; the same for regressors and classifiers."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeVar

import numpy as np

from relgym.baselines.kinds import Columns, Recipe, Setting, seed_of

__all__ = ["batch", "lazily", "stream"]

_T = TypeVar("_T")


def lazily(where: str) -> Callable[..., Any]:
    """A class of a library (``"sklearn.svm:SVC"``) that is imported when the first object of it is made."""
    module, _, name = where.partition(":")
    return lambda **options: getattr(import_module(module), name)(**options)


def batch(
    learner: Callable[..., _T],
    estimator: Callable[..., Any],
    *,
    seeded: bool = False,
    scale: bool = True,
    **fixed: Any,
) -> Recipe[_T]:
    """Recipe of a learner that fits an estimator to all that it has seen.

    Parameters
    ----------
    learner
        `relgym.baselines.fitted.FittedRegressor` or `FittedClassifier`.
    estimator
        Gives a new estimator from its options.
    seeded
        Whether it takes a ``random_state``.
    scale
        Whether features are scaled first; a setting of that name overrides it.
    fixed
        Options that tuning doesn't touch. ``limit``, here or in the setting, is the most examples it is fitted to.
    """

    def recipe(setting: Setting, _: Columns, rng: np.random.Generator) -> _T:
        options = {"scale": scale, "limit": None, **fixed, **setting}
        about = {name: options.pop(name) for name in ("scale", "limit")}
        if seeded:
            options["random_state"] = seed_of(rng)
        return learner(lambda: estimator(**options), rng=rng, **about)

    return recipe


def stream(learner: Callable[..., _T], estimator: Callable[..., Any]) -> Recipe[_T]:
    """Recipe of a learner around one of river's, which take examples one by one."""

    def recipe(setting: Setting, _: Columns, __: np.random.Generator) -> _T:
        return learner(lambda: estimator(**setting))

    return recipe
