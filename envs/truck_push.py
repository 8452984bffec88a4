"""The box pushing domain (§3.1) as a Gymnasium env."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from relgym.arguments import refusing
from relgym.envs.arguments import (
    check_options,
    checked_count,
    checked_least,
    checked_range,
    physical_action,
)
from relgym.envs.base import SceneEnv
from relgym.envs.draws import Draws, Range
from relgym.envs.truck_goal import (
    FLAT,
    FORCES,
    STEPS,
    PushTask,
    draw_distance,
    draw_frictions,
)
from relgym.envs.truck_scenes import Stacks, draw_row, layouts, loads, option_names, stacks_of
from relgym.envs.truck_schema import body_values, truck_schema
from relgym.errors import ConfigError
from relgym.scene.objects import POSE, Float1D

__all__ = ["BOX_MASS", "GRAVITY", "TRUCK_MASS", "TruckPushEnv"]

TRUCK_MASS = 10.0
BOX_MASS = 10.0
GRAVITY = 10.0
"""Mass x gravity of a box is 100, a step lasts 1: with three boxes Table 3.1's 0.025, 2.5, 5.0 and 7.5."""

_PX, _SX = POSE.index("px"), POSE.index("sx")
_OWN = len(POSE)  # a truck's velocity and a box's friction follow the pose
_BOUNDS = {
    "vx": (0.0, 1e5),
    "friction": (0.0, 1e3),
    "ahead": (-1e5, 1e5),
    **dict.fromkeys(POSE[:3], (-1e6, 1e6)),
}

_TASKS = ("auto", "push", None)
"""What an agent may be asked to do; ``"auto"``: push, unless frictions are resampled while it does."""

_WATCHED_FORCES, _WATCHED_FRICTIONS = (0.0, 500.0), (0.05, 0.5)

_APPROACH, _BELOW, _PICTURE_WIDTH, _PICTURE_HEIGHT = 48.0, 12.0, 68.0, 32.0
"""The picture of the goal pad, in units: what it shows on the left of it, below it, and in all."""


