"""Acting well with what was learned: searches through a model's predictions, exploration, an agent that does both.

A `Planner` asks a `Simulator` (a learned model, or an exact env) what follows from sequences of actions, lets a search
(`RandomShooting`, `CrossEntropy`, `PathIntegral`, `TreeSearch`) look for a good one, and acts as
Stable-Baselines3's policies do: ``predict(observation) -> action, state``. A `PlanningAgent` learns the model, reward
and termination while it acts, and explores on purpose.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relgym.planning.actions import ActionCoder
    from relgym.planning.agent import PlanningAgent
    from relgym.planning.doubts import DoubtedTask, OptimisticTask
    from relgym.planning.exploration import Coverage, Explore, Familiar
    from relgym.planning.planner import Planner
    from relgym.planning.rollouts import Objective, Plan
    from relgym.planning.sequences import CrossEntropy, PathIntegral, RandomShooting, Search
    from relgym.planning.simulators import Correctable, EnvSimulator, ModelSimulator, Simulator, Steps
    from relgym.planning.tree import TreeSearch

_HOMES = {
    "ActionCoder": "relgym.planning.actions",
    "Correctable": "relgym.planning.simulators",
    "Coverage": "relgym.planning.exploration",
    "CrossEntropy": "relgym.planning.sequences",
    "DoubtedTask": "relgym.planning.doubts",
    "EnvSimulator": "relgym.planning.simulators",
    "Explore": "relgym.planning.exploration",
    "Familiar": "relgym.planning.exploration",
    "ModelSimulator": "relgym.planning.simulators",
    "Objective": "relgym.planning.rollouts",
    "OptimisticTask": "relgym.planning.doubts",
    "PathIntegral": "relgym.planning.sequences",
    "Plan": "relgym.planning.rollouts",
    "Planner": "relgym.planning.planner",
    "PlanningAgent": "relgym.planning.agent",
    "RandomShooting": "relgym.planning.sequences",
    "Search": "relgym.planning.sequences",
    "Simulator": "relgym.planning.simulators",
    "Steps": "relgym.planning.simulators",
    "TreeSearch": "relgym.planning.tree",
}
"""Where each public name lives; loaded on first use."""

__all__ = [
    "ActionCoder",
    "Correctable",
    "Coverage",
    "CrossEntropy",
    "DoubtedTask",
    "EnvSimulator",
    "Explore",
    "Familiar",
    "ModelSimulator",
    "Objective",
    "OptimisticTask",
    "PathIntegral",
    "Plan",
    "Planner",
    "PlanningAgent",
    "RandomShooting",
    "Search",
    "Simulator",
    "Steps",
    "TreeSearch",
]


if not TYPE_CHECKING:  # checkers would take any name

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {sorted(_HOMES)}")
        return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
