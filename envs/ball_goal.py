"""A ball with thrusters that is to reach a place and stay there, in the world of §4.1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from gymnasium import spaces

from relgym.arguments import refusing
from relgym.envs.arguments import Coefficient, check_options, physical_action
from relgym.envs.ball_course import course_options, draw_course, rest_places
from relgym.envs.ball_env import BallEnv, body_values
from relgym.envs.flat import FlatSpec
from relgym.envs.physics import TIME_STEP
from relgym.envs.tasks import Region, Task, TaskOutcome, column_of
from relgym.errors import ConfigError
from relgym.scene.objects import ACTION, Float1D, Float2D, ObjectType, Scene, SceneLayout, Target

__all__ = ["HOLD", "THRUST", "BallGoalEnv", "GoalTask"]

THRUST: Final = 8.0
"""Greatest acceleration by a thruster, in units / s^2: less than gravity."""

HOLD: Final = 25
"""For how many steps the ball has to stay: 5 decisions of 5 steps."""

_GOAL: Final = ObjectType("goal", ("dx", "dy", "held"))
_SIGNS: Final = (_GOAL, ObjectType(ACTION, ("ax", "ay")))
_TARGETS: Final = (
    Target("goal", "dx", given=(("ball", "vx"),)),
    Target("goal", "dy", given=(("ball", "vy"),)),
    Target("goal", "held"),
)


@dataclass(frozen=True, slots=True)
class GoalTask(Task):
    """Reach the goal and stay there.

    With (dx, dy) the way from the ball to the goal and a prime for the next scene, the reward is
    ``|dx| + |dy| - |dx'| - |dy'| - 0.004``, and 2 more for success: when ``held'`` reaches `hold`, which ends the
    episode. Distances are added along the axes, so that the reward is piecewise linear.

    Parameters
    ----------
    half_width, half_height
        Of the goal, in units: how far the ball's centre may be from it.
    hold
        For how many steps the ball has to stay.
    """

    half_width: float = 0.2
    half_height: float = 0.1
    hold: int = HOLD

    def held(self, dx: Float1D, dy: Float1D, held: Float1D) -> Float1D:
        """For how many steps in a row the ball has been in the goal, one step on; shape ``(n,)``."""
        inside = (np.abs(dx) <= self.half_width) & (np.abs(dy) <= self.half_height)
        return np.where(inside, held + 1.0, 0.0)

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """Evaluate n steps; see `Task.evaluate`."""
        far, near = (_distance(layout, vectors) for vectors in (before, after))
        succeeded = column_of(layout, "goal", "held", after) >= self.hold
        return TaskOutcome(far - near - 0.004 + 2.0 * succeeded, succeeded, succeeded)

    def regions(self, scene: Scene) -> tuple[Region, ...]:
        """Where the ball's centre is to be."""
        ball, goal = scene["ball"], scene["goal"]
        x, y = ball["px"] + goal["dx"], ball["py"] + goal["dy"]
        w, h = self.half_width, self.half_height
        return (Region(x - w, y - h, 2 * w, 2 * h),)


def _distance(layout: SceneLayout, vectors: Float2D) -> Float1D:
    """From ball to goal along the axes, shape ``(n,)``."""
    dx, dy = (column_of(layout, "goal", prop, vectors) for prop in ("dx", "dy"))
    total: Float1D = np.abs(dx) + np.abs(dy)
    return total


_TASK: Final = GoalTask()


