"""Worlds for laws that the thesis' rooms lack: three dimensions, spin, several balls of different mass, materials.

`relgym.experiments.laws.motion` simulates them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from relgym.scene.objects import POSE, Kinematics, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere

__all__ = ["Ball", "Block", "Material", "World", "block_room"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Material:
    """What a contact is like.

    Attributes
    ----------
    restitution
        Share of the approach speed with which bodies part; or what gives it for a speed, in units per step.
    friction
        Largest ratio of friction to normal impulse.
    spring
        If positive, the contact is soft: it adds so many times the depth of the overlap to the velocity along
        the normal, each step, and nothing else.
    """

    restitution: float | Callable[[float], float] = 0.9
    friction: float = 0.0
    spring: float = 0.0

    def rebound(self, approach: float) -> float:
        """Normal velocity after a contact that was approached with this one."""
        share = self.restitution(abs(approach)) if callable(self.restitution) else self.restitution
        return -share * approach


@dataclass(frozen=True, slots=True)
class Ball:
    """A ball: its type, radius, mass, and whether contacts make it spin."""

    type: str = "ball"
    radius: float = 0.1
    mass: float = 1.0
    spins: bool = False


@dataclass(frozen=True, slots=True)
class Block:
    """A box that never moves: its type, centre, full extents, and angles about x, y and z."""

    type: str
    centre: Array
    size: Array
    angles: Array

    def axes(self) -> Array:
        """The box' own axes, as columns, in as many dimensions as its centre has."""
        (cx, cy, cz), (sx, sy, sz) = np.cos(self.angles), np.sin(self.angles)
        about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        d = len(self.centre)
        return np.asarray((about_z @ about_y @ about_x)[:d, :d])


@dataclass(frozen=True)
class World:
    """Who lives in a world, and what its contacts are like.

    Attributes
    ----------
    dimensions
        2 or 3.
    balls
        The balls. Balls that spin need a plane.
    blocks
        Types of the blocks: ``2 * dimensions`` walls, then those inside.
    materials
        Of contacts with each type of block.
    between
        Of contacts of two balls.
    weighed
        Whether a ball's mass can be seen.
    """

    dimensions: int
    balls: tuple[Ball, ...] = (Ball(),)
    blocks: tuple[str, ...] = ("block",) * 8
    materials: Mapping[str, Material] = field(default_factory=lambda: {"block": Material()})
    between: Material = Material()
    weighed: bool = False

    def schema(self) -> SceneSchema:
        """The schema of its scenes."""
        moving = {ball.type: self._ball_type(ball) for ball in self.balls}
        still = {name: ObjectType(name, POSE, Box()) for name in self.blocks}
        objects = [(f"ball{k + 1}", ball.type) for k, ball in enumerate(self.balls)]
        objects += [(f"block{k + 1}", name) for k, name in enumerate(self.blocks)]
        rates = [
            (t, p, v) for t in moving for p, v in zip(POSE[: self.dimensions], self._velocity, strict=True)
        ]
        rates += [(t.name, "rz", "spin") for t in moving.values() if "spin" in t.properties]
        return SceneSchema(
            (*moving.values(), *still.values()),
            tuple(objects),
            planar=self.dimensions == 2,
            kinematics=tuple(Kinematics(*rate) for rate in rates),
            targets=tuple(Target(t, v) for t, _, v in rates),
        )

    @property
    def _velocity(self) -> tuple[str, ...]:
        return ("vx", "vy", "vz")[: self.dimensions]

    def _ball_type(self, ball: Ball) -> ObjectType:
        extra = [*(["spin"] if ball.spins else []), *(["mass"] if self.weighed else [])]
        named = (*self._velocity, *([None] * (3 - self.dimensions)))
        return ObjectType(ball.type, (*POSE, *self._velocity, *extra), Sphere(), velocity=named)


def block_room(kinds: Sequence[str], dimensions: int, *, rng: np.random.Generator) -> list[Block]:
    """Walls round a cube with edges of 3, and boxes inside that float, turned any way.

    Parameters
    ----------
    kinds
        Types of the blocks: two walls for each axis, then those inside.
    dimensions
        2 or 3.
    rng
        Source of everything random.
    """
    found = []
    for k, kind in enumerate(kinds):
        axis, side = divmod(k, 2)
        if axis < dimensions:
            centre, size = np.zeros(dimensions), np.full(dimensions, 5.0)
            centre[axis], size[axis] = (2 * side - 1) * 2.0, 1.0
            found.append(Block(kind, centre, size, np.zeros(3)))
            continue
        centre = rng.uniform(-1.1, 1.1, dimensions)
        centre[1] = 0.5 * centre[1] - 0.7
        turn = rng.uniform(0.0, 2.0 * np.pi, 3) * ((0, 0, 1) if dimensions == 2 else (1, 1, 1))
        found.append(Block(kind, centre, rng.uniform(0.3, 0.9, dimensions), turn))
    return found
