"""What is shown a stream of transitions beside a model: learners of changes, online ones and ones that are fitted once.

All are behind `relgym.baselines.base.Regressor` and learn by how much properties change in a step, from the numbers of
the scene and the action.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any, Final

import numpy as np

from relgym.baselines.base import Float1D, Float2D, Regressor
from relgym.baselines.catalogue import installed
from relgym.baselines.fitted import FittedRegressor
from relgym.baselines.kinds import Baseline, Columns, Setting, seed_of
from relgym.baselines.recipes import batch, lazily, stream
from relgym.baselines.regressors import REGRESSORS
from relgym.baselines.rls import RecursiveLeastSquares
from relgym.baselines.streaming import StreamingRegressor
from relgym.errors import ConfigError

__all__ = [
    "CHANGES",
    "ONLINE",
    "LastChange",
    "NoChange",
    "along",
    "fitted_once",
    "predicted_changes",
    "titles",
]


class NoChange:
    """Persistence: nothing changes.

    Examples
    --------
    >>> guess = NoChange()
    >>> guess.learn_one(np.zeros(3), np.array([0.5, 1.0]))
    >>> guess.predict_one(np.zeros(3))
    array([0., 0.])
    """

    def __init__(self) -> None:
        self._said: Float1D = np.zeros(1)

    def learn_one(self, x: Float1D, y: Float1D) -> None:
        """Take note of how many values there are."""
        self._said = np.zeros(len(y))

    def predict_one(self, x: Float1D) -> Float1D:
        """What is said whatever the row, shape ``(m,)``."""
        return self._said

    def predict_batch(self, x: Float2D) -> Float2D:
        """The same for every row, shape ``(n, m)``."""
        return np.tile(self._said, (len(x), 1))


class LastChange(NoChange):
    """Constant velocity: what changed by so much in the last step does so again."""

    def learn_one(self, x: Float1D, y: Float1D) -> None:
        """Remember the change."""
        self._said = np.array(y, dtype=np.float64)


def _ensemble(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    from relgym.baselines.ensemble import MLPEnsemble

    return MLPEnsemble(seed=seed_of(rng), **setting)


_tree = lazily("sklearn.tree:DecisionTreeRegressor")
CHANGES: Final[Mapping[str, Baseline[Regressor]]] = {
    b.name: b
    for b in (
        Baseline[Regressor](
            "persistence", "persistence", lambda _, __, ___: NoChange(), change=True, package="numpy"
        ),
        Baseline[Regressor](
            "constant-velocity",
            "constant velocity",
            lambda _, __, ___: LastChange(),
            change=True,
            package="numpy",
        ),
        Baseline[Regressor](
            "rls",
            "RLS",
            lambda s, _, __: RecursiveLeastSquares(**s),
            change=True,
            package="numpy",
        ),
        Baseline[Regressor](
            "hoeffding",
            "Hoeffding tree",
            stream(StreamingRegressor, lazily("river.tree:HoeffdingTreeRegressor")),
            ({"grace_period": 200},),
            change=True,
            package="river",
        ),
        Baseline[Regressor](
            "amrules",
            "AMRules",
            stream(StreamingRegressor, lazily("river.rules:AMRules")),
            ({"n_min": 200},),
            change=True,
            package="river",
        ),
        Baseline[Regressor](
            "tree",
            "tree",
            partial(batch, FittedRegressor)(_tree, seeded=True, scale=False),
            ({"min_samples_leaf": 3},),
            change=True,
        ),
        Baseline[Regressor]("forest", "forest", REGRESSORS["forest"].make, change=True),
        Baseline[Regressor](
            "ensemble",
            "MLP ensemble",
            _ensemble,
            ({"hidden": 128, "train_steps": 3_000},),
            change=True,
            package="torch",
        ),
    )
}
"""Learners of changes by name, each with one setting, in the order of the tables."""

ONLINE: Final = ("persistence", "constant-velocity", "rls", "hoeffding", "amrules")
"""Those that learn from every transition as it comes; the others are fitted once."""


def predicted_changes(
    x: Float2D, change: Float2D, *, once: bool, seed: int = 0, last: Float2D | None = None
) -> dict[str, Float2D]:
    """What every learner whose package is installed says of a stream, before it is shown what came.

    Parameters
    ----------
    x, change
        Rows of numbers, shape ``(n, d)``, and what changed, shape ``(n, m)``, in the order in which they came; at least
        two.
    once
        Whether those that are fitted once are compared too: to the first half, of the second (NaN in the first).
    seed
        Of everything random.
    last
        What changed of the same object the step before, shape ``(n, m)``, if that isn't the row before.

    Returns
    -------
    By name, arrays of shape ``(n, m)``. Of the first row those that learn online say 0.

    Raises
    ------
    ConfigError
        Fewer than two rows: there is nothing to be said before what came.
    """
    if len(x) < 2:
        raise ConfigError(
            f"a stream of {len(x)} rows: expected at least two, one to learn from and one to predict"
        )
    found = {}
    for name in installed(CHANGES):
        if not once and name not in ONLINE:
            continue
        known = CHANGES[name]
        half: dict[str, Any] = {"train_every": len(x) // 2} if name == "ensemble" else {}
        learner = known.make({**known.settings[0], **half}, Columns(()), np.random.default_rng(seed))
        found[name] = (along if name in ONLINE else fitted_once)(learner, x, change)
    return found if last is None else {**found, "constant-velocity": last}


def titles(names: Iterable[str]) -> list[str]:
    """What tables call them; other learners keep their names."""
    return [CHANGES[name].title if name in CHANGES else name for name in names]


def along(learner: Regressor, x: Float2D, change: Float2D) -> Float2D:
    """What an online learner says of every row before it is shown what came; the first row teaches only."""
    found = np.zeros(change.shape)
    learner.learn_one(x[0], change[0])
    for k in range(1, len(x)):
        found[k] = learner.predict_one(x[k])
        learner.learn_one(x[k], change[k])
    return found


def fitted_once(learner: Regressor, x: Float2D, change: Float2D) -> Float2D:
    """What a learner that is shown the first half says of the second; NaN in the first."""
    half = len(x) // 2
    for row, y in zip(x[:half], change[:half], strict=True):
        learner.learn_one(row, y)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a single target is a column here, which scikit-learn warns of
        told = learner.predict_batch(x[half:])
    return np.concatenate([np.full((half, change.shape[1]), np.nan), told])
