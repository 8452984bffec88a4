"""The regressors that relgym is compared with, in the order of the tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from relgym.baselines.base import Regressor
from relgym.baselines.fitted import FittedRegressor
from relgym.baselines.kinds import Baseline, Columns, Setting, grid, seed_of
from relgym.baselines.lwr import LocallyWeightedRegression
from relgym.baselines.model_tree import LinearModelTree
from relgym.baselines.motion import ConstantVelocity, Persistence
from relgym.baselines.rls import RecursiveLeastSquares
from relgym.baselines.streaming import StreamingRegressor

__all__ = ["REGRESSORS"]


def _gaussian_process(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    def make() -> Any:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

        shape = RBF(setting["length"]) if setting["kernel"] == "rbf" else Matern(setting["length"], nu=1.5)
        kernel = ConstantKernel(1.0) * shape + WhiteKernel(1e-6, (1e-12, 1e0))
        # Kept as set: the optimiser ends on its bounds here, and says so for every query.
        return GaussianProcessRegressor(kernel, optimizer=None, normalize_y=True)

    return FittedRegressor(make, rng=rng, limit=setting["limit"])


def _nearest(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    def make() -> Any:
        from sklearn.neighbors import KNeighborsRegressor

        return KNeighborsRegressor(setting["neighbours"], weights=setting["weights"])

    return FittedRegressor(make, rng=rng)


def _forest(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    seed = seed_of(rng)

    def make() -> Any:
        from sklearn.ensemble import RandomForestRegressor

        return RandomForestRegressor(50, random_state=seed, **setting)

    return FittedRegressor(make, rng=rng, scale=False)


def _boosting(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    seed = seed_of(rng)

    def make() -> Any:
        from sklearn.ensemble import HistGradientBoostingRegressor
        from sklearn.multioutput import MultiOutputRegressor

        return MultiOutputRegressor(HistGradientBoostingRegressor(random_state=seed, **setting))

    return FittedRegressor(make, rng=rng, scale=False)


def _model_tree(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    seed = seed_of(rng)
    return FittedRegressor(lambda: LinearModelTree(**setting, seed=seed), rng=rng)


def _perceptron(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    seed = seed_of(rng)

    def make() -> Any:
        from sklearn.neural_network import MLPRegressor

        return MLPRegressor(max_iter=30, tol=0.0, n_iter_no_change=30, random_state=seed, **setting)

    return FittedRegressor(make, rng=rng)


def _ensemble(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    from relgym.baselines.ensemble import MLPEnsemble

    return MLPEnsemble(train_every=200, seed=seed_of(rng), **setting)


def _interactions(setting: Setting, columns: Columns, rng: np.random.Generator) -> Regressor:
    from relgym.baselines.interaction import InteractionNetwork

    return InteractionNetwork(columns.own, columns.objects, seed=seed_of(rng), **setting)


def _rules(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    def make() -> Any:
        from river import rules

        return rules.AMRules(**setting)

    return StreamingRegressor(make)


def _hoeffding(setting: Setting, _: Columns, rng: np.random.Generator) -> Regressor:
    def make() -> Any:
        from river import tree

        return tree.HoeffdingTreeRegressor(**setting)

    return StreamingRegressor(make)


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
            lambda s, _, __: LocallyWeightedRegression(**s),
            grid("ridge", 1e-8, 1e-12, 1e-4, 1e-2, neighbours=50),
        ),
        Baseline[Regressor](
            "lwr-25",
            "LWR, k = 25",
            lambda s, _, __: LocallyWeightedRegression(**s),
            grid("ridge", 1e-8, 1e-12, 1e-4, 1e-2, neighbours=25),
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
            _gaussian_process,
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
            _nearest,
            (
                {"neighbours": 10, "weights": "distance"},
                {"neighbours": 1, "weights": "uniform"},
                {"neighbours": 3, "weights": "distance"},
                {"neighbours": 10, "weights": "uniform"},
            ),
            change=True,
        ),
        Baseline[Regressor](
            "forest",
            "random forest",
            _forest,
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
            _boosting,
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
            _model_tree,
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
            _perceptron,
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
            _rules,
            grid("n_min", 200, 50, 100, 500),
            change=True,
            package="river",
        ),
        Baseline[Regressor](
            "hoeffding",
            "Hoeffding tree (river)",
            _hoeffding,
            grid("grace_period", 200, 50, 100, 500),
            change=True,
            package="river",
        ),
    )
}
"""Regressors, in the order of the tables."""
