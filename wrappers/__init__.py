"""Gymnasium wrappers that learn a model of the env they wrap; imported as ``relgym.wrappers``."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what checkers and editors see; at run time `__getattr__` loads it
    from relgym.envs.views import (
        AgentsView,
        Angle,
        FunctionView,
        NumbersView,
        Part,
        Rows,
        SceneView,
        Static,
        TableView,
        View,
    )
    from relgym.model.predicting.prequential import Prequential, StepReport
    from relgym.wrappers.action_repeat import ActionRepeat
    from relgym.wrappers.flat import FlatView, VectorFlatView
    from relgym.wrappers.model_learner import ModelLearner
    from relgym.wrappers.truncated_episodes import TruncatedEpisodes
    from relgym.wrappers.vector_model_learner import VectorModelLearner
    from relgym.wrappers.views import view_of

if __name__ != "relgym.wrappers":
    raise ImportError(
        f"this package is called relgym.wrappers, not {__name__!r}: a second copy of every class would "
        "follow; use `from relgym.wrappers import …`"
    )

_HOMES = {
    "ActionRepeat": "relgym.wrappers.action_repeat",
    "AgentsView": "relgym.envs.views",
    "Angle": "relgym.envs.views",
    "FlatView": "relgym.wrappers.flat",
    "FunctionView": "relgym.envs.views",
    "TruncatedEpisodes": "relgym.wrappers.truncated_episodes",
    "ModelLearner": "relgym.wrappers.model_learner",
    "NumbersView": "relgym.envs.views",
    "Part": "relgym.envs.views",
    "Prequential": "relgym.model.predicting.prequential",
    "Rows": "relgym.envs.views",
    "SceneView": "relgym.envs.views",
    "Static": "relgym.envs.views",
    "StepReport": "relgym.model.predicting.prequential",
    "TableView": "relgym.envs.views",
    "VectorFlatView": "relgym.wrappers.flat",
    "VectorModelLearner": "relgym.wrappers.vector_model_learner",
    "View": "relgym.envs.views",
    "view_of": "relgym.wrappers.views",
}
"""Where each public name lives; loaded on first use."""

__all__ = [
    "ActionRepeat",
    "AgentsView",
    "Angle",
    "FlatView",
    "FunctionView",
    "ModelLearner",
    "NumbersView",
    "Part",
    "Prequential",
    "Rows",
    "SceneView",
    "Static",
    "StepReport",
    "TableView",
    "TruncatedEpisodes",
    "VectorFlatView",
    "VectorModelLearner",
    "View",
    "view_of",
]


if not TYPE_CHECKING:  # checkers would take any name

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {sorted(_HOMES)}")
        return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
