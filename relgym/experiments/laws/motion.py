"""Balls among turned boxes on their way, in the plane or in space: without relgym's geometry, laws or engine.

Contacts are found by clamping to boxes, and solved together by accumulated impulses with a friction cone, until they
have settled. As in `relgym.envs.physics` the contacts that are visible in a state decide the transition out of it,
and velocity is the last displacement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.laws.worlds import Block, Material, World, block_room
from relgym.scene.objects import Float2D

__all__ = ["PULL", "episode"]

Array = NDArray[np.float64]

PULL: Final = 9.8e-4
"""Gravity, in units per step squared, against the second axis."""

_SWEEPS, _SETTLED = 2_000, 1e-16


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
    drag: Array
    push: float = 0.0


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
                material = self.world.materials[self.blocks[b].type]
                found.append(_Contact(k, -1, normal, depth, material, np.zeros(len(x))))
            for j in range(k):
                apart = x - self.x[j]
                length = float(np.sqrt(apart @ apart))
                if length <= self.radius[k] + self.radius[j]:
                    depth = float(self.radius[k] + self.radius[j] - length)
                    found.append(_Contact(k, j, apart / length, depth, self.world.between, np.zeros(len(x))))
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
                change = max(change, self._press(contact, approach, w, spin), self._drag(contact, w, spin))
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

    def _press(self, contact: _Contact, approach: float, w: Array, spin: Array) -> float:
        """Bring the normal velocity of a contact into line with its law; by how much the impulse changed."""
        light, material = self._yielding(contact, self.light), contact.material
        if material.spring:
            push = material.spring * contact.depth / light
        else:
            normal = float(self._relative(contact, w, spin) @ contact.normal)
            push = max(0.0, contact.push + (material.rebound(approach) - normal) / light)
        change = push - contact.push
        self._give(contact, change * contact.normal, w, spin)
        contact.push = push
        return abs(change)

    def _drag(self, contact: _Contact, w: Array, spin: Array) -> float:
        """Let friction stop what slips, as far as it can; by how much its impulse changed."""
        most = contact.material.friction * contact.push
        slip = self._relative(contact, w, spin)
        slip = slip - (slip @ contact.normal) * contact.normal
        drag = contact.drag - slip / self._yielding(contact, self.light + self.ease)
        size = float(np.sqrt(drag @ drag))
        drag = drag * (most / size if size > most else 1.0)
        change = drag - contact.drag
        self._give(contact, change, w, spin)
        contact.drag = drag
        return float(np.abs(change).max())

    @staticmethod
    def _yielding(contact: _Contact, ease: Array) -> float:
        """By how much an impulse of 1 changes the relative velocity."""
        return float(ease[contact.ball] + (ease[contact.other] if contact.other >= 0 else 0.0))

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