class BallGoalEnv(BallEnv):
    """A ball flies by weak thrusters to a place among a box and a ramp, and stays there.

    Description
    -----------
    The world of `BallBoxRampEnv`, and one that acts in it: the ball has thrusters, weaker than gravity. It can't
    hover and can't rise from rest, but bounce higher and higher, glide far, and brake. One step is 0.01 s and one
    step of the engine, for which the law of that world holds with the thrust added to gravity; with sub-steps it
    would not be piecewise linear. So an agent should decide less often than that:
    ``relgym.wrappers.ActionRepeat(env, 5)``, which leaves about 100 decisions.

    Action Space
    ------------
    ``Box(-1, 1, (2,), float32)``, mapped affinely to accelerations of -8 to 8 units/s^2 along x and y. In the
    schema the bodiless object ``action`` has the physical properties ``ax`` and ``ay``.

    Observation Space
    -----------------
    ``Dict``, object name -> ``Box(float64)`` in the order of the type's properties: those of `BallBoxRampEnv`, and

    ===================  ========================================  =======  ========  =======
    property             meaning                                   unit     min       max
    ===================  ========================================  =======  ========  =======
    dx, dy (goal)        way from the ball's centre to the goal    unit     -1e4      1e4
    held (goal)          for how many steps in a row, up to the    1        0         1e6
                         last one, the ball has been in the goal
    ===================  ========================================  =======  ========  =======

    Objects: ``ball``; ``box``, ``ramp``; ``floor``, ``ceiling``, ``left_wall``, ``right_wall``; ``goal``, which has
    no body. The observation is Markov.

    Rewards
    -------
    Progress along both axes, less 0.004 a step, and 2 for success: `GoalTask`.

    Starting State
    --------------
    Rooms as in `BallBoxRampEnv`. Start and goal are two places at which a ball can rest, at least 1 apart: gaps of
    the floor, or the top of a box. The ball begins at rest 0.1–0.3 above its place. All uniform.

    Reset options, all optional: those of rooms (``ramp``, ``touching``, ``room_width``, …, ``ball_radius``),
    ``start`` and ``goal`` (``"gap1"``, ``"gap2"``, … from left to right, or a box's name), ``start_x`` and
    ``goal_x`` (0–1 along the place), ``drop``; `reset_options` lists them. ``info["configuration"]`` holds what was
    drawn: passed as options, it gives the same scene again.

    Episode End
    -----------
    Terminated when the ball has stayed within 0.2 by 0.1 of the goal for 25 steps; truncated after 500 steps by the
    registered time limit.

    Info
    ----
    ``info["contacts"]``: a tuple of `Contact`, what touches what in the current state; the impulses are those without
    thrust. After steps ``info["is_success"]``. At reset also ``info["scene"]`` and ``info["configuration"]``.

    Arguments
    ---------
    incline, elasticity, friction, objects, type_names
        As in `BallBoxRampEnv`; one object at least has to stand on the floor.

    Version History
    ---------------
    * v0: initial version.
    """

    flat_spec = FlatSpec(
        actor="ball",
        scales={
            "px": (2.0,),
            "py": (1.0,),
            "sx": (1.0,),
            "sy": (1.0,),
            "vx": (0.03,),
            "vy": (0.03,),
            "dx": (2.0, 0.2),
            "dy": (1.0, 0.1),
            "held": (HOLD,),
        },
    )

    @refusing(ConfigError)
    def __init__(
        self,
        incline: Coefficient = 30.0,
        elasticity: Coefficient = 0.9,
        friction: Coefficient = 0.0,
        objects: Sequence[str] | Mapping[str, int] = ("box", "ramp"),
        type_names: str = "shape",
        render_mode: str | None = None,
    ) -> None:
        super().__init__(
            balls=("ball",),
            incline=incline,
            elasticity=elasticity,
            friction=friction,
            objects=objects,
            type_names=type_names,
            action_space=spaces.Box(-1.0, 1.0, (2,), np.float32),
            render_mode=render_mode,
            signs=_SIGNS,
            targets=_TARGETS,
            action_scale=(("ax", -THRUST, THRUST), ("ay", -THRUST, THRUST)),
            bounds={"dx": (-1e4, 1e4), "dy": (-1e4, 1e4), "held": (0.0, 1e6)},
            task=_TASK,
        )
        if len(rest_places(self._standing)) < 2:
            raise ConfigError("objects is empty: start and goal need something that stands between them")

    @property
    def reset_options(self) -> tuple[str, ...]:
        """Names of all options of `reset`."""
        return tuple(course_options(self._standing))

    def _begin(self, options: Mapping[str, Any], *, rng: np.random.Generator) -> Float1D:
        check_options(options, self.reset_options)
        course = draw_course(self._standing, self._inclines, options=options, rng=rng)
        self._configuration = course.configuration
        ball = course.objects["ball"]
        goal = np.array([course.goal[0] - ball.x, course.goal[1] - ball.y, 0.0])
        bodies = [name for name in self._layout.names if name in course.objects]
        parts = [body_values(name, course.objects[name], self._balls) for name in bodies]
        state = np.concatenate([*parts, goal])
        self._landed(state)
        return state

    def _advance(self, state: Float1D, action: Any) -> Float1D:
        centres, moves = self._motion(state)
        thrust = physical_action(self.schema, action)
        # What touches decides about the next displacement, and so does the thrust: both are solved for at once.
        self._engine.land(centres, moves, [(float(thrust[0]), float(thrust[1]))])
        now = [
            (x + vx * TIME_STEP, y + vy * TIME_STEP)
            for (x, y), (vx, vy) in zip(centres, self._engine.velocities(), strict=True)
        ]
        after = self._write(state.copy(), now, centres)
        goal = self._layout.offsets[self._layout.index("goal")]
        after[goal] -= now[0][0] - centres[0][0]
        after[goal + 1] -= now[0][1] - centres[0][1]
        after[goal + 2] = _TASK.held(*state[goal : goal + 3, None])[0]
        self._engine.land(now, self._motion(after)[1])  # makes known what touches there
        return after

    def _reset_info(self) -> dict[str, Any]:
        return {"configuration": dict(self._configuration)}

    def _restore(self, vector: Float1D, hidden: Any) -> None:
        # The state vector is the whole state: the engine only says what touches.
        self._landed(vector.copy())
