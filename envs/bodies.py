"""Rigid bodies in the plane that push, turn and stack, in pymunk; parametrised as `relgym.envs.physics` is.

One `BodyWorld.step` is one example. Contacts are found where the bodies are, and the velocities of the next
displacement are solved for: those of a state decide the transition out of it, and so do forces that are given with it.
At each contact point with unit normal n, the velocities of the two surfaces against each other obey

    v'_n = max(u_n, -e v_n),   v'_t = clip(u_t, -mu J_n, mu J_n)

where v is now, and u what it would be without the point's own impulse along that axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pymunk

from relgym.envs.physics import TIME_STEP
from relgym.scene.geometry.areas import mean_squares
from relgym.scene.objects import Float2D
from relgym.scene.shapes import Shape, Sphere, outlines

__all__ = ["Body", "BodyWorld"]


@dataclass(frozen=True, slots=True)
class Body:
    """A body and what it is made of.

    Parameters
    ----------
    shape
        Its canonical shape; the position is the centroid, or turning won't be free of forces.
    extents
        Full extents along the two axes.
    mass
        Mass; infinite for a body that no contact moves.
    elasticity, friction
        Coefficients; those of a contact are the products of its two bodies'.
    turns
        Whether contacts turn it; its moment is that of a uniform density.
    surface
        Velocity of its surface along its first axis, in units / s: a conveyor.
    """

    shape: Shape
    extents: tuple[float, float]
    mass: float = 1.0
    elasticity: float = 1.0
    friction: float = 1.0
    turns: bool = True
    surface: float = 0.0

    @property
    def area(self) -> float:
        """Area in the plane."""
        return float(mean_squares((self.shape,), (0, 1))[0, 0]) * self.extents[0] * self.extents[1]

    @property
    def moment(self) -> float:
        """Moment of inertia; infinite for a body that doesn't turn."""
        if not self.turns or math.isinf(self.mass):
            return math.inf
        _, x2, y2 = mean_squares((self.shape,), (0, 1))[:, 0]
        return self.mass * float(x2 * self.extents[0] ** 2 + y2 * self.extents[1] ** 2)