class TruckPushEnv(SceneEnv):
    """A truck pushes stacks of boxes to the right; only the lowest box of a stack rubs on the ground.

    Description
    -----------
    The demonstration domain of the thesis (§3.1, Figure 3.1). All objects move together with the velocity
    ``v' = max(0, v + (F - friction) / M)`` with ``M = 10 + 10 n`` for n boxes, where ``friction`` is the
    sum over the stacks of 100 x height x friction constant of the lowest box (Coulomb; G = 10, a step lasts
    1). With three boxes this is Table 3.1: ``0.025 F`` and 2.5, 5.0 or 7.5 per constant. Friction never
    reverses the motion: a truck that stops has velocity exactly 0, and stays there until the force exceeds
    the friction. The truck itself rolls without friction.

    Action Space
    ------------
    ``Box(-1, 1, (1,), float32)``, mapped affinely to the pushing force in `force_range`. In the schema the
    bodiless object ``action`` has the physical property ``force``; ``schema.action_scale`` holds the map.

    Observation Space
    -----------------
    ``Dict``, object name -> ``Box(float64)`` in the order of the type's properties. y is up, z is the depth:

    ====================  ========================================  =======  ========  =======
    property              meaning                                   unit     min       max
    ====================  ========================================  =======  ========  =======
    px, py, pz            position of the centre                    unit     -1e6      1e6
    rx, ry, rz            rotation (0)                              radian   -pi       pi
    sx, sy, sz            full extents                              unit     0         1e3
    vx (truck)            last displacement, px_t - px_{t-1}        unit     0         1e5
    friction (boxes)      friction constant                         1        0         1e3
    ahead (goal)          how far the pad's middle lies before      unit     -1e5      1e5
                          the truck's nose
    ====================  ========================================  =======  ========  =======

    Objects: ``truck``, ``box1`` … ``boxN``, and ``bystander1`` … on request, which are boxes too; with the task
    ``push`` also ``goal``, which has no body. The observation is Markov.

    Rewards
    -------
    With ``push``, d for ``goal.ahead`` and a prime for the next scene, ``0.1 (|d| - |d'|) - 0.02``, and 2 more
    when the truck stands (v' = 0) with ``|d'| <= 1``: `PushTask`. Without a task 0.

    Starting State
    --------------
    One of the layouts: all compositions of the number of boxes into stacks, the greatest first; with three
    boxes 1: one stack of three; 2: a stack of two beside the truck, then one box; 3: one box beside the
    truck, then a stack of two; 4: three boxes in a row. Which box is where is drawn too. Boxes are 3–5
    wide, high and deep, a box on another one no wider than that; the truck 4–6 wide and 2–3 high: no higher
    than a box. Everything touches exactly. The truck is at rest, at x within 50 and the ground at y within
    5 of the origin. Bystanders stand beside the track, 8 or more off it. All uniform. With ``push`` the goal is
    20–40 away, and in random order one box is slippery (friction constant 0.05–0.12), one middling (0.2–0.3) and
    one rough (0.4–0.5); further boxes begin anew.

    Reset options, all optional: ``layout`` (1, 2, …), ``order`` (names of the boxes by position: stack by
    stack from the truck on, each from bottom to top), ``speed``, ``shift_x``, ``shift_y``, ``truck_width``,
    ``truck_height``, ``box1_width``, ``box1_height``, ``box1_depth``, ``box1_friction``, …,
    ``bystander1_x``, …, with ``push`` also ``goal_distance`` and ``friction_order`` (names of the pushed boxes,
    the slippery one first); `reset_options` lists them. ``info["configuration"]`` holds what was drawn: passed
    as options, it gives the same scene again.

    Episode End
    -----------
    With ``push`` the first stop counts: terminated when v' = 0 after v > 0, and when d' < -1; truncated after 20
    steps. Without a task never; truncated after 40 steps by the registered time limit.

    Info
    ----
    ``info["layout"]`` (its number) and ``info["stacks"]`` (names, each stack from bottom to top, from the
    truck on): the truth about what pushes what. After steps with a task ``info["is_success"]``. At reset also
    ``info["scene"]`` and ``info["configuration"]``.

    Arguments
    ---------
    n_boxes
        Number of boxes to push (1 to 12).
    resample
        When the frictions are drawn: ``"episode"`` at reset, ``"step"`` before every step; then the schema
        declares them exogenous, and nobody could plan: there is no task.
    friction_range
        From where the frictions of all boxes are drawn; default: 0.05 to 0.5, but with ``push`` those of pushed
        boxes as above.
    force_range
        Forces (>= 0) that -1 and 1 stand for; default: 0 to 250 with ``push``, else 0 to 500.
    bystanders
        How many boxes stand beside the track.
    task
        ``"push"``: bring the stacks to the goal and stop there. ``None``: the thesis' world, where one watches
        what pushing does. ``"auto"``: ``None`` with ``resample="step"``, else ``"push"``.
    gravity
        G, at least 0.

    Version History
    ---------------
    * v0: initial version.
    """

    @refusing(ConfigError)
    def __init__(
        self,
        n_boxes: int = 3,
        resample: str = "episode",
        friction_range: tuple[float, float] | None = None,
        force_range: tuple[float, float] | None = None,
        bystanders: int = 0,
        task: str | None = "auto",
        render_mode: str | None = None,
        gravity: float = GRAVITY,
    ) -> None:
        task = _checked_task(task, resample)
        self._boxes = tuple(f"box{k + 1}" for k in range(checked_count("n_boxes", n_boxes, 1, 12)))
        count = checked_count("bystanders", bystanders, 0, 100)
        self._bystanders = tuple(f"bystander{k + 1}" for k in range(count))
        self._banded = task is not None and friction_range is None
        frictions = _WATCHED_FRICTIONS if friction_range is None else friction_range
        self._frictions = Range(*checked_range("friction_range", frictions), 0.0, 1e3)
        self._resample = resample
        self._gravity = checked_least("gravity", gravity, 0.0)
        names = (*self._boxes, *self._bystanders)
        usual = FORCES if task else _WATCHED_FORCES
        forces = checked_range("force_range", usual if force_range is None else force_range)
        schema = truck_schema(names, forces, exogenous=resample == "step", goal=task is not None)
        super().__init__(
            schema,
            spaces.Box(-1.0, 1.0, (1,), np.float32),
            _BOUNDS,
            render_mode,
            task=PushTask() if task else None,
            time_limit=STEPS if task else None,
        )
        if task:
            self.flat_spec = FLAT
        self._columns = {name: cut.start for name, cut in self._cuts}
        self._friction_columns = [self._columns[name] + _OWN for name in names]
        self._stacks: Stacks = ()
        self._configuration: Mapping[str, Any] = {}

    @property
    def reset_options(self) -> tuple[str, ...]:
        """Names of all options of `reset`."""
        own = (("goal_distance", self.task is not None), ("friction_order", self._banded))
        names = option_names(self._boxes, self._bystanders)
        return (*names, *(name for name, there in own if there))

    @property
    def stacks(self) -> Stacks:
        """Names of the boxes of each stack from bottom to top; stacks from the truck outwards."""
        return self._stacks

    def _begin(self, options: Mapping[str, Any], *, rng: np.random.Generator) -> Float1D:
        check_options(options, self.reset_options)
        draws = Draws(options, rng)
        placed, stacks, speed = draw_row(self._boxes, self._bystanders, draws)
        own = self._draw_frictions(draws) | {"truck": speed}
        parts = [body_values(placed[name], own[name]) for name in self._layout.names if name in placed]
        if self.task is not None:
            parts.append(np.array([draw_distance(draws)]))
        self._stacks, self._configuration = stacks, draws.taken
        return np.concatenate(parts)

    def _draw_frictions(self, draws: Draws) -> dict[str, float]:
        """Friction constant of every box, by name."""
        pushed = draw_frictions(self._boxes, draws) if self._banded else {}
        rest = (name for name in (*self._boxes, *self._bystanders) if name not in pushed)
        return pushed | {name: draws.number(f"{name}_friction", self._frictions) for name in rest}

    def _advance(self, state: Float1D, action: Any) -> Float1D:
        force = float(physical_action(self.schema, action)[0])
        velocity = self._next_velocity(state, force)
        after = state.copy()
        truck = self._columns["truck"]
        after[truck + _OWN] = velocity
        after[truck + _PX] = state[truck + _PX] + velocity
        self._push(after)
        if self.task is not None:
            after[self._columns["goal"]] = state[self._columns["goal"]] - velocity
        if self._resample == "step":
            after[self._friction_columns] = self.np_random.uniform(
                self._frictions.low, self._frictions.high, len(self._friction_columns)
            )
        return after

    def _next_velocity(self, state: Float1D, force: float) -> float:
        weight = BOX_MASS * self._gravity
        friction = sum(
            load * weight * float(state[self._columns[name] + _OWN])
            for name, load in loads(self._stacks).items()
        )
        mass = TRUCK_MASS + BOX_MASS * len(self._boxes)
        # §3.2.6; friction opposes the motion and ends with it: from v >= 0 it can't lead below 0.
        return max(0.0, float(state[self._columns["truck"] + _OWN]) + (force - friction) / mass)

    def _push(self, state: Float1D) -> None:
        """Move the stacks to where they touch the truck and one another: rounding never tears them apart."""
        truck = self._columns["truck"]
        edge = state[truck + _PX] + state[truck + _SX] / 2
        for stack in self._stacks:
            width = state[self._columns[stack[0]] + _SX]
            for name in stack:
                state[self._columns[name] + _PX] = edge + width / 2
            edge += width

    def _info(self) -> dict[str, Any]:
        heights = tuple(len(stack) for stack in self._stacks)
        return {"layout": layouts(len(self._boxes)).index(heights) + 1, "stacks": self._stacks}

    def _reset_info(self) -> dict[str, Any]:
        return {"configuration": dict(self._configuration)}

    def _view(self) -> Any:
        from relgym.envs.rendering import View, scene_view

        if self.task is None:
            return scene_view(self.scene, ("truck", *self._boxes), margin=0.3)
        (pad,) = self.task.regions(self.scene)  # it stands still, and so does the picture
        return View(pad.left - _APPROACH, pad.bottom - _BELOW, _PICTURE_WIDTH, _PICTURE_HEIGHT)

    def _hidden(self) -> Any:
        return self._stacks

    def _restore(self, vector: Float1D, hidden: Any) -> None:
        self._stacks = stacks_of(self._scene_of(vector)) if hidden is None else hidden


def _checked_task(task: str | None, resample: str) -> str | None:
    """The task that is meant; `ConfigError` where it is none, or can't go with `resample`."""
    if resample not in ("episode", "step"):
        raise ConfigError(f"resample={resample!r}: expected 'episode' or 'step'")
    if task not in _TASKS:
        raise ConfigError(f"task={task!r}: expected one of {list(_TASKS)}")
    if task == "auto":
        return "push" if resample == "episode" else None
    if task is not None and resample != "episode":
        raise ConfigError(
            f"task={task!r} with resample={resample!r}: no agent can plan for frictions that are yet to be drawn; "
            "pass task=None"
        )
    return task
