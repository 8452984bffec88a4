"""Balls among static convex obstacles in pymunk, parametrised so that the thesis' tables come out exactly.

One `BallWorld.step` is one example: positions move by the current velocities, contacts are found at the new
positions, and the velocities that the *next* displacement will have are solved for. So the contacts that are
visible in a state are those that decide the transition out of it, provided that velocity is read as the last
displacement (§4.1). The complete law of one contact with unit normal n, in units per step, is

    J = max(0, -((1 + e) v.n + g.n)),   v' = v + g + J n + friction,   |friction| <= mu J.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pymunk

__all__ = ["GRAVITY", "TIME_STEP", "BallWorld", "Contact", "Obstacle"]

TIME_STEP = 0.01
"""Seconds of one example: exactly one engine step. With sub-steps a bounce is no linear function any more."""

GRAVITY = 9.8
"""Downward acceleration in units / s^2: 9.8e-4 units / step^2."""

_FACE_TOLERANCE = 1e-9
"""Largest difference between a contact normal and a face normal at which the contact lies on that face."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A static convex polygon.

    Parameters
    ----------
    name
        The object's name.
    vertices
        Corners in counter-clockwise order, in world coordinates.
    elasticity, friction
        Coefficients of a ball's contact with it: Chipmunk multiplies those of two shapes, and a ball's are 1.
    """

    name: str
    vertices: tuple[Point, ...]
    elasticity: float
    friction: float

    def face_normals(self) -> tuple[Point, ...]:
        """Outward unit normals of the edges."""
        pairs = zip(self.vertices, self.vertices[1:] + self.vertices[:1], strict=True)
        return tuple(_unit(y1 - y0, x0 - x1) for (x0, y0), (x1, y1) in pairs)


@dataclass(frozen=True, slots=True)
class Contact:
    """A contact of a ball, as the engine itself reports it: ground truth that owes nothing to a learner.

    Parameters
    ----------
    ball, other
        Names of the ball and of what it touches.
    normal
        Unit vector from `other` to `ball`: the direction in which the ball is pushed.
    depth
        How far the two overlap, in units (>= 0).
    impulse
        Change of the ball's velocity along `normal`, in units per step; 0 when the two are separating.
    corner
        Whether the ball touches a corner of `other` and not a face (never so for two balls).
    """

    ball: str
    other: str
    normal: Point
    depth: float
    impulse: float
    corner: bool

    @property
    def active(self) -> bool:
        """Whether the contact changes the ball's velocity."""
        return self.impulse > 0.0


