"""Balls among turned boxes, in the plane or in space: worlds for laws, simulated without relgym's geometry.

What the thesis' rooms lack: three dimensions, spin, several balls of different mass, materials, and contacts that no
law of relgym's form describes. Own code, of a few lines: contacts are found by clamping to boxes, and solved together
by accumulated impulses with a friction cone, until they have settled. As in `relgym.envs.physics` the contacts that
are visible in a state decide the transition out of it, and velocity is the last displacement.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.scene.objects import POSE, Float2D, Kinematics, ObjectType, SceneSchema, Target
from relgym.scene.shapes import Box, Sphere

__all__ = ["Ball", "Block", "Material", "World", "block_room", "episode"]

Array = NDArray[np.float64]

PULL: Final = 9.8e-4
"""Gravity, in units per step squared, against the second axis."""

_SWEEPS, _SETTLED = 2_000, 1e-16


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


def episode(world: World, *, steps: int, rng: np.random.Generator) -> Float2D:
    """State vectors of one episode in a fresh room, shape ``(steps + 1, width)``; fewer if contacts don't settle.

    A ball at rest in a wedge may be held by ever larger forces that cancel: then two rough contacts don't determine
    what happens next, and the episode ends.

    Parameters
    ----------
    world
        Who lives in it.
    steps
        How many steps.
    rng
        Source of everything random.
    """
    blocks = block_room(world.blocks, world.dimensions, rng=rng)
    motion = _Motion.start(world, blocks, rng=rng)
    still = [_pose(b.centre, b.angles, b.size) for b in blocks]
    rows = []
    for _ in range(steps + 1):
        rows.append(np.concatenate([*motion.rows(), *still]))
        if not motion.step():
            break
    return np.stack(rows)


def _pose(centre: Array, angles: Array, size: Array) -> Array:
    d = len(centre)
    return np.concatenate([centre, np.zeros(3 - d), angles, size, np.ones(3 - d)])


@dataclass(slots=True)
class _Contact:
    """A ball that touches something (`other` < 0: a block), and the impulses of their contact so far."""

    ball: int
    other: int
    normal: Array
    depth: float
    material: Material
    push: float = 0.0
    drag: Array = field(default_factory=lambda: np.zeros(0))


class _Motion:
    """Balls on their way: positions, velocities, angles and spins."""

    def __init__(self, world: World, blocks: Sequence[Block], x: Array, v: Array) -> None:
        self.world, self.blocks = world, blocks
        self.x, self.v = x, v
        self.angle, self.spin = np.zeros(len(x)), np.zeros(len(x))
        self.radius = np.array([b.radius for b in world.balls])
        self.light = np.array([1.0 / b.mass for b in world.balls])
        # A disc's moment is m r^2 / 2.
        self.ease = np.array([2.0 / b.mass if b.spins else 0.0 for b in world.balls])
        self.axes = np.stack([b.axes() for b in blocks])
        self.centres = np.stack([b.centre for b in blocks])
        self.halves = np.stack([b.size for b in blocks]) / 2.0

    @classmethod
    def start(cls, world: World, blocks: Sequence[Block], *, rng: np.random.Generator) -> _Motion:
        """Put balls in the upper part, apart from each other and from all blocks."""
        n, d = len(world.balls), world.dimensions
        while True:
            x = rng.uniform(-1.3, 1.3, (n, d))
            x[:, 1] = rng.uniform(0.2, 1.3, n)
            found = cls(world, blocks, x, rng.uniform(-0.03, 0.03, (n, d)))
            if not found.contacts():
                return found

    def rows(self) -> list[Array]:
        """Each ball's properties."""
        found = []
        for k, ball in enumerate(self.world.balls):
            d = self.world.dimensions
            pose = _pose(self.x[k], np.array([0.0, 0.0, self.angle[k]]), np.full(d, 2.0 * ball.radius))
            pose[8] = 2.0 * ball.radius
            extra = [*([self.spin[k]] if ball.spins else []), *([ball.mass] if self.world.weighed else [])]
            found.append(np.concatenate([pose, self.v[k], extra]))
        return found

    def contacts(self) -> list[_Contact]:
        """Who touches what."""
        found = []
        for k, x in enumerate(self.x):
            local = np.einsum("bij,bi->bj", self.axes, x - self.centres)
            away = local - np.clip(local, -self.halves, self.halves)
            distance = np.sqrt((away * away).sum(axis=1))
            for b in np.flatnonzero((distance <= self.radius[k]) & (distance > 0.0)).tolist():
                normal = self.axes[b] @ away[b] / distance[b]
                depth = float(self.radius[k] - distance[b])
                found.append(_Contact(k, -1, normal, depth, self.world.materials[self.blocks[b].type]))
            for j in range(k):
                apart = x - self.x[j]
                length = float(np.sqrt(apart @ apart))
                if length <= self.radius[k] + self.radius[j]:
                    depth = float(self.radius[k] + self.radius[j] - length)
                    found.append(_Contact(k, j, apart / length, depth, self.world.between))
        return found

    def step(self) -> bool:
        """Solve the contacts there are, then move; whether they settled."""
        contacts = self.contacts()
        before = [float(self._relative(c, self.v, self.spin) @ c.normal) for c in contacts]
        w, spin = self.v.copy(), self.spin.copy()
        w[:, 1] -= PULL
        change = 0.0
        for _ in range(_SWEEPS):
            change = 0.0
            for contact, approach in zip(contacts, before, strict=True):
                change = max(change, self._solve(contact, approach, w, spin))
            if change <= _SETTLED or len(contacts) < 2:
                break
        self.v, self.spin = w, spin
        self.x, self.angle = self.x + w, self.angle + spin
        return change <= _SETTLED or len(contacts) < 2

    def _relative(self, contact: _Contact, v: Array, spin: Array) -> Array:
        """Velocity of one body's surface against the other's where they touch."""
        a, b = contact.ball, contact.other
        relative = v[a] - v[b] if b >= 0 else v[a].copy()
        if self.world.dimensions == 2:
            turning = spin[a] * self.radius[a] + (spin[b] * self.radius[b] if b >= 0 else 0.0)
            relative = relative - turning * _side(contact.normal)
        return np.asarray(relative)

    def _solve(self, contact: _Contact, approach: float, w: Array, spin: Array) -> float:
        """Bring one contact into line with its law; by how much its impulses changed."""
        n, material = contact.normal, contact.material
        a, b = contact.ball, contact.other
        light = self.light[a] + (self.light[b] if b >= 0 else 0.0)
        if material.spring:
            push = material.spring * contact.depth / light
        else:
            normal = float(self._relative(contact, w, spin) @ n)
            push = max(0.0, contact.push + (material.rebound(approach) - normal) / light)
        change = abs(push - contact.push)
        self._give(contact, (push - contact.push) * n, w, spin)
        contact.push = push
        if not material.friction:
            return change
        slip = self._relative(contact, w, spin)
        slip = slip - (slip @ n) * n
        yielding = light + self.ease[a] + (self.ease[b] if b >= 0 else 0.0)
        before = contact.drag if len(contact.drag) else np.zeros(len(n))
        drag = before - slip / yielding
        size, most = float(np.sqrt(drag @ drag)), material.friction * push
        drag = drag * (most / size if size > most else 1.0)
        self._give(contact, drag - before, w, spin)
        contact.drag = drag
        return max(change, float(np.abs(drag - before).max()))

    def _give(self, contact: _Contact, impulse: Array, w: Array, spin: Array) -> None:
        """Let an impulse act on a contact's bodies, in place."""
        turned = float(impulse @ _side(contact.normal)) if self.world.dimensions == 2 else 0.0
        for body, sign in ((contact.ball, 1.0), (contact.other, -1.0)):
            if body >= 0:
                w[body] += sign * self.light[body] * impulse
                # Both bodies' surfaces are dragged in the same sense of rotation.
                spin[body] -= self.ease[body] / self.radius[body] * turned


def _side(normal: Array) -> Array:
    return np.array([-normal[1], normal[0]])
