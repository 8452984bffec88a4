"""The ball-box-ramp domain (§4.1) as a Gymnasium env."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from relgym.envs.arguments import Coefficient, check_options, checked_count, counted, numbered, per_object
from relgym.envs.ball_scenes import BALL_PLACES, Placed, draw_room, option_names
from relgym.envs.base import SceneEnv
from relgym.envs.physics import BallWorld, Contact, Obstacle, Point
from relgym.errors import ConfigError
from relgym.scene.objects import POSE, Float1D, Kinematics, ObjectType, SceneSchema, Target
from relgym.scene.shapes import Box, Sphere, Wedge, outline

__all__ = ["BallBoxRampEnv", "configurations"]

_SHELL = {"floor": "floor", "ceiling": "ceiling", "left_wall": "wall", "right_wall": "wall"}
_KINDS = ("box", "ramp")
_X, _Y, _SX, _SY, _RZ = (POSE.index(name) for name in ("px", "py", "sx", "sy", "rz"))
_VX = len(POSE)  # a ball's velocity follows its pose


def configurations() -> tuple[dict[str, Any], ...]:
    """The thesis' 40 initial configurations (Table 4.1), as reset options."""
    return tuple(
        {"ramp": ramp, "touching": touching, "ball": place, "direction": direction}
        for ramp in ("left", "right")
        for touching in (True, False)
        for place in BALL_PLACES
        for direction in ("left", "right")
    )


