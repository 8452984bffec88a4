"""What scenes of ``relgym/TruckPush-v0`` are made of."""

from __future__ import annotations

import numpy as np

from relgym.envs.truck_goal import GOAL, GOAL_TARGET
from relgym.envs.truck_scenes import Placed
from relgym.scene.objects import ACTION, POSE, Float1D, Kinematics, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box

__all__ = ["body_values", "truck_schema"]


def truck_schema(
    boxes: tuple[str, ...], force_range: tuple[float, float], *, exogenous: bool, goal: bool
) -> SceneSchema:
    """The schema of a truck and these boxes.

    Parameters
    ----------
    boxes
        Their names.
    force_range
        Forces that -1 and 1 stand for.
    exogenous
        Whether frictions are resampled from outside.
    goal
        Whether there is a goal.
    """
    truck = ObjectType("truck", (*POSE, "vx"), Box(), velocity=("vx", None, None))
    box = ObjectType("box", (*POSE, "friction"), Box(), exogenous=("friction",) if exogenous else ())
    targets = (Target("truck", "vx"), Target("box", "px", given=(("truck", "vx"),)))
    marks = (GOAL,) if goal else ()
    return SceneSchema(
        types=(truck, box, *marks, ObjectType(ACTION, ("force",))),
        objects=(
            ("truck", "truck"),
            *((name, "box") for name in boxes),
            *((t.name, t.name) for t in marks),
            (ACTION, ACTION),
        ),
        up="y",
        planar=False,
        kinematics=(Kinematics("truck", "px", "vx"),),
        targets=(*targets, GOAL_TARGET) if goal else targets,
        action_scale=(("force", *force_range),),
    )


def body_values(placed: Placed, own: float) -> Float1D:
    """Property vector of a body with one property of its own: a velocity or a friction constant."""
    p = placed
    return np.array([p.x, p.y, p.z, 0.0, 0.0, 0.0, p.width, p.height, p.depth, own])
