"""A disc that pushes a parcel among boxes on a table, as a Gymnasium env."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from gymnasium import spaces

from relgym.arguments import refusing
from relgym.envs.arguments import check_options, checked_count, checked_least, physical_action
from relgym.envs.base import SceneEnv
from relgym.envs.bodies import Body, BodyWorld
from relgym.envs.box_goal import BOX_FLAT, BOX_GOAL, BOX_TARGETS, DeliverTask
from relgym.envs.draws import Draws, Range
from relgym.envs.physics import TIME_STEP
from relgym.errors import ConfigError
from relgym.scene.objects import ACTION, POSE, Float1D, Float2D, Kinematics, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Compound, Shape, Sphere

__all__ = ["SPEED", "STEPS", "TEE", "BoxPushEnv"]

SPEED: Final = 0.02
"""Greatest velocity that an action asks of the pusher, along each axis, in units per step."""

STEPS: Final = 1_000
"""How long an agent has."""

HALF: Final = 1.5
"""Half the width of the table between its rails."""

_DAMPING: Final = 0.02  # share of its velocity that a body keeps in a second: 0.96 a step
_ITERATIONS: Final = 500
_THICK: Final = 0.5
_SHELF: Final = HALF + _THICK + 0.6  # where boxes lie that aren't on the table
_MOVING: Final = (*POSE, "vx", "vy", "spin")
_RATES: Final = (("px", "vx"), ("py", "vy"), ("rz", "spin"))
_TRIES: Final = 2_000


def _tee() -> Compound:
    """A T in the unit square, its centroid at the origin."""
    width = 0.3
    low = 1.0 - width
    centre = (width * (low + width / 2.0) + width * low * low / 2.0) / (width + width * low)
    top, joint, foot, half = 1.0 - centre, low - centre, -centre, width / 2.0
    beam = ((-0.5, joint), (0.5, joint), (0.5, top), (-0.5, top))
    return Compound((beam, ((-half, foot), (half, foot), (half, joint), (-half, joint))))


TEE: Final = _tee()
"""Shape of the parcel that is a T."""

_PARCELS: Final[Mapping[str, Shape]] = {"box": Box(), "tee": TEE}


class BoxPushEnv(SceneEnv):
    """A disc pushes a parcel to a goal, on a table with boxes and rails; whatever is pushed turns.

    Description
    -----------
    Seen from above: no gravity, but the table slows everything down by 4 % a step. The pusher is a disc whose velocity
    is the action (a motor of whatever force that takes); contacts then act on all bodies, at every point of contact,
    without bounce and with friction. All bodies have the same density, and turn by what pushes them off their centre.
    One env step is one step of the engine, so that contacts are single events; agents decide best every 10 steps
    (`relgym.wrappers.ActionRepeat`).

    Action Space
    ------------
    ``Box(-1, 1, (2,), float32)``, mapped to the pusher's velocity, -0.02 to 0.02 units per step along x and y. In the
    schema the bodiless object ``action`` has the physical properties ``vx`` and ``vy``.

    Observation Space
    -----------------
    ``Dict``, object name -> ``Box(float64)`` in the order of the type's properties:

    ============  ================================================  ===============  =====  ====
    property      meaning                                           unit             min    max
    ============  ================================================  ===============  =====  ====
    px, py, pz    position of the centre of mass                    unit             -1e4   1e4
    rx, ry, rz    rotation; rz, about the axis that points up from  radian           -1e4   1e4
                  the table, isn't wrapped
    sx, sy, sz    full extents                                      unit             0      1e3
    vx, vy, spin  last displacement and rotation (not of rails)     unit or radian   -10    10
    dx, dy        way from the parcel to the goal (``goal``)        unit             -1e4   1e4
    ============  ================================================  ===============  =====  ====

    Objects: ``pusher``, ``parcel``, ``box1`` … ``boxN``, ``rail1`` … ``rail4``, and ``goal``, which has no body. The
    observation is Markov.

    Rewards
    -------
    ``|dx| + |dy| - |dx'| - |dy'| - 0.001`` with a prime for the next scene, and 2 more when the parcel's centre is
    within 0.1 of the goal along both axes: `DeliverTask`.

    Starting State
    --------------
    The pusher's diameter is 0.16–0.24. The parcel is 0.35–0.5 long and wide (as a T 0.5–0.6 both ways), boxes
    0.25–0.45; all are turned any way and lie at rest, apart from each other. A number of the boxes, drawn too, lies on
    the table, the others on a shelf beside it. The parcel and the goal are at least 0.6 from the rails, and 0.5–1.4
    from each other; pusher and boxes lie anywhere on the table, boxes at least 0.45 from the goal. All uniform, drawn
    again until all that holds.

    Reset options, all optional: ``count`` (boxes on the table), ``pusher_size``, ``parcel_width``, ``parcel_height``,
    ``box1_width``, ``box1_height``, …; `reset_options` lists them. ``info["configuration"]`` holds what was drawn of
    these; passed as options with the same seed, it gives the same scene again.

    Episode End
    -----------
    Terminated when the parcel is in the goal; truncated after 1,000 steps.

    Info
    ----
    ``info["touching"]``: pairs of names that touched in the last step, as the engine found them. After steps also
    ``info["is_success"]``; at reset ``info["scene"]`` and ``info["configuration"]``.

    Arguments
    ---------
    n_boxes
        Number of boxes beside the parcel (0 to 10).
    parcel
        ``"box"`` or ``"tee"``.
    friction
        Coefficient of all contacts.

    Version History
    ---------------
    * v0: initial version.
    """

    @refusing(ConfigError)
    def __init__(
        self,
        n_boxes: int = 2,
        parcel: str = "box",
        friction: float = 0.3,
        render_mode: str | None = None,
    ) -> None:
        if parcel not in _PARCELS:
            raise ConfigError(f"parcel={parcel!r}: expected one of {list(_PARCELS)}")
        self._boxes = tuple(f"box{k + 1}" for k in range(checked_count("n_boxes", n_boxes, 0, 10)))
        self._shapes = (Sphere(), _PARCELS[parcel], *(Box() for _ in self._boxes))
        self._tee = parcel == "tee"
        self._friction = checked_least("friction", friction, 0.0)
        bounds = {
            **dict.fromkeys(POSE[3:6], (-1e4, 1e4)),
            **dict.fromkeys(("vx", "vy", "spin"), (-10.0, 10.0)),
            **dict.fromkeys(BOX_GOAL.properties, (-1e4, 1e4)),
        }
        super().__init__(
            _schema(self._boxes, _PARCELS[parcel]),
            spaces.Box(-1.0, 1.0, (2,), np.float32),
            bounds,
            render_mode,
            task=DeliverTask(),
            time_limit=STEPS,
        )
        self.flat_spec = BOX_FLAT
        self._moving = ("pusher", "parcel", *self._boxes)
        self._columns = np.array(
            [self._layout.slice(self._layout.index(name)).start for name in self._moving]
        )
        self._goal = self._layout.slice(self._layout.index("goal"))
        self._world: BodyWorld | None = None
        self._configuration: Mapping[str, Any] = {}

    _transient = ("_viewer", "_world")

    @property
    def reset_options(self) -> tuple[str, ...]:
        """Names of all options of `reset`."""
        sizes = [f"{name}_{side}" for name in ("parcel", *self._boxes) for side in ("width", "height")]
        return ("count", "pusher_size", *sizes)

    def _begin(self, options: Mapping[str, Any], *, rng: np.random.Generator) -> Float1D:
        check_options(options, self.reset_options)
        draws = Draws(options, rng)
        count = draws.choice("count", tuple(range(len(self._boxes) + 1)))
        extents = self._draw_extents(draws)
        poses, goal = _arranged(extents, count, rng=rng)
        vector = np.zeros(self._layout.width)
        for column, size, (x, y, angle) in zip(self._columns, extents, poses, strict=True):
            depth = size[0] if column == self._columns[0] else 1.0
            vector[column : column + 9] = x, y, 0.0, 0.0, 0.0, angle, *size, depth
        for k, (x, y, angle) in enumerate(_RAILS.tolist()):
            start = self._layout.slice(self._layout.index(f"rail{k + 1}")).start
            vector[start : start + 9] = x, y, 0.0, 0.0, 0.0, angle, *_RAIL, 1.0
        vector[self._goal] = goal - poses[1, :2]
        self._configuration = draws.taken
        self._restore(vector, None)
        return vector

    def _draw_extents(self, draws: Draws) -> list[tuple[float, float]]:
        size = draws.number("pusher_size", Range(0.16, 0.24, 0.05, 0.5))
        parcel = Range(0.5, 0.6, 0.2, 0.8) if self._tee else Range(0.35, 0.5, 0.1, 0.8)
        spans = {"parcel": parcel, **dict.fromkeys(self._boxes, Range(0.25, 0.45, 0.1, 0.8))}
        sides = {
            name: (draws.number(f"{name}_width", span), draws.number(f"{name}_height", span))
            for name, span in spans.items()
        }
        return [(size, size), *sides.values()]

    def _advance(self, state: Float1D, action: Any) -> Float1D:
        world = self._world
        assert world is not None, "a state has its world"
        wanted = physical_action(self.schema, action) / TIME_STEP
        # The motor makes up for the damping, and gives what is asked before contacts act.
        kept = _DAMPING**TIME_STEP * state[self._columns[0] + 9 : self._columns[0] + 11] / TIME_STEP
        accelerations = np.zeros((len(world.bodies), 2))
        accelerations[0] = (wanted - kept) / TIME_STEP
        world.step(accelerations)
        after = state.copy()
        self._write(after, world.poses()[: len(self._moving)])
        parcel = self._columns[1]
        after[self._goal] = state[self._goal] - (after[parcel : parcel + 2] - state[parcel : parcel + 2])
        return after

    def _write(self, vector: Float1D, poses: Float2D) -> None:
        """Enter where bodies are now, and by what they moved."""
        for k, place in enumerate((0, 1, 5)):
            before = vector[self._columns + place].copy()
            vector[self._columns + place] = poses[:, k]
            vector[self._columns + 9 + k] = poses[:, k] - before

    def _info(self) -> dict[str, Any]:
        assert self._world is not None, "a state has its world"
        names = (*self._moving, *(f"rail{k + 1}" for k in range(4)))
        return {"touching": tuple((names[a], names[b]) for a, b in self._world.contacts())}

    def _reset_info(self) -> dict[str, Any]:
        return {"configuration": dict(self._configuration)}

    def _view(self) -> Any:
        from relgym.envs.rendering import View

        side = 2.0 * (HALF + 0.15)
        return View(-side / 2.0, -side / 2.0, side, side)

    def _hidden(self) -> Any:
        assert self._world is not None, "a state has its world"
        state = self._world.state()
        state.flags.writeable = False
        return state

    def _restore(self, vector: Float1D, hidden: Any) -> None:
        bodies = []
        for column, shape in zip(self._columns.tolist(), self._shapes, strict=True):
            extents = float(vector[column + 6]), float(vector[column + 7])
            body = Body(shape, extents, 1.0, 0.0, math.sqrt(self._friction))
            bodies.append(Body(shape, extents, body.area, 0.0, math.sqrt(self._friction)))
        bodies += [Body(Box(), _RAIL, math.inf, 0.0, math.sqrt(self._friction))] * 4
        self._world = BodyWorld(bodies, damping=_DAMPING, memoryless=True, iterations=_ITERATIONS)
        poses, velocities = (
            np.concatenate([np.zeros((len(self._moving), 3)), _RAILS]),
            np.zeros((len(bodies), 3)),
        )
        for k, place in enumerate((0, 1, 5)):
            poses[: len(self._moving), k] = vector[self._columns + place]
            velocities[: len(self._moving), k] = vector[self._columns + 9 + k]
        self._world.place(poses, velocities)
        if hidden is not None:
            self._world.resume(hidden)


_RAIL: Final = (2.0 * (HALF + _THICK), _THICK)
_RAILS: Final = np.array(
    [
        [0.0, -HALF - _THICK / 2.0, 0.0],
        [0.0, HALF + _THICK / 2.0, 0.0],
        [-HALF - _THICK / 2.0, 0.0, math.pi / 2.0],
        [HALF + _THICK / 2.0, 0.0, math.pi / 2.0],
    ]
)


def _schema(boxes: tuple[str, ...], parcel: Shape) -> SceneSchema:
    velocity = ("vx", "vy", None)
    pushed = [ObjectType("parcel", _MOVING, parcel, velocity=velocity)]
    if boxes:
        pushed.append(ObjectType("box", _MOVING, Box(), velocity=velocity))
    moving = (ObjectType("pusher", _MOVING, Sphere(), velocity=velocity), *pushed)
    return SceneSchema(
        (*moving, ObjectType("rail", POSE, Box()), BOX_GOAL, ObjectType(ACTION, ("vx", "vy"))),
        (
            ("pusher", "pusher"),
            ("parcel", "parcel"),
            *((name, "box") for name in boxes),
            *((f"rail{k + 1}", "rail") for k in range(4)),
            ("goal", "goal"),
            (ACTION, ACTION),
        ),
        planar=True,
        kinematics=tuple(Kinematics(t.name, p, v) for t in moving for p, v in _RATES),
        targets=(*(Target(t.name, v) for t in moving for _, v in _RATES), *BOX_TARGETS),
        action_scale=(("vx", -SPEED, SPEED), ("vy", -SPEED, SPEED)),
    )


def _arranged(
    extents: list[tuple[float, float]], count: int, *, rng: np.random.Generator
) -> tuple[Float2D, Float1D]:
    """Poses of pusher, parcel and boxes, of which so many lie on the table, and where the goal is."""
    reach = np.array([math.hypot(*size) / 2.0 for size in extents])
    reach[0] = extents[0][0] / 2.0
    inner = HALF - 0.6
    for _ in range(_TRIES):
        poses = np.zeros((len(extents), 3))
        poses[:, :2] = rng.uniform(-HALF + 0.25, HALF - 0.25, (len(extents), 2))
        poses[1:, 2] = rng.uniform(-math.pi, math.pi, len(extents) - 1)
        poses[1, :2], goal = rng.uniform(-inner, inner, (2, 2))
        there = slice(2 + count)
        apart = (
            np.hypot(*(poses[there, None, :2] - poses[None, there, :2]).T)
            - reach[there, None]
            - reach[None, there]
        )
        np.fill_diagonal(apart, 1.0)
        if not 0.5 <= math.hypot(*(goal - poses[1, :2])) <= 1.4 or apart.min() < 0.02:
            continue
        inside = np.abs(poses[there, :2]).max(axis=1) + reach[there] <= HALF - 0.01
        clear = np.hypot(*(poses[2 : 2 + count, :2] - goal).T) >= 0.45
        if inside.all() and clear.all():
            break
    else:
        raise ConfigError(
            f"no room on the table for {count} boxes of the sizes {extents}; ask for fewer or smaller ones"
        )
    for k in range(2 + count, len(extents)):
        poses[k] = _SHELF + 0.9 * (k - 2 - count), 0.0, 0.0
    return poses, np.asarray(goal)
