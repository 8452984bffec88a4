"""Dyna with Stable-Baselines3: agents train in what they have learned; needs the extra ``sb3``.

Nothing here loads torch until a name that needs it is asked for.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what checkers and editors see; at run time `__getattr__` loads it
    from relgym.wrappers.dyna.acceptance import ModelAcceptance
    from relgym.wrappers.dyna.config import DynaConfig
    from relgym.wrappers.dyna.imagination import Imagination
    from relgym.wrappers.dyna.recorder import TransitionRecorder
    from relgym.wrappers.dyna.reward_models import LearnedRewardModel
    from relgym.wrappers.dyna.stock import SceneStock
    from relgym.wrappers.dyna.trainer import ModelTrainer
    from relgym.wrappers.sb3.callback import ModelCallback
    from relgym.wrappers.sb3.dreaming import DreamCheckup, DreamVecEnv, explore
    from relgym.wrappers.sb3.dyna import Dyna
    from relgym.wrappers.sb3.permuting import PermutedReplay
    from relgym.wrappers.sb3.replay import (
        MixedDictReplayBuffer,
        MixedNStepReplayBuffer,
        MixedReplayBuffer,
        replay_options,
    )
    from relgym.wrappers.sb3.vec_env import VectorAsVecEnv

_HOMES = {
    "ModelTrainer": "relgym.wrappers.dyna.trainer",
    "DreamCheckup": "relgym.wrappers.sb3.dreaming",
    "DreamVecEnv": "relgym.wrappers.sb3.dreaming",
    "Dyna": "relgym.wrappers.sb3.dyna",
    "DynaConfig": "relgym.wrappers.dyna.config",
    "Imagination": "relgym.wrappers.dyna.imagination",
    "LearnedRewardModel": "relgym.wrappers.dyna.reward_models",
    "MixedDictReplayBuffer": "relgym.wrappers.sb3.replay",
    "MixedNStepReplayBuffer": "relgym.wrappers.sb3.replay",
    "MixedReplayBuffer": "relgym.wrappers.sb3.replay",
    "ModelCallback": "relgym.wrappers.sb3.callback",
    "PermutedReplay": "relgym.wrappers.sb3.permuting",
    "SceneStock": "relgym.wrappers.dyna.stock",
    "TransitionRecorder": "relgym.wrappers.dyna.recorder",
    "ModelAcceptance": "relgym.wrappers.dyna.acceptance",
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


if not TYPE_CHECKING:  # checkers would take any name

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {sorted(_HOMES)}")
        return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
