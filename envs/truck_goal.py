"""The task ``push`` of ``relgym/TruckPush-v0``: bring the stacks to the goal and stop there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from relgym.envs.draws import Draws, Range
from relgym.envs.flat import FlatSpec
from relgym.envs.tasks import Region, Task, TaskOutcome, column_of
from relgym.scene.objects import Float2D, ObjectType, Scene, SceneLayout, Target

__all__ = [
    "FORCES",
    "GOAL",
    "GOAL_TARGET",
    "STEPS",
    "PushTask",
    "draw_distance",
    "draw_frictions",
]

FORCES: Final = (0.0, 250.0)
"""Forces that -1 and 1 stand for unless the env's maker says otherwise."""

STEPS: Final = 20
"""How long an agent has."""

GOAL: Final = ObjectType("goal", ("ahead",))
"""Where the truck is to stop, as the truck sees it: how far the pad's middle lies before its nose.

Without a body: it is a mark on the ground and takes part in no relation."""

GOAL_TARGET: Final = Target("goal", "ahead", given=(("truck", "vx"),))
"""What is to be learned of the goal: that it comes nearer by what the truck moves."""

FLAT: Final = FlatSpec(
    actor="truck",
    anchor=(0.5, -0.5, 0.0),  # its nose, at the ground
    scales={
        "px": (10.0,),
        "py": (5.0,),
        "pz": (10.0,),
        "vx": (5.0,),
        "friction": (0.25,),
        "ahead": (20.0, 2.0),
    },
)
"""What a policy needs to see: what is under what and how it rubs, how fast it goes, and how far it is."""

_DISTANCE = Range(20.0, 40.0, -1e4, 1e4)
_BANDS = ((0.05, 0.12), (0.2, 0.3), (0.4, 0.5))  # slippery, middling, rough
_PAD_DEPTH = 1.5  # of the picture


@dataclass(frozen=True, slots=True)
class PushTask(Task):
    """Stop with the truck's nose on the goal pad; the first stop counts.

    With d for ``goal.ahead``, v the truck's velocity and a prime for the next scene, the reward is
    ``0.1 (|d| - |d'|) - 0.02``, and 2 more for success: ``v' = 0`` and ``|d'| <= half_width``. A step ends the
    episode when the truck stops (``v > 0`` and ``v' = 0``) or drives over the pad (``d' < -half_width``).

    Parameters
    ----------
    half_width
        Of the pad, in units.
    """

    half_width: float = 1.0

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """Evaluate n steps; see `Task.evaluate`."""
        d, d_next = (column_of(layout, "goal", "ahead", vectors) for vectors in (before, after))
        v, v_next = (column_of(layout, "truck", "vx", vectors) for vectors in (before, after))
        succeeded = (v_next == 0.0) & (np.abs(d_next) <= self.half_width)
        stopped, over = (v > 0.0) & (v_next == 0.0), d_next < -self.half_width
        return TaskOutcome(
            0.1 * (np.abs(d) - np.abs(d_next)) - 0.02 + 2.0 * succeeded, stopped | over, succeeded
        )

    def regions(self, scene: Scene) -> tuple[Region, ...]:
        """The pad, let into the ground."""
        truck = scene["truck"]
        middle = truck["px"] + truck["sx"] / 2 + scene["goal"]["ahead"]
        ground = truck["py"] - truck["sy"] / 2
        return (Region(middle - self.half_width, ground - _PAD_DEPTH, 2 * self.half_width, _PAD_DEPTH),)


def draw_frictions(boxes: tuple[str, ...], draws: Draws) -> dict[str, float]:
    """Friction constants: one box is slippery, one middling and one rough, the fourth slippery again, and so on."""
    order: Sequence[str] = draws.order("friction_order", boxes)
    spans = {name: Range(*_BANDS[k % len(_BANDS)], 0.0, 1e3) for k, name in enumerate(order)}
    return {name: draws.number(f"{name}_friction", spans[name]) for name in boxes}


def draw_distance(draws: Draws) -> float:
    """How far the goal is away at the start."""
    return draws.number("goal_distance", _DISTANCE)
