"""A sphere among turned boxes in space, simulated without any of relgym's geometry or laws."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.scene.objects import POSE, ObjectType, SceneSchema, Target
from relgym.scene.shapes import Box, Sphere

GRAVITY = np.array([0.0, -9.8e-4, 0.0])
BALL = ObjectType("ball", (*POSE, "vx", "vy", "vz"), Sphere(), velocity=("vx", "vy", "vz"))
BLOCK = ObjectType("block", POSE, Box())

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """A box: centre, full extents, angles about x, y, z."""

    centre: Array
    size: Array
    angles: Array

    @property
    def turn(self) -> Array:
        (cx, cy, cz), (sx, sy, sz) = np.cos(self.angles), np.sin(self.angles)
        about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        return np.asarray(about_z @ about_y @ about_x)

    def nearest(self, point: Array) -> Array:
        local = self.turn.T @ (point - self.centre)
        return np.asarray(self.centre + self.turn @ np.clip(local, -self.size / 2, self.size / 2))


def schema_of_blocks(count: int) -> SceneSchema:
    """A ball and so many blocks in space."""
    objects = (("ball", "ball"), *((f"block{k}", "block") for k in range(count)))
    return SceneSchema(
        (BALL, BLOCK), objects, planar=False, targets=tuple(Target("ball", v) for v in BALL.velocity if v)
    )


def closed_room(rng: np.random.Generator, floating: int = 4) -> list[Block]:
    """Six walls round a cube of 3, and boxes inside, turned any way."""
    walls = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            centre, size = np.zeros(3), np.full(3, 5.0)
            centre[axis], size[axis] = side * 2.0, 1.0
            walls.append(Block(centre, size, np.zeros(3)))
    inside = [
        Block(
            rng.uniform(-1.1, 1.1, 3) * (1, 0.5, 1) - (0, 0.7, 0),
            rng.uniform(0.3, 0.9, 3),
            rng.uniform(0, 6.3, 3),
        )
        for _ in range(floating)
    ]
    return walls + inside


def episode(
    blocks: list[Block],
    rng: np.random.Generator,
    *,
    steps: int,
    friction: float,
    restitution: Callable[[float], float] = lambda speed: 0.9,
    radius: float = 0.1,
) -> Array:
    """State vectors of one episode, shape ``(steps + 1, width)``."""
    x = np.array([*rng.uniform(-1.2, 1.2, 3)])
    x[1] = rng.uniform(0.6, 1.2)
    v = rng.uniform(-0.03, 0.03, 3)
    fixed = np.concatenate([np.concatenate([b.centre, b.angles, b.size]) for b in blocks])
    rows = []
    for _ in range(steps + 1):
        rows.append(np.concatenate([x, np.zeros(3), np.full(3, 2 * radius), v, fixed]))
        after = _solved(x, v, blocks, radius, friction, restitution)
        x, v = x + after, after
    return np.stack(rows)


def _solved(
    x: Array,
    v: Array,
    blocks: list[Block],
    radius: float,
    friction: float,
    restitution: Callable[[float], float],
) -> Array:
    """Next velocity, by accumulated impulses with a friction cone."""
    normals = []
    for block in blocks:
        away = x - block.nearest(x)
        distance = float(np.linalg.norm(away))
        if 0.0 < distance <= radius:
            normals.append(away / distance)
    w = v + GRAVITY
    pushes, drags = np.zeros(len(normals)), np.zeros((len(normals), 3))
    for _ in range(300 if len(normals) > 1 else 1):
        for k, n in enumerate(normals):
            speed = float(v @ n)
            push = max(0.0, pushes[k] - restitution(abs(speed)) * speed - float(w @ n))
            w = w + (push - pushes[k]) * n
            pushes[k] = push
            drag = drags[k] - (w - (w @ n) * n)
            size, most = float(np.linalg.norm(drag)), friction * push
            drag = drag * (most / size if size > most else 1.0)
            w = w + drag - drags[k]
            drags[k] = drag
    return w
