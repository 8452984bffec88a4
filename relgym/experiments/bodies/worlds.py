"""Worlds of bodies that push, turn and stack between walls: for laws to be learned from, and to be tested on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from relgym.envs.bodies import Body, BodyWorld
from relgym.envs.physics import TIME_STEP
from relgym.experiments.rooms import Room
from relgym.laws.points import find_points
from relgym.scene.axes import Axes
from relgym.scene.geometry.manifolds import Manifolds
from relgym.scene.objects import ACTION, POSE, Float2D, Kinematics, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Compound, Prism, Shape, Sphere

__all__ = ["BEAMS", "SHAPES", "Setting", "body_masses", "body_rooms", "body_schema", "checked_rooms"]

Array = NDArray[np.float64]


def _regular(corners: int) -> Prism:
    angles = 2.0 * math.pi * np.arange(corners) / corners
    return Prism(tuple((0.5 * math.cos(a), 0.5 * math.sin(a)) for a in angles.tolist()))


def _beams() -> Compound:
    """A T in the unit square whose centroid is the origin: a cross beam, and a stem below it."""
    beam, stem, low = 0.3, 0.3, 0.7
    # Areas and centroids of both beams, measured from the lower edge.
    centre = (beam * (low + beam / 2.0) + stem * low * low / 2.0) / (beam + stem * low)
    top, joint, foot = 1.0 - centre, low - centre, -centre
    return Compound(
        (
            ((-0.5, joint), (0.5, joint), (0.5, top), (-0.5, top)),
            ((-stem / 2.0, foot), (stem / 2.0, foot), (stem / 2.0, joint), (-stem / 2.0, joint)),
        )
    )


BEAMS: Final = _beams()
"""A T."""

SHAPES: Final[Mapping[str, Shape]] = {
    "box": Box(),
    "hexagon": _regular(6),
    "triangle": _regular(3),
    "tee": BEAMS,
    "puck": Sphere(),
}
"""Shapes of bodies that are pushed, by the names of their types."""

ROOM: Final = 2.0
"""Half the width of the room between the walls."""

SWEEPS: Final = 10_000
"""Of the engine: two points close to each other settle slowly; 1,000 leave some of them 1e-5 off."""

_PARENT = "pushed"


@dataclass(frozen=True, slots=True)
class Setting:
    """What a world is like.

    Attributes
    ----------
    bodies
        Types of the bodies that are pushed, names of `SHAPES`.
    friction, elasticity
        Of all contacts.
    gravity
        Downward acceleration in units / s^2.
    masses
        ``"seen"``: mass and moment are properties, and mass is drawn; ``"uniform"``: they follow from one density,
        and are not seen; ``"own"``: every object has a mass of its own, the same in all episodes.
    damping
        Share of its velocity that a body keeps in a second.
    drag
        Quadratic drag: deceleration per squared speed, in 1 / unit.
    conveyor
        Speed of the floor's surface, in units / s.
    wind
        Acceleration along the first axis in the right half of the room, in units / s^2.
    magnet
        Attraction between the disc and the first body, in units^3 / s^2 over the square of their distance.
    spring
        Stiffness of a spring between the first two bodies' centres, in 1 / s^2.
    driven
        Whether the disc is pushed by forces that are the action.
    heavy
        Density of the disc, in units of what it would be.
    materials
        Coefficients of friction of the bodies that move, in turn, where they differ; empty: all have the same.
    tilt
        Angle by which walls are turned, in radians: two of them one way and two the other.
    """

    bodies: tuple[str, ...] = ("box", "box", "box")
    friction: float = 0.0
    elasticity: float = 0.0
    gravity: float = 0.0
    masses: Literal["seen", "uniform", "own"] = "seen"
    damping: float = 1.0
    drag: float = 0.0
    conveyor: float = 0.0
    wind: float = 0.0
    magnet: float = 0.0
    spring: float = 0.0
    driven: bool = True
    heavy: float = 1.0
    materials: tuple[float, ...] = ()
    tilt: float = 0.0


def body_schema(setting: Setting) -> SceneSchema:
    """The schema of a setting's scenes: a disc, what it pushes, four walls, and the action."""
    seen = ("mass", "moment") if setting.masses == "seen" else ()
    own = (*POSE, "vx", "vy", "spin", *seen)
    velocity = ("vx", "vy", None)
    # A moment is no rotation: names of shapes say what is pushed.
    moving = [ObjectType("disc", own, Sphere(), velocity=velocity)]
    moving += [
        ObjectType(name, own, SHAPES[name], parent=_PARENT, velocity=velocity)
        for name in dict.fromkeys(setting.bodies)
    ]
    types = [*moving, ObjectType("wall", POSE, Box())]
    if setting.conveyor:
        types.append(ObjectType("belt", POSE, Box()))
    objects = [("disc", "disc"), *((f"body{k + 1}", name) for k, name in enumerate(setting.bodies))]
    objects += [("wall1", "belt" if setting.conveyor else "wall"), *((f"wall{k}", "wall") for k in (2, 3, 4))]
    if setting.driven:
        types.append(ObjectType(ACTION, ("fx", "fy"), exogenous=("fx", "fy")))
        objects.append((ACTION, ACTION))
    rates = (("px", "vx"), ("py", "vy"), ("rz", "spin"))
    return SceneSchema(
        tuple(types),
        tuple(objects),
        planar=True,
        kinematics=tuple(Kinematics(t.name, p, v) for t in moving for p, v in rates),
        targets=tuple(Target(t.name, v) for t in moving for _, v in rates),
    )