class BallBoxRampEnv(SceneEnv):
    """A ball flies, bounces and slides in a room with a box and a ramp; nobody acts.

    Description
    -----------
    The world of the thesis' experiments (§4.1). A ball that doesn't rotate moves under gravity among a
    floor, a ceiling, two walls and what stands on the floor. One step is 0.01 s. The pair of position and
    velocity at one step determines the next: with g = (0, -9.8e-4), a contact's unit normal n, elasticity e
    and friction mu, ``J = max(0, -((1+e) v.n + g.n))`` and ``v' = v + g + J n + friction``, where friction
    opposes sliding and is at most ``mu J``. Balls have elasticity and friction 1, so that a contact has the
    coefficients of the obstacle.

    Action Space
    ------------
    ``Discrete(1)``: watch. The schema has no action object.

    Observation Space
    -----------------
    ``Dict``, object name -> ``Box(float64)`` in the order of the type's properties:

    ===================  ========================================  =======  ========  =======
    property             meaning                                   unit     min       max
    ===================  ========================================  =======  ========  =======
    px, py, pz           position of the centre (pz = 0)           unit     -1e4      1e4
    rx, ry, rz           rotation (0)                              radian   -pi       pi
    sx, sy, sz           full extents; a ball's diameter           unit     0         1e3
    vx, vy (balls only)  last displacement, p_t - p_{t-1}          unit     -1        1
    ===================  ========================================  =======  ========  =======

    Objects: ``ball``; ``box``, ``ramp``; ``floor``, ``ceiling``, ``left_wall``, ``right_wall``. A ramp's
    vertical side is on its left, wherever it stands; its incline is sy / sx.

    Rewards
    -------
    Always 0.

    Starting State
    --------------
    Room 4.5–6 wide and 2.5–3.5 high; ball radius 0.08–0.15; box 0.6–1 wide, 0.4–0.9 high; ramp base 1–1.5,
    scaled down when it would be higher than 1. Box and ramp touch, or are 4–8 ball radii apart, with 30–70
    % of the free floor on their left. *Leftmost* and *rightmost*: on the floor, sunk 1–10 mm, 3–6 units/s;
    *above-left* and *above-right*: 0.1–0.8 over the object; *between*: 0.05–0.6 over the higher one, or on
    the floor in half of the cases where there is one between them. In the air: 0.5–4 units/s sideways.
    Everything is shifted by up to 5 along both axes. All uniform. The first velocity is the displacement
    that led to the first position.

    Reset options, all optional: ``ramp`` ("left", "right"), ``touching`` (bool), ``ball`` ("leftmost",
    "above-left", "between", "above-right", "rightmost"), ``direction`` ("left", "right"), and every other
    draw: ``room_width``, ``room_height``, ``left_share``, ``gap`` (in ball radii), ``shift_x``,
    ``shift_y``, ``box_width``, ``box_height``, ``ramp_base``, ``ball_radius``, ``ball_floor`` (bool),
    ``ball_x`` (0–1 along the place), ``ball_sink``, ``ball_drop``, ``ball_speed``. `reset_options` lists
    those of an instance: objects beyond the first of their kind have options of their own (``box2_width``,
    ``ball2``, ``ball2_direction``), and ``order`` replaces ``ramp`` when the standing objects aren't a box
    and a ramp. ``info["configuration"]`` holds what was drawn: passed as options, it gives the same scene
    again.

    Episode End
    -----------
    Never terminates; truncated after 200 steps by the registered time limit.

    Info
    ----
    ``info["contacts"]``: a tuple of `Contact`, the engine's own record of what touches what in the current
    state, which is what decides the next step. At reset also ``info["scene"]`` and
    ``info["configuration"]``.

    Arguments
    ---------
    incline
        Angle of the ramps in degrees, in (0, 90); a number, or a mapping by ramp name.
    elasticity, friction
        Coefficients e (0 to 1) and mu (>= 0) of a contact: a number, or a mapping by object name or type
        (``{"floor": 0.1, "ramp2": 0.3}``, the rest as by default). Two balls take the entry ``"ball"``.
    objects
        Kinds of the objects that stand on the floor: ``("box",)``, ``("box", "ramp", "ramp")``, or counts
        ``{"box": 1, "ramp": 2}``. Beyond two of them the room is 2 units wider for each.
    balls
        How many balls (>= 1): ``ball``, ``ball2``, …
    type_names
        ``"shape"``: ball, box, ramp, floor, wall, ceiling. ``"thesis"``: the coefficients are part of the
        type's name (§4.2), friction first: ``box_0.1_0.9``, ``ramp_0.3_0.8_60``; the parent is ``box``,
        ``ramp``.

    Version History
    ---------------
    * v0: initial version.
    """

    _transient = ("_viewer", "_world")

    def __init__(
        self,
        incline: Coefficient = 30.0,
        elasticity: Coefficient = 0.9,
        friction: Coefficient = 0.0,
        objects: Sequence[str] | Mapping[str, int] = ("box", "ramp"),
        balls: int = 1,
        type_names: str = "shape",
        render_mode: str | None = None,
    ) -> None:
        self._standing = counted(objects, _KINDS)
        self._balls = numbered("ball", checked_count("balls", balls, 1, 100))
        kinds = {**dict.fromkeys(self._balls, "ball"), **self._standing, **_SHELL}
        ramps = {name: kind for name, kind in self._standing.items() if kind == "ramp"}
        self._incline = per_object("incline", incline, ramps, 30.0, (1e-3, 90.0 - 1e-3))
        self._elasticity = per_object("elasticity", elasticity, kinds, 0.9, (0.0, 1.0))
        self._friction = per_object("friction", friction, kinds, 0.0, (0.0, math.inf))
        types = self._types(kinds, type_names)
        super().__init__(
            _schema(kinds, types), spaces.Discrete(1), {"vx": (-1.0, 1.0), "vy": (-1.0, 1.0)}, render_mode
        )
        self._offsets = [self._layout.offsets[self._layout.index(ball)] for ball in self._balls]
        self._world: BallWorld | None = None
        self._configuration: Mapping[str, Any] = {}

    @property
    def reset_options(self) -> tuple[str, ...]:
        """Names of all options of `reset`."""
        return tuple(option_names(self._standing, self._balls))

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """What the balls touch in the current state, by the engine's own record."""
        self._required_state()
        return self._engine.contacts()

    @property
    def _engine(self) -> BallWorld:
        assert self._world is not None, "made at reset"
        return self._world

    def _begin(self, options: Mapping[str, Any], *, rng: np.random.Generator) -> Float1D:
        check_options(options, self.reset_options)
        inclines = {name: math.radians(degrees) for name, degrees in self._incline.items()}
        room = draw_room(self._standing, self._balls, inclines, options=options, rng=rng)
        self._configuration = room.configuration
        state = np.concatenate(
            [_properties(name, room.objects[name], self._balls) for name in self._layout.names]
        )
        return self._landed(state)

    def _landed(self, state: Float1D) -> Float1D:
        """Build the engine for `state` and let the last displacement happen in it."""
        self._world = self._build(state)
        centres = [(float(state[o + _X]), float(state[o + _Y])) for o in self._offsets]
        moves = [(float(state[o + _VX]), float(state[o + _VX + 1])) for o in self._offsets]
        self._world.land(centres, moves)
        before = [(x - dx, y - dy) for (x, y), (dx, dy) in zip(centres, moves, strict=True)]
        return self._read(state.copy(), before)

    def _advance(self, state: Float1D, action: Any) -> Float1D:
        self._engine.step()
        return self._read(state.copy(), [(state[o + _X], state[o + _Y]) for o in self._offsets])

    def _read(self, state: Float1D, before: Sequence[tuple[float, float]]) -> Float1D:
        """Write positions and displacements into `state`, the state vector to be."""
        for o, (x, y), (old_x, old_y) in zip(self._offsets, self._engine.positions(), before, strict=True):
            state[o + _X], state[o + _Y] = x, y
            state[o + _VX], state[o + _VX + 1] = x - old_x, y - old_y
        return state

    def _info(self) -> dict[str, Any]:
        return {"contacts": self._engine.contacts()}

    def _reset_info(self) -> dict[str, Any]:
        return {"configuration": dict(self._configuration)}

    def _hidden(self) -> Any:
        return tuple(self._engine.velocities())

    def _restore(self, vector: Float1D, hidden: Any) -> None:
        self._state = self._landed(vector)
        if hidden is not None:
            # The landing made the contacts known; now remove its rounding.
            self._state = vector.copy()
            self._engine.resume([(vector[o + _X], vector[o + _Y]) for o in self._offsets], hidden)

    def _build(self, state: Float1D) -> BallWorld:
        scene = self._scene_of(state)
        obstacles = [
            Obstacle(o.name, _vertices(o.type, o.values), self._elasticity[o.name], self._friction[o.name])
            for o in scene
            if o.name not in self._balls
        ]
        radii = {ball: scene[ball]["sx"] / 2 for ball in self._balls}
        first = self._balls[0]
        return BallWorld(
            obstacles, radii, ball_elasticity=self._elasticity[first], ball_friction=self._friction[first]
        )

    def _types(self, kinds: Mapping[str, str], type_names: str) -> dict[str, ObjectType]:
        """Type of each object, by name."""
        if type_names not in ("shape", "thesis"):
            raise ConfigError(f"type_names={type_names!r}: expected 'shape' or 'thesis'")
        return {name: self._type(name, kind, type_names == "thesis") for name, kind in kinds.items()}

    def _type(self, name: str, kind: str, thesis: bool) -> ObjectType:
        if kind == "ball":
            return ObjectType("ball", (*POSE, "vx", "vy"), Sphere(), velocity=("vx", "vy", None))
        shape = Wedge() if kind == "ramp" else Box()
        if not thesis:
            return ObjectType(kind, POSE, shape)
        numbers = [
            self._friction[name],
            self._elasticity[name],
            *([self._incline[name]] if kind == "ramp" else []),
        ]
        return ObjectType("_".join([kind, *(f"{number:g}" for number in numbers)]), POSE, shape, parent=kind)


