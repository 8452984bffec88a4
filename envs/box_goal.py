"""The task of ``relgym/BoxPush-v0``: push the parcel to the goal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from relgym.envs.flat import FlatSpec
from relgym.envs.tasks import Region, Task, TaskOutcome, column_of
from relgym.scene.objects import Float2D, ObjectType, Scene, SceneLayout, Target

__all__ = ["BOX_FLAT", "BOX_GOAL", "BOX_TARGETS", "DeliverTask"]

BOX_GOAL: Final = ObjectType("goal", ("dx", "dy"))
"""Where the parcel is to be brought: the way from its position to there. Without a body: a mark on the table."""

BOX_TARGETS: Final = (
    Target("goal", "dx", given=(("parcel", "vx"),)),
    Target("goal", "dy", given=(("parcel", "vy"),)),
)
"""What is to be learned of the goal: that it comes nearer by what the parcel moves."""

BOX_FLAT: Final = FlatSpec(
    actor="parcel",
    scales={
        "px": (0.5,),
        "py": (0.5,),
        "rz": (1.0,),
        "sx": (0.3,),
        "sy": (0.3,),
        "vx": (0.01,),
        "vy": (0.01,),
        "spin": (0.02,),
        "dx": (1.0, 0.1),
        "dy": (1.0, 0.1),
    },
)
"""What a policy needs to see, from where the parcel is."""


@dataclass(frozen=True, slots=True)
class DeliverTask(Task):
    """Push the parcel until it lies in the goal.

    With (dx, dy) the way from the parcel to the goal and a prime for the next scene, the reward is
    ``|dx| + |dy| - |dx'| - |dy'| - 0.001``, and 2 more for success, which ends the episode: ``|dx'|`` and ``|dy'|`` at
    most `half_width`. Distances are added along the axes, so that the reward is piecewise linear.

    Parameters
    ----------
    half_width
        Of the goal, in units.
    """

    half_width: float = 0.1

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """Evaluate n steps; see `Task.evaluate`."""
        was, now = (
            [np.abs(column_of(layout, "goal", name, vectors)) for name in BOX_GOAL.properties]
            for vectors in (before, after)
        )
        succeeded = (now[0] <= self.half_width) & (now[1] <= self.half_width)
        rewards = (was[0] + was[1]) - (now[0] + now[1]) - 0.001 + 2.0 * succeeded
        return TaskOutcome(rewards, succeeded, succeeded)

    def regions(self, scene: Scene) -> tuple[Region, ...]:
        """The goal, a square on the table."""
        parcel, goal = scene["parcel"], scene["goal"]
        x, y = parcel["px"] + goal["dx"], parcel["py"] + goal["dy"]
        side = 2.0 * self.half_width
        return (Region(x - self.half_width, y - self.half_width, side, side),)