def body_rooms(setting: Setting, count: int, *, seed: int, steps: int = 200) -> list[Room]:
    """Episodes of random pushes in rooms with random bodies.

    Parameters
    ----------
    setting
        What the world is like.
    count
        Number of episodes.
    seed
        Of everything random.
    steps
        Transitions of each.
    """
    return [room for room, _ in _rooms(setting, count, seed, steps, sweeps=1)]


def checked_rooms(setting: Setting, count: int, *, seed: int, steps: int = 200) -> list[tuple[Room, Array]]:
    """`body_rooms`, and how far the engine had settled: its own residual for each step and body that moves.

    That is the change of a velocity (or turning rate) if the same step is solved with twice as many sweeps, in units or
    radians per step; shape ``(steps, bodies)``. It says nothing of any law.
    """
    return list(_rooms(setting, count, seed, steps, sweeps=2))


def _rooms(
    setting: Setting, count: int, seed: int, steps: int, *, sweeps: int
) -> Iterator[tuple[Room, Array]]:
    schema = body_schema(setting)
    rng = np.random.default_rng([seed, 30])
    densities = _densities(setting)
    for _ in range(count):
        vectors, residual = _episode(setting, densities, steps, sweeps, rng=rng)
        yield Room(schema, schema.layout(), vectors), residual


def _densities(setting: Setting) -> Array:
    """Constants of objects: each has the same in all episodes, and for all seeds."""
    return np.random.default_rng(30).uniform(2.0, 8.0, len(setting.bodies) + 1)


def body_masses(setting: Setting, *, seed: int) -> list[Body]:
    """What bodies that move are like in some episode, their masses among it."""
    bodies = _bodies(setting, _densities(setting), rng=np.random.default_rng([seed, 30]))
    return [body for body in bodies if not math.isinf(body.mass)]


def _episode(
    setting: Setting, densities: Array, steps: int, sweeps: int, *, rng: np.random.Generator
) -> tuple[Float2D, Array]:
    """State vectors, and what `sweeps` times as many sweeps of the engine change of each step."""
    bodies = _bodies(setting, densities, rng=rng)
    worlds = [
        BodyWorld(bodies, gravity=setting.gravity, damping=setting.damping, iterations=k * SWEEPS)
        for k in dict.fromkeys((1, sweeps))
    ]
    world = worlds[0]
    poses, velocities = _start(setting, bodies, rng=rng)
    for each in worlds:
        each.place(poses, velocities)
    now = world.poses()
    moving = sum(not math.isinf(body.mass) for body in bodies)
    rows, left, push = [], [], np.zeros(2)
    for step in range(steps + 1):
        if step % 20 == 0 and setting.driven:
            push = rng.uniform(-10.0, 10.0, 2)
        # The action is the change of velocity that it stands for, in units per step.
        rows.append(_vector(setting, bodies, now, velocities, push * TIME_STEP**2))
        begun = world.state()
        for each in worlds:
            each.resume(begun)
            each.step(_accelerations(setting, bodies, now, velocities / TIME_STEP, push))
        after, surer = world.poses(), worlds[-1].poses()
        left.append(np.abs(after - surer).max(axis=1)[:moving])
        velocities, now = after - now, after
    return np.stack(rows), np.stack(left[:-1])


