"""The classifiers of modes that relgym is compared with, in the order of the tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from relgym.baselines.base import Classifier
from relgym.baselines.fitted import FittedClassifier
from relgym.baselines.kinds import Baseline, Columns, Setting, grid, seed_of
from relgym.baselines.streaming import StreamingClassifier

__all__ = ["CLASSIFIERS"]


def _svm(setting: Setting, _: Columns, rng: np.random.Generator) -> Classifier:
    def make() -> Any:
        from sklearn.svm import SVC

        return SVC(kernel="poly", degree=2, coef0=1.0, cache_size=500, C=setting["C"])

    return FittedClassifier(make, rng=rng, limit=setting["limit"])


def _nearest_classifier(setting: Setting, _: Columns, rng: np.random.Generator) -> Classifier:
    def make() -> Any:
        from sklearn.neighbors import KNeighborsClassifier

        return KNeighborsClassifier(setting["neighbours"])

    return FittedClassifier(make, rng=rng, scale=setting["scale"])


def _forest_classifier(setting: Setting, _: Columns, rng: np.random.Generator) -> Classifier:
    seed = seed_of(rng)

    def make() -> Any:
        from sklearn.ensemble import RandomForestClassifier

        return RandomForestClassifier(50, random_state=seed, **setting)

    return FittedClassifier(make, rng=rng, scale=False)


def _boosting_classifier(setting: Setting, _: Columns, rng: np.random.Generator) -> Classifier:
    seed = seed_of(rng)

    def make() -> Any:
        from sklearn.ensemble import HistGradientBoostingClassifier

        return HistGradientBoostingClassifier(random_state=seed, early_stopping=False, **setting)

    return FittedClassifier(make, rng=rng, scale=False)


def _hoeffding_classifier(setting: Setting, _: Columns, rng: np.random.Generator) -> Classifier:
    def make() -> Any:
        from river import tree

        return tree.HoeffdingTreeClassifier(**setting)

    return StreamingClassifier(make)


CLASSIFIERS: Final[Mapping[str, Baseline[Classifier]]] = {
    b.name: b
    for b in (
        Baseline[Classifier]("svm", "SVM, quadratic", _svm, grid("C", 1.0, 0.1, 10.0, 100.0, limit=4000)),
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
            grid("grace_period", 200, 50, 100, 500),
            package="river",
        ),
    )
}
"""Classifiers, in the order of the tables."""
