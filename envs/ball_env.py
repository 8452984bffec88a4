"""What all worlds of balls among boxes and ramps share: coefficients, types, and the engine behind the state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from relgym.envs.arguments import Coefficient, counted, per_object
from relgym.envs.ball_rooms import Placed
from relgym.envs.base import SceneEnv
from relgym.envs.physics import BallWorld, Contact, Obstacle, Point
from relgym.envs.tasks import Task
from relgym.errors import ConfigError
from relgym.scene.objects import POSE, Float1D, Kinematics, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere, Wedge, outline

__all__ = ["BallEnv", "body_values"]

_SHELL = {"floor": "floor", "ceiling": "ceiling", "left_wall": "wall", "right_wall": "wall"}
_KINDS = ("box", "ramp")
_X, _Y, _SX, _SY, _RZ = (POSE.index(name) for name in ("px", "py", "sx", "sy", "rz"))
_VX = len(POSE)  # a ball's velocity follows its pose


class BallEnv(SceneEnv):
    """Base of the envs in which balls move in a room; see `BallBoxRampEnv` for most of the arguments.

    Parameters
    ----------
    balls
        Names of the balls.
    signs
        Types of bodiless objects besides, each with one object of its own name.
    targets
        What is to be learned besides the balls' velocities.
    bounds
        Smallest and largest value of properties besides those of bodies.
    """

    _transient = ("_viewer", "_world")

    def __init__(
        self,
        *,
        balls: tuple[str, ...],
        incline: Coefficient,
        elasticity: Coefficient,
        friction: Coefficient,
        objects: Sequence[str] | Mapping[str, int],
        type_names: str,
        action_space: spaces.Space[Any],
        render_mode: str | None,
        signs: Sequence[ObjectType] = (),
        targets: Sequence[Target] = (),
        action_scale: tuple[tuple[str, float, float], ...] = (),
        bounds: Mapping[str, tuple[float, float]] | None = None,
        task: Task | None = None,
    ) -> None:
        self._standing = counted(objects, _KINDS)
        self._balls = balls
        kinds = {**dict.fromkeys(balls, "ball"), **self._standing, **_SHELL}
        ramps = {name: kind for name, kind in self._standing.items() if kind == "ramp"}
        self._incline = per_object("incline", incline, ramps, 30.0, (1e-3, 90.0 - 1e-3))
        self._elasticity = per_object("elasticity", elasticity, kinds, 0.9, (0.0, 1.0))
        self._friction = per_object("friction", friction, kinds, 0.0, (0.0, math.inf))
        types = self._types(kinds, type_names) | {t.name: t for t in signs}
        super().__init__(
            _schema(types, targets, action_scale),
            action_space,
            {"vx": (-1.0, 1.0), "vy": (-1.0, 1.0), **(bounds or {})},
            render_mode,
            task=task,
        )
        self._offsets = [self._layout.offsets[self._layout.index(ball)] for ball in balls]
        self._world: BallWorld | None = None
        self._configuration: Mapping[str, Any] = {}

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """What the balls touch in the current state, by the engine's own record."""
        self._required_state()
        return self._engine.contacts()

    @property
    def _engine(self) -> BallWorld:
        assert self._world is not None, "made at reset"
        return self._world

    @property
    def _inclines(self) -> dict[str, float]:
        """Angle of each ramp in radians."""
        return {name: math.radians(degrees) for name, degrees in self._incline.items()}

    def _motion(self, state: Float1D) -> tuple[list[Point], list[Point]]:
        """Centre and last displacement of each ball."""
        centres = [(float(state[o + _X]), float(state[o + _Y])) for o in self._offsets]
        moves = [(float(state[o + _VX]), float(state[o + _VX + 1])) for o in self._offsets]
        return centres, moves

    def _landed(self, state: Float1D) -> Float1D:
        """Build the engine for `state` and let the last displacement happen in it."""
        self._world = self._build(state)
        centres, moves = self._motion(state)
        self._world.land(centres, moves)
        before = [(x - dx, y - dy) for (x, y), (dx, dy) in zip(centres, moves, strict=True)]
        return self._read(state.copy(), before)

    def _read(self, state: Float1D, before: Sequence[Point]) -> Float1D:
        """Write the engine's positions and the displacements since `before` into `state`, the vector to be."""
        return self._write(state, self._engine.positions(), before)

    def _write(self, state: Float1D, now: Sequence[Point], before: Sequence[Point]) -> Float1D:
        for o, (x, y), (old_x, old_y) in zip(self._offsets, now, before, strict=True):
            state[o + _X], state[o + _Y] = x, y
            state[o + _VX], state[o + _VX + 1] = x - old_x, y - old_y
        return state

    def _info(self) -> dict[str, Any]:
        return {"contacts": self._engine.contacts()}

    def _reset_info(self) -> dict[str, Any]:
        return {"configuration": dict(self._configuration)}

    def _build(self, state: Float1D) -> BallWorld:
        scene = self._scene_of(state)
        obstacles = [
            Obstacle(o.name, _vertices(o.type, o.values), self._elasticity[o.name], self._friction[o.name])
            for o in scene
            if o.type.has_body and o.name not in self._balls
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


def _schema(
    types: Mapping[str, ObjectType],
    targets: Sequence[Target],
    action_scale: tuple[tuple[str, float, float], ...],
) -> SceneSchema:
    return SceneSchema(
        types=tuple({t.name: t for t in types.values()}.values()),
        objects=tuple((name, t.name) for name, t in types.items()),
        up="y",
        planar=True,
        kinematics=(Kinematics("ball", "px", "vx"), Kinematics("ball", "py", "vy")),
        targets=(Target("ball", "vx"), Target("ball", "vy"), *targets),
        action_scale=action_scale,
    )


def body_values(name: str, placed: Placed, balls: Sequence[str]) -> Float1D:
    """Property vector of a body: of a ball if it is among `balls`."""
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
