"""Learn a readable model of what actions do, online, while an agent acts."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import gymnasium

__all__ = ["Dataset", "WorldModel", "data", "envs", "fit", "progressive", "score", "wrappers"]

# Python started in a checkout takes ./relgym before an installed wheel; envs/ and wrappers/ lie beside it.
_ROOT = Path(__file__).resolve().parent.parent
if (_ROOT / "pyproject.toml").is_file() and (_ROOT / "envs" / "__init__.py").is_file():
    __path__.append(str(_ROOT))

# Entry points are strings: importing relgym loads neither pymunk nor the learner.
gymnasium.register("relgym/BallBoxRamp-v0", "relgym.envs.ball_box_ramp:BallBoxRampEnv", max_episode_steps=200)
gymnasium.register("relgym/BallGoal-v0", "relgym.envs.ball_goal:BallGoalEnv", max_episode_steps=500)
gymnasium.register(
    "relgym/LearnedModel-v0",
    "relgym.envs.learned_model:LearnedModelEnv",
    vector_entry_point="relgym.envs.learned_model_vector:LearnedModelVectorEnv",
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


def __getattr__(name: str) -> Any:
    if name in _LAZY_MODULES:
        return importlib.import_module(f"relgym.{name}")
    if name in _LAZY_NAMES:
        return getattr(importlib.import_module(_LAZY_NAMES[name]), name)
    raise AttributeError(
        f"module 'relgym' has no attribute {name!r}; it has {sorted([*_LAZY_MODULES, *_LAZY_NAMES])}"
    )
