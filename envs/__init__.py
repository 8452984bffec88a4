"""Gymnasium envs whose observations are scenes of rigid objects; imported as ``relgym.envs``."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what checkers and editors see; at run time `__getattr__` loads it
    from relgym.envs.agents import AgentsEnv, AgentsSpace
    from relgym.envs.ball_box_ramp import BallBoxRampEnv
    from relgym.envs.ball_goal import BallGoalEnv
    from relgym.envs.base import EnvState, SceneEnv
    from relgym.envs.box_push import BoxPushEnv
    from relgym.envs.dreams.env import LearnedModelEnv
    from relgym.envs.dreams.rewards import in_batches
    from relgym.envs.dreams.starts import drawn_from
    from relgym.envs.dreams.vector import LearnedModelVectorEnv
    from relgym.envs.flat import FlatSpec, Flattener
    from relgym.envs.rendering import render_scene
    from relgym.envs.tasks import Task
    from relgym.envs.truck_push import TruckPushEnv

if __name__ != "relgym.envs":
    raise ImportError(
        f"this package is called relgym.envs, not {__name__!r}: a second copy of every class would follow; "
        "use `from relgym.envs import …`"
    )

_HOMES = {
    "AgentsEnv": "relgym.envs.agents",
    "AgentsSpace": "relgym.envs.agents",
    "BallBoxRampEnv": "relgym.envs.ball_box_ramp",
    "BallGoalEnv": "relgym.envs.ball_goal",
    "BoxPushEnv": "relgym.envs.box_push",
    "EnvState": "relgym.envs.base",
    "FlatSpec": "relgym.envs.flat",
    "Flattener": "relgym.envs.flat",
    "LearnedModelEnv": "relgym.envs.dreams.env",
    "LearnedModelVectorEnv": "relgym.envs.dreams.vector",
    "SceneEnv": "relgym.envs.base",
    "Task": "relgym.envs.tasks",
    "TruckPushEnv": "relgym.envs.truck_push",
    "drawn_from": "relgym.envs.dreams.starts",
    "in_batches": "relgym.envs.dreams.rewards",
    "render_scene": "relgym.envs.rendering",
}
"""Where each public name lives; loaded on first use, so that `import relgym` needs no pymunk."""

__all__ = [
    "AgentsEnv",
    "AgentsSpace",
    "BallBoxRampEnv",
    "BallGoalEnv",
    "BoxPushEnv",
    "EnvState",
    "FlatSpec",
    "Flattener",
    "LearnedModelEnv",
    "LearnedModelVectorEnv",
    "SceneEnv",
    "Task",
    "TruckPushEnv",
    "drawn_from",
    "in_batches",
    "render_scene",
]


if not TYPE_CHECKING:  # checkers would take any name

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {sorted(_HOMES)}")
        return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