class BodyWorld:
    """Bodies on their way.

    Parameters
    ----------
    bodies
        The bodies; those of infinite mass stand, or go on with the velocity they are given.
    gravity
        Downward acceleration in units / s^2.
    damping
        Share of its velocity that a body keeps in a second.
    memoryless
        Whether each step begins without what the engine remembers of contacts, so that poses and velocities are all of
        the world's state. The engine then begins from no impulses: where contacts don't settle, what it gives differs.
    iterations
        How often the engine goes over all contacts of a step. Pushing takes hundreds; stacks with friction thousands.

    Notes
    -----
    Cost: about 10 microseconds a step and body that touches something, with 100 iterations.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        *,
        gravity: float = 0.0,
        damping: float = 1.0,
        memoryless: bool = False,
        iterations: int = 500,
    ) -> None:
        self.bodies = tuple(bodies)
        self._space = pymunk.Space()
        self._numbers: dict[pymunk.Shape, int] = {}
        self._space.gravity, self._space.damping = (0.0, -gravity), damping
        # As in `relgym.envs.physics`: overlaps aren't pushed out, and nothing is remembered from earlier contacts.
        self._space.collision_slop, self._space.collision_persistence = 1.0, 1
        self._space.iterations = iterations
        self._made = [self._make(body) for body in bodies]
        self._memoryless = memoryless

    def _make(self, body: Body) -> pymunk.Body:
        if math.isinf(body.mass):
            made = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        else:
            made = pymunk.Body(body.mass, body.moment)
        shapes: list[pymunk.Shape] = []
        if isinstance(body.shape, Sphere):
            shapes = [pymunk.Circle(made, 0.5 * body.extents[0])]
        else:
            scaled = [outline * np.array(body.extents) for outline in outlines(body.shape)]
            shapes = [pymunk.Poly(made, corners.tolist()) for corners in scaled]
        for shape in shapes:
            shape.elasticity, shape.friction = body.elasticity, body.friction
            shape.surface_velocity = (body.surface, 0.0)
            # Parts of one body never touch each other.
            shape.filter = pymunk.ShapeFilter(group=id(made) % 2**31 + 1)
        self._space.add(made, *shapes)
        self._numbers |= {shape: len(self._numbers) + k for k, shape in enumerate(shapes)}
        return made

    def place(self, poses: Float2D, velocities: Float2D) -> None:
        """Put the bodies so that their last displacement took them to where they are.

        Parameters
        ----------
        poses
            Position and angle of each body, shape ``(n, 3)``.
        velocities
            Their last displacements, in units and radians per step, shape ``(n, 3)``.
        """
        for made, (x, y, angle), (vx, vy, spin) in zip(
            self._made, poses.tolist(), velocities.tolist(), strict=True
        ):
            made.position, made.angle = (x - vx, y - vy), angle - spin
            made.velocity, made.angular_velocity = (vx / TIME_STEP, vy / TIME_STEP), spin / TIME_STEP
            if made.body_type == pymunk.Body.KINEMATIC:
                self._space.reindex_shapes_for_body(made)

    def poses(self) -> Float2D:
        """Position and angle of each body, shape ``(n, 3)``: where the next step will find contacts.

        The engine moves bodies at the beginning of its step. It is kept so far behind, so that what is decided in a
        state still acts on the velocities that its contacts decide.
        """
        return np.array(
            [
                (
                    made.position.x + made.velocity.x * TIME_STEP,
                    made.position.y + made.velocity.y * TIME_STEP,
                    made.angle + made.angular_velocity * TIME_STEP,
                )
                for made in self._made
            ]
        ).reshape(-1, 3)

    def state(self) -> Float2D:
        """The engine's own state: position, angle, velocities in units / s, turning rate in radians / s; ``(n, 6)``."""
        return np.array(
            [(*made.position, made.angle, *made.velocity, made.angular_velocity) for made in self._made]
        )

    def resume(self, state: Float2D) -> None:
        """Go on from what `state` gave."""
        for made, (x, y, angle, vx, vy, rate) in zip(self._made, state.tolist(), strict=True):
            made.position, made.angle = (x, y), angle
            made.velocity, made.angular_velocity = (vx, vy), rate
            if made.body_type == pymunk.Body.KINEMATIC:
                self._space.reindex_shapes_for_body(made)

    def step(self, accelerations: Float2D | None = None, spins: Sequence[float] | None = None) -> None:
        """Advance by one example.

        Parameters
        ----------
        accelerations
            Of each body by a force on its centre, in units / s^2, shape ``(n, 2)``.
        spins
            Angular accelerations, in radians / s^2, shape ``(n,)``.
        """
        for k, made in enumerate(self._made):
            if accelerations is not None and math.isfinite(made.mass):
                ax, ay = accelerations[k].tolist()
                made.force = (made.mass * ax, made.mass * ay)
            if spins is not None and math.isfinite(made.moment):
                made.torque = made.moment * spins[k]
        if self._memoryless:
            shapes = [shape for made in self._made for shape in made.shapes]
            self._space.remove(*shapes)
            self._space.add(*sorted(shapes, key=self._numbers.__getitem__))
        self._space.step(TIME_STEP)

    def contacts(self) -> list[tuple[int, int]]:
        """Pairs of bodies that touched in the last step, the smaller number first."""
        numbers = {id(made): k for k, made in enumerate(self._made)}
        found: set[tuple[int, int]] = set()

        def note(arbiter: pymunk.Arbiter, *_: Any) -> None:
            a, b = (numbers[id(shape.body)] for shape in arbiter.shapes)
            found.add((min(a, b), max(a, b)))

        for made in self._made:
            made.each_arbiter(note)
        return sorted(found)
