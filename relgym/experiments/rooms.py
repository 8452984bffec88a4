"""Rooms that no learner was trained in: many boxes, ramps that face either way, boxes that float, turned."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from relgym.envs.physics import BallWorld, Obstacle, Point
from relgym.scene.objects import POSE, Float2D, Kinematics, ObjectType, Scene, SceneLayout, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Prism, Sphere, Wedge, outline

__all__ = ["Room", "room_schema", "rooms"]

_BALL = ObjectType("ball", (*POSE, "vx", "vy"), Sphere(), velocity=("vx", "vy", None))
_TYPES = (
    _BALL,
    ObjectType("box", POSE, Box()),
    ObjectType("ramp", POSE, Wedge()),
    ObjectType("counterramp", POSE, Prism(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5)))),
    *(ObjectType(name, POSE, Box()) for name in ("floor", "ceiling", "wall")),
)
_SHELL = (("floor", "floor"), ("ceiling", "ceiling"), ("left_wall", "wall"), ("right_wall", "wall"))
_HEIGHT, _THICK, _CELL = 3.6, 0.5, 1.8
_ITERATIONS = 20_000  # of the engine: turned boxes make wedges whose contacts settle slowly; 200 leave 1e-5


@dataclass(frozen=True, slots=True)
class Room:
    """What a ball did in one room.

    Attributes
    ----------
    schema, layout
        What the room is made of.
    vectors
        State vectors, shape ``(steps + 1, layout.width)``.
    """

    schema: SceneSchema
    layout: SceneLayout
    vectors: Float2D

    def __len__(self) -> int:
        return len(self.vectors) - 1

    def transitions(self) -> Iterator[Transition]:
        """Its transitions in order."""
        scenes = [Scene(self.schema, self.layout, vector) for vector in self.vectors]
        return (Transition(before, after) for before, after in pairwise(scenes))


def room_schema(objects: int) -> SceneSchema:
    """Schema of rooms with a shell of four and so many objects inside: by turns boxes, ramps, turned boxes."""
    kinds = ("box", "ramp", "counterramp", "box")
    inside = tuple((f"object{k + 1}", kinds[k % 4]) for k in range(objects))
    return SceneSchema(
        _TYPES,
        (("ball", "ball"), *_SHELL, *inside),
        kinematics=(Kinematics("ball", "px", "vx"), Kinematics("ball", "py", "vy")),
        targets=(Target("ball", "vx"), Target("ball", "vy")),
    )


def rooms(
    count: int,
    *,
    objects: int,
    elasticity: float,
    friction: float,
    rng: np.random.Generator,
    steps: int = 200,
) -> list[Room]:
    """Let a ball move through random rooms.

    Parameters
    ----------
    count
        Number of rooms.
    objects
        Objects inside each: boxes and ramps (8–70 degrees, facing either way) stand on the floor side by side,
        every fourth one is a box that floats above them, turned by any angle.
    elasticity, friction
        Coefficients of every contact.
    rng
        Source of everything random.
    steps
        Steps in each room.
    """
    schema = room_schema(objects)
    return [_room(schema, objects, elasticity, friction, steps, rng=rng) for _ in range(count)]


def _room(
    schema: SceneSchema,
    objects: int,
    elasticity: float,
    friction: float,
    steps: int,
    *,
    rng: np.random.Generator,
) -> Room:
    width = _CELL * (objects + 1)
    layout = schema.layout()
    poses = {
        "floor": (width / 2, -_THICK / 2, width + 2 * _THICK, _THICK, 0.0),
        "ceiling": (width / 2, _HEIGHT + _THICK / 2, width + 2 * _THICK, _THICK, 0.0),
        "left_wall": (-_THICK / 2, _HEIGHT / 2, _THICK, _HEIGHT, 0.0),
        "right_wall": (width + _THICK / 2, _HEIGHT / 2, _THICK, _HEIGHT, 0.0),
    }
    for k in range(objects):
        poses[f"object{k + 1}"] = _placed(k, _CELL * (k + 1), rng=rng)
    shift = rng.uniform(-5.0, 5.0, 2)
    state = {name: _values(shift, pose) for name, pose in poses.items()}
    obstacles = [
        Obstacle(name, _corners(schema.type_of(name), state[name]), elasticity, friction) for name in poses
    ]
    radius = float(rng.uniform(0.08, 0.15))
    start = rng.uniform((0.5, _HEIGHT - 0.6), (width - 0.5, _HEIGHT - 0.2)) + shift
    first = (float(rng.choice((-1.0, 1.0)) * rng.uniform(0.005, 0.05)), float(rng.uniform(-0.05, 0.0)))
    world = BallWorld(obstacles, {"ball": radius}, iterations=_ITERATIONS)
    world.land([(float(start[0]), float(start[1]))], [first])
    rows, before = [], (float(start[0]) - first[0], float(start[1]) - first[1])
    fixed = np.concatenate([state[name] for name in layout.names[1:]])
    for k in range(steps + 1):
        if k:
            world.step()
        ((x, y),) = world.positions()
        ball = [x, y, 0.0, 0.0, 0.0, 0.0, 2 * radius, 2 * radius, 2 * radius, x - before[0], y - before[1]]
        rows.append(np.concatenate([ball, fixed]))
        before = (x, y)
    return Room(schema, layout, np.stack(rows))


def _placed(k: int, x: float, *, rng: np.random.Generator) -> tuple[float, float, float, float, float]:
    """Position, extents and angle of the k-th object, whose cell is centred at x."""
    if k % 4 == 3:
        size = rng.uniform(0.4, 0.8, 2)
        place = (x, float(rng.uniform(1.6, 2.4)))
        return (*place, float(size[0]), float(size[1]), float(rng.uniform(0.0, 2.0 * math.pi)))
    base = float(rng.uniform(0.6, 1.6))
    height = float(rng.uniform(0.3, 1.0))
    if k % 4 in (1, 2):
        height = base * math.tan(math.radians(float(rng.uniform(8.0, 70.0))))
        base, height = base * min(1.0, 1.0 / height), min(1.0, height)
    return x, height / 2, base, height, 0.0


def _values(shift: Float2D, pose: tuple[float, float, float, float, float]) -> Float2D:
    x, y, sx, sy, angle = pose
    return np.array([x + shift[0], y + shift[1], 0.0, 0.0, 0.0, angle, sx, sy, 1.0])


def _corners(t: ObjectType, values: Float2D) -> tuple[Point, ...]:
    """Corners of an obstacle in the plane, counter-clockwise."""
    assert t.shape is not None, "obstacles have bodies"
    x, y, angle, width, height = (float(values[i]) for i in (0, 1, 5, 6, 7))
    corners = [(u * width, w * height) for u, w in outline(t.shape).tolist()]
    if angle != 0.0:
        cos, sin = math.cos(angle), math.sin(angle)
        corners = [(cos * u - sin * w, sin * u + cos * w) for u, w in corners]
    return tuple((x + u, y + w) for u, w in corners)