def _bodies(setting: Setting, densities: Array, *, rng: np.random.Generator) -> list[Body]:
    shapes = [Sphere(), *(SHAPES[name] for name in setting.bodies)]
    elasticity, friction = math.sqrt(setting.elasticity), math.sqrt(setting.friction)
    found = []
    for k, shape in enumerate(shapes):
        size = float(rng.uniform(0.2, 0.35)) if not k else 0.0
        extents = (size, size) if not k else tuple(rng.uniform(0.3, 0.7, 2).tolist())
        if isinstance(shape, Sphere):
            extents = (extents[0], extents[0])
        body = Body(shape, extents, elasticity=elasticity, friction=friction)
        density = {"seen": float(rng.uniform(2.0, 8.0)), "uniform": 4.0, "own": float(densities[k])}[
            setting.masses
        ]
        # What has a constant of its own has it as its mass, whatever its size.
        mass = 0.1 * density if setting.masses == "own" else density * body.area
        mass *= 1.0 if k else setting.heavy
        grip = setting.materials[k % len(setting.materials)] if setting.materials else friction
        found.append(Body(shape, extents, mass, elasticity=elasticity, friction=grip))
    still = Body(Box(), (2.0 * ROOM + 2.0, 1.0), math.inf, elasticity=elasticity, friction=friction)
    return [*found, replace(still, surface=setting.conveyor), still, still, still]


_WALLS: Final = np.array(
    [
        [0.0, -ROOM - 0.5, 0.0],
        [0.0, ROOM + 0.5, 0.0],
        [-ROOM - 0.5, 0.0, math.pi / 2.0],
        [ROOM + 0.5, 0.0, math.pi / 2.0],
    ]
)


def _start(setting: Setting, bodies: Sequence[Body], *, rng: np.random.Generator) -> tuple[Array, Array]:
    """Put bodies apart from each other."""
    count = len(bodies) - 4
    crowded = max(1.0, math.sqrt(count / 6.0))
    first, second = np.triu_indices(len(bodies), 1)
    manifolds = Manifolds(Axes((0, 1), (0, 1, 2), 1.0), [body.shape for body in bodies])
    walls = _WALLS + setting.tilt * np.array([[0.0, 0.0, side] for side in (1.0, -1.0, -1.0, 1.0)])
    poses = np.concatenate([np.zeros((count, 3)), walls])
    placed = 0
    while placed < count:
        reach = min(1.6, 1.2 * crowded)
        poses[placed, :2] = rng.uniform(-reach, reach, 2)
        poses[placed, 2] = 0.0 if isinstance(bodies[placed].shape, Sphere) else rng.uniform(-3.0, 3.0)
        some = (second == placed) | ((first == placed) & (second >= count))
        some &= (first < placed) | (first == placed)
        full = _full(bodies, poses)[None]
        hits = np.broadcast_to(some, (1, len(first)))
        placed += not len(find_points(manifolds, full, hits, first, second))
    velocities = np.zeros_like(poses)
    velocities[:count, :2] = rng.uniform(-0.02, 0.02, (count, 2))
    velocities[:count, 2] = rng.uniform(-0.04, 0.04, count)
    return poses, velocities


def _full(bodies: Sequence[Body], poses: Array) -> Array:
    full = np.zeros((len(bodies), 9))
    full[:, :2], full[:, 5], full[:, 8] = poses[:, :2], poses[:, 2], 1.0
    full[:, 6:8] = [body.extents for body in bodies]
    full[[isinstance(body.shape, Sphere) for body in bodies], 8] = [
        body.extents[0] for body in bodies if isinstance(body.shape, Sphere)
    ]
    return full


def _vector(setting: Setting, bodies: Sequence[Body], poses: Array, velocities: Array, push: Array) -> Array:
    full = _full(bodies, poses)
    parts: list[Array] = []
    for k, body in enumerate(bodies):
        parts.append(full[k])
        if not math.isinf(body.mass):
            parts.append(velocities[k])
            if setting.masses == "seen":
                parts.append(np.array([body.mass, body.moment]))
    return np.concatenate([*parts, *([push] if setting.driven else [])])


def _accelerations(
    setting: Setting, bodies: Sequence[Body], poses: Array, velocities: Array, push: Array
) -> Array:
    found = np.zeros((len(bodies), 2))
    found[0] += push
    mass = [body.mass for body in bodies]
    if setting.drag:
        speed = np.sqrt((velocities[:, :2] ** 2).sum(axis=1, keepdims=True))
        found -= setting.drag * speed * velocities[:, :2]
    if setting.wind:
        found[poses[:, 0] > 0.0, 0] += setting.wind
    if setting.magnet:
        apart = poses[1, :2] - poses[0, :2]
        force = setting.magnet * apart / (apart @ apart) ** 1.5
        found[0] += force / mass[0]
        found[1] -= force / mass[1]
    if setting.spring:
        force = setting.spring * (poses[2, :2] - poses[1, :2])
        found[1] += force / mass[1]
        found[2] -= force / mass[2]
    return found
