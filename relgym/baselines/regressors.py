"""The regressors that relgym is compared with, in the order of the tables."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Final

import numpy as np

from relgym.baselines.base import Regressor
from relgym.baselines.fitted import FittedRegressor
from relgym.baselines.kinds import Baseline, Columns, Setting, grid, seed_of
from relgym.baselines.lwr import LocallyWeightedRegression
from relgym.baselines.model_tree import LinearModelTree
from relgym.baselines.motion import ConstantVelocity, Persistence
from relgym.baselines.recipes import batch, lazily, stream
from relgym.baselines.rls import RecursiveLeastSquares
from relgym.baselines.streaming import StreamingRegressor

__all__ = ["REGRESSORS"]


def _gaussian_process(kernel: str, length: float) -> Any:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

    shape = RBF(length) if kernel == "rbf" else Matern(length, nu=1.5)
    whole = ConstantKernel(1.0) * shape + WhiteKernel(1e-6, (1e-12, 1e0))
    # Kept as set: the optimiser ends on its bounds here, and says so for every query.
    return GaussianProcessRegressor(whole, optimizer=None, normalize_y=True)


def _boosting(**setting: Any) -> Any:
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.multioutput import MultiOutputRegressor

    return MultiOutputRegressor(HistGradientBoostingRegressor(**setting))


def _lwr(setting: Setting, _: Columns, __: np.random.Generator) -> Regressor:
    return LocallyWeightedRegression(**setting)


def _ensemble(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    from relgym.baselines.ensemble import MLPEnsemble

    return MLPEnsemble(train_every=200, seed=seed_of(rng), **setting)


def _interactions(setting: Setting, columns: Columns, rng: np.random.Generator) -> Regressor:
    from relgym.baselines.interaction import InteractionNetwork

    return InteractionNetwork(columns.own, columns.objects, seed=seed_of(rng), **setting)


_fitted = partial(batch, FittedRegressor)
_forest = lazily("sklearn.ensemble:RandomForestRegressor")
_perceptron = lazily("sklearn.neural_network:MLPRegressor")
REGRESSORS: Final[Mapping[str, Baseline[Regressor]]] = {
    b.name: b
    for b in (
        Baseline[Regressor]("persistence", "persistence", lambda _, c, __: Persistence(c.velocity)),
        Baseline[Regressor](
            "constant-velocity", "constant velocity", lambda _, c, __: ConstantVelocity(c.velocity)
        ),
        Baseline[Regressor](
            "lwr-50",
            "LWR, k = 50",
            _lwr,
            grid("ridge", 1e-8, 1e-12, 1e-4, 1e-2, neighbours=50),
        ),
        Baseline[Regressor](
            "lwr-25",
            "LWR, k = 25",
            _lwr,
            grid("ridge", 1e-8, 1e-12, 1e-4, 1e-2, neighbours=25),
        ),
        *(
            Baseline[Regressor](
                f"lwr-{k}-printed",
                f"LWR, k = {k}, as printed",
                _lwr,
                ({"neighbours": k, "scale": False, "stepwise": True},),
            )
            for k in (50, 25)
        ),
        Baseline[Regressor](
            "rls",
            "recursive least squares",
            lambda s, _, __: RecursiveLeastSquares(**s),
            grid("forgetting", 1.0, 0.9999, 0.999, 0.99),
        ),
        Baseline[Regressor](
            "gp",
            "Gaussian process",
            _fitted(_gaussian_process),
            (
                {"kernel": "rbf", "length": 3.0, "limit": 1000},
                {"kernel": "rbf", "length": 10.0, "limit": 1000},
                {"kernel": "matern", "length": 3.0, "limit": 1000},
                {"kernel": "matern", "length": 10.0, "limit": 1000},
            ),
            change=True,
        ),
        Baseline[Regressor](
            "knn",
            "k nearest neighbours",
            _fitted(lazily("sklearn.neighbors:KNeighborsRegressor")),
            (
                {"n_neighbors": 10, "weights": "distance"},
                {"n_neighbors": 1, "weights": "uniform"},
                {"n_neighbors": 3, "weights": "distance"},
                {"n_neighbors": 10, "weights": "uniform"},
            ),
            change=True,
        ),
        Baseline[Regressor](
            "forest",
            "random forest",
            _fitted(_forest, seeded=True, scale=False, n_estimators=50),
            (
                {"max_features": 1.0, "min_samples_leaf": 1},
                {"max_features": 0.33, "min_samples_leaf": 1},
                {"max_features": 1.0, "min_samples_leaf": 3},
                {"max_features": 0.33, "min_samples_leaf": 3},
            ),
            change=True,
        ),
        Baseline[Regressor](
            "boosting",
            "gradient boosting",
            _fitted(_boosting, seeded=True, scale=False),
            (
                {"learning_rate": 0.1, "max_iter": 100},
                {"learning_rate": 0.3, "max_iter": 100},
                {"learning_rate": 0.1, "max_iter": 200},
                {"learning_rate": 0.1, "max_iter": 100, "max_leaf_nodes": 63},
            ),
            change=True,
        ),
        Baseline[Regressor](
            "model-tree",
            "linear model tree",
            _fitted(LinearModelTree, seeded=True),
            (
                {"leaf": 30, "depth": 8},
                {"leaf": 10, "depth": 8},
                {"leaf": 30, "depth": 14},
                {"leaf": 10, "depth": 14},
            ),
            change=True,
        ),
        Baseline[Regressor](
            "mlp",
            "multi-layer perceptron",
            _fitted(_perceptron, seeded=True, max_iter=30, tol=0.0, n_iter_no_change=30),
            (
                {"hidden_layer_sizes": (64, 64), "learning_rate_init": 1e-3},
                {"hidden_layer_sizes": (64, 64), "learning_rate_init": 3e-3},
                {"hidden_layer_sizes": (128, 128), "learning_rate_init": 1e-3},
                {"hidden_layer_sizes": (128, 128), "learning_rate_init": 3e-3},
            ),
            change=True,
        ),
        Baseline[Regressor](
            "ensemble",
            "MLP ensemble (torch)",
            _ensemble,
            (
                {"hidden": 64, "train_steps": 100},
                {"hidden": 128, "train_steps": 100},
                {"hidden": 64, "train_steps": 100, "learning_rate": 3e-3},
                {"hidden": 128, "train_steps": 100, "learning_rate": 3e-3},
            ),
            change=True,
            package="torch",
        ),
        Baseline[Regressor](
            "interactions",
            "interaction network (torch)",
            _interactions,
            (
                {"hidden": 64, "learning_rate": 1e-3},
                {"hidden": 128, "learning_rate": 1e-3},
                {"hidden": 64, "learning_rate": 3e-3},
                {"hidden": 128, "learning_rate": 3e-3},
            ),
            change=True,
            package="torch",
        ),
        Baseline[Regressor](
            "amrules",
            "AMRules (river)",
            stream(StreamingRegressor, lazily("river.rules:AMRules")),
            grid("n_min", 200, 50, 100, 500),
            change=True,
            package="river",
        ),
        Baseline[Regressor](
            "hoeffding",
            "Hoeffding tree (river)",
            stream(StreamingRegressor, lazily("river.tree:HoeffdingTreeRegressor")),
            grid("grace_period", 200, 50, 100, 500),
            change=True,
            package="river",
        ),
    )
}
"""Regressors, in the order of the tables."""
