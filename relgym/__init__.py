"""Learn a readable model of what actions do, online, while an agent acts."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

import gymnasium

if TYPE_CHECKING:  # what checkers and editors see; at run time `__getattr__` loads it
    from relgym import data, envs, wrappers
    from relgym.data.dataset import Dataset
    from relgym.data.learner import fit, progressive, score
    from relgym.model.world_model import WorldModel

    __version__: str

__all__ = ["Dataset", "WorldModel", "__version__", "data", "envs", "fit", "progressive", "score", "wrappers"]

# Entry points are strings: importing relgym loads neither pymunk nor the learner.
gymnasium.register("relgym/BallBoxRamp-v0", "relgym.envs.ball_box_ramp:BallBoxRampEnv", max_episode_steps=200)
gymnasium.register("relgym/BallGoal-v0", "relgym.envs.ball_goal:BallGoalEnv", max_episode_steps=500)
gymnasium.register("relgym/BoxPush-v0", "relgym.envs.box_push:BoxPushEnv", max_episode_steps=1_000)
gymnasium.register(
    "relgym/LearnedModel-v0",
    "relgym.envs.dreams.env:LearnedModelEnv",
    vector_entry_point="relgym.envs.dreams.vector:LearnedModelVectorEnv",
)
gymnasium.register("relgym/TruckPush-v0", "relgym.envs.truck_push:TruckPushEnv", max_episode_steps=40)

_LAZY_MODULES = ("data", "envs", "wrappers")
_LAZY_NAMES = {
    "Dataset": "relgym.data.dataset",
    "WorldModel": "relgym.model.world_model",
    "fit": "relgym.data.learner",
    "progressive": "relgym.data.learner",
    "score": "relgym.data.learner",
}


if not TYPE_CHECKING:  # checkers would take any name

    def __getattr__(name: str) -> Any:
        if name in _LAZY_MODULES:
            return importlib.import_module(f"relgym.{name}")
        if name in _LAZY_NAMES:
            return getattr(importlib.import_module(_LAZY_NAMES[name]), name)
        if name == "__version__":  # reading what is installed takes milliseconds: not at every import
            return _version()
        raise AttributeError(
            f"module 'relgym' has no attribute {name!r}; it has {sorted([*_LAZY_MODULES, *_LAZY_NAMES])}"
        )


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _version() -> str:
    """Version of the installed distribution; that of a checkout that nobody installed is unknown."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("relgym")
    except PackageNotFoundError:
        return "0+unknown"
