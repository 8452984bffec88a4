"""All baselines by name: what they are, how they are made, and between which settings tuning may choose.

Every baseline has the same tuning budget: `BUDGET` settings, all tried on the same data.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, Final, Generic, TypeAlias, TypeVar

import numpy as np

from relgym.baselines.base import Classifier, Regressor
from relgym.baselines.fitted import FittedClassifier, FittedRegressor
from relgym.baselines.lwr import LocallyWeightedRegression
from relgym.baselines.model_tree import LinearModelTree
from relgym.baselines.motion import ConstantVelocity, Persistence
from relgym.baselines.rls import RecursiveLeastSquares
from relgym.baselines.streaming import StreamingClassifier, StreamingRegressor
from relgym.errors import ConfigError

__all__ = [
    "BUDGET",
    "CLASSIFIERS",
    "REGRESSORS",
    "Baseline",
    "Setting",
    "installed",
    "make_classifier",
    "make_regressor",
]

BUDGET: Final = 4
"""Settings tried for every baseline that has any."""

_T = TypeVar("_T")

Setting: TypeAlias = Mapping[str, Any]
"""Values of a baseline's parameters."""


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
        Gives a new learner from a setting, the columns of the velocity and a source of randomness.
    settings
        What tuning may choose from, the library's or the literature's default first; `BUDGET` of them, or a single
        one where there is nothing to choose.
    change
        Whether it is taught the change of a value rather than the value: today's habit, and kind to all that don't
        extrapolate. Linear ones don't care.
    library
        Import name of what it needs.
    """

    name: str
    title: str
    make: Callable[[Setting, tuple[int, ...], np.random.Generator], _T]
    settings: tuple[Setting, ...] = ({},)
    change: bool = False
    library: str = "sklearn"


def installed(among: Mapping[str, Baseline[Any]]) -> tuple[str, ...]:
    """Names of those whose library is installed."""
    return tuple(name for name, known in among.items() if find_spec(known.library) is not None)


def make_regressor(
    name: str, setting: Setting | None = None, *, velocity: Sequence[int], rng: np.random.Generator
) -> Regressor:
    """A new regressor of that name.

    Parameters
    ----------
    name
        One of `REGRESSORS`.
    setting
        Its parameters; default: the first of its settings.
    velocity
        Columns of the features that hold the present values of what is predicted.
    rng
        Source of everything random.
    """
    known = _known(REGRESSORS, name)
    return known.make(known.settings[0] if setting is None else setting, tuple(velocity), rng)


def make_classifier(name: str, setting: Setting | None = None, *, rng: np.random.Generator) -> Classifier:
    """A new classifier of that name, one of `CLASSIFIERS`; see `make_regressor`."""
    known = _known(CLASSIFIERS, name)
    return known.make(known.settings[0] if setting is None else setting, (), rng)


def _known(among: Mapping[str, Baseline[_T]], name: str) -> Baseline[_T]:
    if name not in among:
        raise ConfigError(f"baseline {name!r}: expected one of {sorted(among)}")
    return among[name]


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))


# ------------------------------------------------------------------ regressors
def _gaussian_process(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Regressor:
    def make() -> Any:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

        shape = RBF(setting["length"]) if setting["kernel"] == "rbf" else Matern(setting["length"], nu=1.5)
        kernel = ConstantKernel(1.0) * shape + WhiteKernel(1e-6, (1e-12, 1e0))
        # Kept as set: the optimiser ends on its bounds here, and says so for every query.
        return GaussianProcessRegressor(kernel, optimizer=None, normalize_y=True)

    return FittedRegressor(make, rng=rng, limit=setting["limit"])


def _nearest(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Regressor:
    def make() -> Any:
        from sklearn.neighbors import KNeighborsRegressor

        return KNeighborsRegressor(setting["neighbours"], weights=setting["weights"])

    return FittedRegressor(make, rng=rng)


def _forest(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Regressor:
    seed = _seed(rng)

    def make() -> Any:
        from sklearn.ensemble import RandomForestRegressor

        return RandomForestRegressor(50, random_state=seed, **setting)

    return FittedRegressor(make, rng=rng, scale=False)


def _boosting(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Regressor:
    seed = _seed(rng)

    def make() -> Any:
        from sklearn.ensemble import HistGradientBoostingRegressor
        from sklearn.multioutput import MultiOutputRegressor

        return MultiOutputRegressor(HistGradientBoostingRegressor(random_state=seed, **setting))

    return FittedRegressor(make, rng=rng, scale=False)


def _model_tree(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Regressor:
    seed = _seed(rng)
    return FittedRegressor(lambda: LinearModelTree(**setting, seed=seed), rng=rng)


def _perceptron(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Regressor:
    seed = _seed(rng)

    def make() -> Any:
        from sklearn.neural_network import MLPRegressor

        return MLPRegressor(max_iter=30, tol=0.0, n_iter_no_change=30, random_state=seed, **setting)

    return FittedRegressor(make, rng=rng)


def _ensemble(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Regressor:
    from relgym.baselines.ensemble import MLPEnsemble

    return MLPEnsemble(train_every=200, seed=_seed(rng), **setting)


def _rules(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Regressor:
    def make() -> Any:
        from river import rules

        return rules.AMRules(**setting)

    return StreamingRegressor(make)


def _hoeffding(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Regressor:
    def make() -> Any:
        from river import tree

        return tree.HoeffdingTreeRegressor(**setting)

    return StreamingRegressor(make)


def _grid(name: str, *values: Any, **fixed: Any) -> tuple[Setting, ...]:
    return tuple({name: value, **fixed} for value in values)


REGRESSORS: Final[Mapping[str, Baseline[Regressor]]] = {
    b.name: b
    for b in (
        Baseline[Regressor]("persistence", "persistence", lambda _, v, __: Persistence(v)),
        Baseline[Regressor]("constant-velocity", "constant velocity", lambda _, v, __: ConstantVelocity(v)),
        Baseline[Regressor](
            "lwr-50",
            "LWR, k = 50",
            lambda s, _, __: LocallyWeightedRegression(**s),
            _grid("ridge", 1e-8, 1e-12, 1e-4, 1e-2, neighbours=50),
        ),
        Baseline[Regressor](
            "lwr-25",
            "LWR, k = 25",
            lambda s, _, __: LocallyWeightedRegression(**s),
            _grid("ridge", 1e-8, 1e-12, 1e-4, 1e-2, neighbours=25),
        ),
        Baseline[Regressor](
            "rls",
            "recursive least squares",
            lambda s, _, __: RecursiveLeastSquares(**s),
            _grid("forgetting", 1.0, 0.9999, 0.999, 0.99),
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
            library="torch",
        ),
        Baseline[Regressor](
            "amrules",
            "AMRules (river)",
            _rules,
            _grid("n_min", 200, 50, 100, 500),
            change=True,
            library="river",
        ),
        Baseline[Regressor](
            "hoeffding",
            "Hoeffding tree (river)",
            _hoeffding,
            _grid("grace_period", 200, 50, 100, 500),
            change=True,
            library="river",
        ),
    )
}
"""Regressors, in the order of the tables."""


# ------------------------------------------------------------------ classifiers
def _svm(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Classifier:
    def make() -> Any:
        from sklearn.svm import SVC

        return SVC(kernel="poly", degree=2, coef0=1.0, cache_size=500, C=setting["C"])

    return FittedClassifier(make, rng=rng, limit=setting["limit"])


def _nearest_classifier(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Classifier:
    def make() -> Any:
        from sklearn.neighbors import KNeighborsClassifier

        return KNeighborsClassifier(setting["neighbours"])

    return FittedClassifier(make, rng=rng, scale=setting["scale"])


def _forest_classifier(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Classifier:
    seed = _seed(rng)

    def make() -> Any:
        from sklearn.ensemble import RandomForestClassifier

        return RandomForestClassifier(50, random_state=seed, **setting)

    return FittedClassifier(make, rng=rng, scale=False)


def _boosting_classifier(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Classifier:
    seed = _seed(rng)

    def make() -> Any:
        from sklearn.ensemble import HistGradientBoostingClassifier

        return HistGradientBoostingClassifier(random_state=seed, early_stopping=False, **setting)

    return FittedClassifier(make, rng=rng, scale=False)


def _hoeffding_classifier(setting: Setting, _: tuple[int, ...], rng: np.random.Generator) -> Classifier:
    def make() -> Any:
        from river import tree

        return tree.HoeffdingTreeClassifier(**setting)

    return StreamingClassifier(make)


CLASSIFIERS: Final[Mapping[str, Baseline[Classifier]]] = {
    b.name: b
    for b in (
        Baseline[Classifier]("svm", "SVM, quadratic", _svm, _grid("C", 1.0, 0.1, 10.0, 100.0, limit=4000)),
        Baseline[Classifier](
            "knn-10",
            "KNN, k = 10",
            _nearest_classifier,
            ({"neighbours": 10, "scale": False}, {"neighbours": 10, "scale": True}),
        ),
        Baseline[Classifier](
            "knn-1",
            "KNN, k = 1",
            _nearest_classifier,
            ({"neighbours": 1, "scale": False}, {"neighbours": 1, "scale": True}),
        ),
        Baseline[Classifier](
            "forest",
            "random forest",
            _forest_classifier,
            (
                {"max_features": "sqrt", "min_samples_leaf": 1},
                {"max_features": 0.33, "min_samples_leaf": 1},
                {"max_features": "sqrt", "min_samples_leaf": 3},
                {"max_features": 1.0, "min_samples_leaf": 1},
            ),
        ),
        Baseline[Classifier](
            "boosting",
            "gradient boosting",
            _boosting_classifier,
            (
                {"learning_rate": 0.1, "max_iter": 50},
                {"learning_rate": 0.03, "max_iter": 50},
                {"learning_rate": 0.1, "max_iter": 100},
                {"learning_rate": 0.03, "max_iter": 100},
            ),
        ),
        Baseline[Classifier](
            "hoeffding",
            "Hoeffding tree (river)",
            _hoeffding_classifier,
            _grid("grace_period", 200, 50, 100, 500),
            library="river",
        ),
    )
}
"""Classifiers, in the order of the tables."""