class BallWorld:
    """Balls of mass 1 that don't rotate, and obstacles that don't move.

    Parameters
    ----------
    obstacles
        The static polygons.
    radii
        Radius of each ball, by name.
    ball_elasticity, ball_friction
        Coefficients of a contact of two balls.
    iterations
        How often the engine goes over all contacts of a step. 10, its default, leaves simultaneous contacts
        unconverged; 200 are enough where boxes and ramps stand upright. Oblique wedges take thousands.

    Notes
    -----
    Cost: about 5 microseconds a step with one ball and six obstacles, and 5 more for each contact that is
    read.

    A ball whose centre is above a corner exactly, to the last bit, gets a wrong face's normal from the
    engine. Random scenes never hit this; a hand-made one should stay an ulp away.
    """

    def __init__(
        self,
        obstacles: Sequence[Obstacle],
        radii: Mapping[str, float],
        *,
        ball_elasticity: float = 1.0,
        ball_friction: float = 1.0,
        iterations: int = 200,
    ) -> None:
        self._space = _space(iterations)
        self._names: dict[pymunk.Shape, str] = {}
        self._normals: dict[pymunk.Shape, tuple[Point, ...]] = {}
        for obstacle in obstacles:
            self._add_obstacle(obstacle)
        self._bodies = [self._add_ball(name, radius) for name, radius in radii.items()]
        self._ball_names = tuple(radii)
        if len(radii) > 1:
            self._space.on_collision(_BALL, _BALL, pre_solve=_set_contact(ball_elasticity, ball_friction))

    def _add_obstacle(self, obstacle: Obstacle) -> None:
        # Radius 0: with a rounded polygon the geometry that relations see would differ from the engine's.
        shape = pymunk.Poly(self._space.static_body, obstacle.vertices, radius=0.0)
        shape.elasticity, shape.friction = obstacle.elasticity, obstacle.friction
        self._space.add(shape)
        self._names[shape] = obstacle.name
        self._normals[shape] = obstacle.face_normals()

    def _add_ball(self, name: str, radius: float) -> pymunk.Body:
        body = pymunk.Body(1.0, math.inf)  # no spin: the thesis' simulator doesn't roll (§4.1)
        shape = pymunk.Circle(body, radius)
        shape.elasticity, shape.friction, shape.collision_type = 1.0, 1.0, _BALL
        self._space.add(body, shape)
        self._names[shape] = name
        return body

    def land(
        self,
        positions: Sequence[Point],
        displacements: Sequence[Point],
        thrusts: Sequence[Point] | None = None,
    ) -> None:
        """Put the balls where their last displacement, made by the engine, takes them to `positions`.

        Contacts there are then known and solved for, just as if the episode had always been running; and so are
        `thrusts`, accelerations of the balls in units / s^2 for the displacement that follows.
        """
        for body, thrust in zip(self._bodies, thrusts or (), strict=thrusts is not None):
            body.force = thrust  # the mass is 1; the engine forgets forces after a step
        for body, (px, py), (dx, dy) in zip(self._bodies, positions, displacements, strict=True):
            body.position = px - dx, py - dy
            body.velocity = dx / TIME_STEP, dy / TIME_STEP
        self.step()

    def resume(self, positions: Sequence[Point], velocities: Sequence[Point]) -> None:
        """Put the balls at `positions` with the engine's own `velocities` (see `velocities`)."""
        for body, position, velocity in zip(self._bodies, positions, velocities, strict=True):
            body.position = position
            body.velocity = velocity

    def step(self) -> None:
        """Advance by one example."""
        self._space.step(TIME_STEP)

    def positions(self) -> list[Point]:
        """Centre of each ball."""
        return [body.position for body in self._bodies]

    def velocities(self) -> list[Point]:
        """The engine's velocities in units per second: those of the *next* displacement."""
        return [(body.velocity.x, body.velocity.y) for body in self._bodies]

    def contacts(self) -> tuple[Contact, ...]:
        """What each ball touches where it is now; a contact of two balls is listed for both."""
        found: list[Contact] = []
        for name, body in zip(self._ball_names, self._bodies, strict=True):
            body.each_arbiter(self._read, name, found)
        return tuple(found)

    def _read(self, arbiter: pymunk.Arbiter, ball: str, found: list[Contact]) -> None:
        other = arbiter.shapes[1]
        (nx, ny), (jx, jy) = arbiter.normal, arbiter.total_impulse
        points = arbiter.contact_point_set.points
        faces = self._normals.get(other)
        corner = faces is not None and not any(
            abs(nx + fx) < _FACE_TOLERANCE and abs(ny + fy) < _FACE_TOLERANCE for fx, fy in faces
        )
        depth = max(0.0, -points[0].distance)
        impulse = abs(nx * jx + ny * jy) * TIME_STEP
        found.append(Contact(ball, self._names[other], (-nx, -ny), depth, impulse, corner))


_BALL = 1


def _space(iterations: int) -> pymunk.Space:
    space = pymunk.Space()
    space.gravity = (0.0, -GRAVITY)
    # Larger than any displacement of one step, so that overlaps are never pushed out: a push would show up as
    # velocity (59 % of the contacts fit the law with slop 0, all of them with this).
    space.collision_slop = 1.0
    space.iterations = iterations
    # With the default of 3 a pair that touches again within 3 steps starts from stale impulses: hidden state.
    # 0 would drop every contact.
    space.collision_persistence = 1
    return space


def _set_contact(elasticity: float, friction: float) -> Callable[[pymunk.Arbiter, pymunk.Space, Any], None]:
    def pre_solve(arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any) -> None:
        arbiter.restitution = elasticity
        arbiter.friction = friction

    return pre_solve


def _unit(x: float, y: float) -> Point:
    length = math.hypot(x, y)
    return x / length, y / length
