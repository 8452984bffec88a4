"""Dyna with Stable-Baselines3: agents train in what they have learned; needs the extra ``sb3``.

Nothing here loads torch until a name that needs it is asked for.
"""

import importlib
from typing import Any

_HOMES = {
    "ModelTrainer": "relgym.wrappers.sb3.trainer",
    "DreamCheckup": "relgym.wrappers.sb3.dreaming",
    "DreamVecEnv": "relgym.wrappers.sb3.dreaming",
    "Dyna": "relgym.wrappers.sb3.dyna",
    "DynaConfig": "relgym.wrappers.sb3.config",
    "Imagination": "relgym.wrappers.sb3.imagination",
    "LearnedRewardModel": "relgym.wrappers.sb3.reward_models",
    "MixedDictReplayBuffer": "relgym.wrappers.sb3.replay",
    "MixedNStepReplayBuffer": "relgym.wrappers.sb3.replay",
    "MixedReplayBuffer": "relgym.wrappers.sb3.replay",
    "ModelCallback": "relgym.wrappers.sb3.callback",
    "PermutedReplay": "relgym.wrappers.sb3.permuting",
    "SceneStock": "relgym.wrappers.sb3.stock",
    "TransitionRecorder": "relgym.wrappers.sb3.recorder",
    "ModelAcceptance": "relgym.wrappers.sb3.acceptance",
    "explore": "relgym.wrappers.sb3.dreaming",
    "VectorAsVecEnv": "relgym.wrappers.sb3.vec_env",
    "replay_options": "relgym.wrappers.sb3.replay",
}
"""Where each public name lives; loaded on first use."""

__all__ = [
    "DreamCheckup",
    "DreamVecEnv",
    "Dyna",
    "DynaConfig",
    "Imagination",
    "LearnedRewardModel",
    "MixedDictReplayBuffer",
    "MixedNStepReplayBuffer",
    "MixedReplayBuffer",
    "ModelAcceptance",
    "ModelCallback",
    "ModelTrainer",
    "PermutedReplay",
    "SceneStock",
    "TransitionRecorder",
    "VectorAsVecEnv",
    "explore",
    "replay_options",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {sorted(_HOMES)}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