def _schema(kinds: Mapping[str, str], types: Mapping[str, ObjectType]) -> SceneSchema:
    return SceneSchema(
        types=tuple({t.name: t for t in types.values()}.values()),
        objects=tuple((name, types[name].name) for name in kinds),
        up="y",
        planar=True,
        kinematics=(Kinematics("ball", "px", "vx"), Kinematics("ball", "py", "vy")),
        targets=(Target("ball", "vx"), Target("ball", "vy")),
    )


def _properties(name: str, placed: Placed, balls: Sequence[str]) -> Float1D:
    values = np.zeros(len(POSE) + (2 if name in balls else 0))
    values[[_X, _Y, _SX, _SY]] = placed.x, placed.y, placed.width, placed.height
    values[_SY + 1] = placed.width if name in balls else 1.0
    if name in balls:
        values[_VX:] = placed.dx, placed.dy
    return values


def _vertices(t: ObjectType, values: Float1D) -> tuple[Point, ...]:
    """Corners of an obstacle in the plane, counter-clockwise."""
    assert t.shape is not None, "obstacles have bodies"
    x, y, width, height, angle = (float(values[i]) for i in (_X, _Y, _SX, _SY, _RZ))
    corners = [(u * width, w * height) for u, w in outline(t.shape).tolist()]
    if angle != 0.0:  # an unrotated corner must not be rounded
        cos, sin = math.cos(angle), math.sin(angle)
        corners = [(cos * u - sin * w, sin * u + cos * w) for u, w in corners]
    return tuple((x + u, y + w) for u, w in corners)
