"""The classifiers of modes that relgym is compared with, in the order of the tables."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

from relgym.baselines.base import Classifier
from relgym.baselines.fitted import FittedClassifier
from relgym.baselines.kinds import Baseline, grid
from relgym.baselines.recipes import batch, lazily, stream
from relgym.baselines.streaming import StreamingClassifier

__all__ = ["CLASSIFIERS"]

_fitted = partial(batch, FittedClassifier)
_nearest = _fitted(lazily("sklearn.neighbors:KNeighborsClassifier"))
_svm = lazily("sklearn.svm:SVC")
_quadratic = _fitted(_svm, kernel="poly", degree=2, coef0=1.0, cache_size=500)
_forest = lazily("sklearn.ensemble:RandomForestClassifier")
_boosting = lazily("sklearn.ensemble:HistGradientBoostingClassifier")

CLASSIFIERS: Final[Mapping[str, Baseline[Classifier]]] = {
    b.name: b
    for b in (
        # As the thesis ran them (§4.7.2): MATLAB's svmtrain scales features and takes C = 1; all examples count.
        Baseline[Classifier]("svm-printed", "SVM, quadratic, as printed", _quadratic, ({"C": 1.0},)),
        Baseline[Classifier](
            "knn-10-printed", "KNN, k = 10, as printed", _nearest, ({"scale": False, "n_neighbors": 10},)
        ),
        Baseline[Classifier](
            "svm", "SVM, quadratic", _quadratic, grid("C", 1.0, 0.1, 10.0, 100.0, limit=4000)
        ),
        Baseline[Classifier]("knn-10", "KNN, k = 10", _nearest, grid("scale", False, True, n_neighbors=10)),
        Baseline[Classifier]("knn-1", "KNN, k = 1", _nearest, grid("scale", False, True, n_neighbors=1)),
        Baseline[Classifier](
            "forest",
            "random forest",
            _fitted(_forest, seeded=True, scale=False, n_estimators=50),
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
            _fitted(_boosting, seeded=True, scale=False, early_stopping=False),
            (
                {"learning_rate": 0.1, "max_iter": 50},
                # Rare modes need the penalty: without one their leaves' values run away.
                {"learning_rate": 0.1, "max_iter": 50, "l2_regularization": 1.0},
                {"learning_rate": 0.1, "max_iter": 100, "l2_regularization": 10.0},
                {"learning_rate": 0.1, "max_iter": 100, "l2_regularization": 1.0, "min_samples_leaf": 5},
            ),
        ),
        Baseline[Classifier](
            "hoeffding",
            "Hoeffding tree (river)",
            stream(StreamingClassifier, lazily("river.tree:HoeffdingTreeClassifier")),
            grid("grace_period", 200, 50, 100, 500),
            package="river",
        ),
    )
}
"""Classifiers, in the order of the tables."""
