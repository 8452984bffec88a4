"""The thesis' data sets: blocks of consecutive transitions with ground truth from the envs' own contact logs.

Nothing in the truth owes anything to a learner: it comes from what the physics engine touched, or from the layout
that the truck env drew.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.envs.ball_box_ramp import BallBoxRampEnv, configurations
from relgym.envs.physics import Contact
from relgym.errors import ConfigError
from relgym.experiments.analytic import (
    GRAVITY_STEP,
    REST,
    AnalyticModes,
    Case,
    analytic_modes,
    surface_normals,
)
from relgym.scene.objects import Float2D, Scene, SceneLayout, SceneSchema, Transition

__all__ = ["BALL_EXPERIMENTS", "BallExperiment", "Block", "Truth", "ball_blocks"]

Int1D = NDArray[np.int64]


@dataclass(frozen=True)
class Truth:
    """What really happened in each of a block's n transitions.

    Attributes
    ----------
    mode : mapping of target (``"ball.vx"``) to int array of shape ``(n,)``
        Number of the analytic mode; -1 where no single one applies (corner hits, several active contacts).
    mode_names : mapping of target to the modes' names.
    active : int array of shape ``(n,)``
        How many contacts changed the velocity.
    corner : bool array of shape ``(n,)``
        Whether one of those was with a corner: its normal depends on the geometry, so no linear mode explains it.
    """

    mode: Mapping[str, Int1D]
    mode_names: Mapping[str, tuple[str, ...]]
    active: Int1D
    corner: NDArray[np.bool_]


@dataclass(frozen=True)
class Block:
    """One episode: n consecutive transitions (§4.2).

    Attributes
    ----------
    schema, layout
        What the scenes are made of; all blocks of a data set share the schema.
    vectors : float array of shape ``(n + 1, layout.width)``
        State vectors. Row i with its action is the scene before transition i, row i + 1 the scene after. The last
        row's action is 0: none was chosen there.
    truth
        What really happened.
    configuration
        Reset options that give the same initial scene again.
    """

    schema: SceneSchema
    layout: SceneLayout
    vectors: Float2D
    truth: Truth
    configuration: Mapping[str, Any]

    def __len__(self) -> int:
        return len(self.vectors) - 1

    def scene(self, index: int) -> Scene:
        """The scene of one row of `vectors`."""
        return Scene(self.schema, self.layout, self.vectors[index])

    def transitions(self) -> Iterator[Transition]:
        """The block's transitions in order."""
        scenes = [self.scene(i) for i in range(len(self.vectors))]
        return (Transition(before, after) for before, after in zip(scenes, scenes[1:], strict=False))

    def columns(self, object_name: str, *properties: str) -> Float2D:
        """Values of an object's properties, shape ``(n + 1, len(properties))``."""
        index = self.layout.index(object_name)
        return self.vectors[:, [self.layout.column(index, prop) for prop in properties]]


@dataclass(frozen=True, slots=True)
class BallExperiment:
    """Parameters of one of the ball experiments (§4.3–§4.5)."""

    incline: float
    elasticity: float
    frictions: tuple[float, ...]
    blocks: int
    type_names: str = "shape"

    def modes(self) -> AnalyticModes:
        """The analytic modes of its rooms."""
        return analytic_modes(self.incline, self.elasticity, self.frictions)


BALL_EXPERIMENTS: Mapping[int, BallExperiment] = {
    1: BallExperiment(30.0, 0.9, (0.0,), 80),
    2: BallExperiment(45.0, 0.95, (0.2,), 160),
    3: BallExperiment(45.0, 0.95, (0.1, 0.2), 480, "thesis"),
}
"""The thesis' three experiments: 16,000, 32,000 and 96,000 examples."""

TEST_BLOCKS = 120
"""Blocks of a test set: 24,000 examples (§4.2)."""

BLOCK_STEPS = 200


def ball_blocks(
    experiment: int | BallExperiment,
    *,
    seed: int,
    blocks: int | None = None,
    order: int | None = 0,
    test: bool = False,
) -> Iterator[Block]:
    """Blocks of a ball experiment, one after the other.

    Block k shows configuration k mod 40 (of each friction in turn), so 80 blocks show each one twice.

    Parameters
    ----------
    experiment
        1, 2 or 3, or parameters of your own.
    seed
        Determines sizes, positions and speeds of every block.
    blocks
        How many; default: as many as in the thesis, 120 for a test set.
    order
        Determines in which order the blocks come, without changing them; ``None``: unshuffled.
    test
        Whether to draw a test set, whose scenes differ from those of all training sets.

    Notes
    -----
    Cost: about 25 microseconds a transition.
    """
    setting = _experiment(experiment)
    count = blocks if blocks is not None else (TEST_BLOCKS if test else setting.blocks)
    worlds = _worlds(setting)
    modes, cases = setting.modes(), configurations()
    numbers = np.arange(count)
    if order is not None:
        np.random.default_rng([seed, order, int(test)]).shuffle(numbers)
    for k in numbers.tolist():
        world = worlds[k % len(worlds)]
        options = cases[k // len(worlds) % len(cases)]
        block_seed = int(np.random.SeedSequence([seed, int(test), k]).generate_state(1)[0])
        yield _ball_block(world, options, block_seed, setting, modes)


@dataclass(frozen=True)
class _World:
    """A room with one friction; its objects' names differ from those of the other rooms where these share a schema."""

    env: BallBoxRampEnv
    friction: float
    schema: SceneSchema
    layout: SceneLayout


def _experiment(experiment: int | BallExperiment) -> BallExperiment:
    if isinstance(experiment, BallExperiment):
        return experiment
    if experiment not in BALL_EXPERIMENTS:
        raise ConfigError(f"experiment={experiment!r}: expected one of {sorted(BALL_EXPERIMENTS)}")
    return BALL_EXPERIMENTS[experiment]


def _worlds(setting: BallExperiment) -> list[_World]:
    envs = [
        BallBoxRampEnv(setting.incline, setting.elasticity, mu, type_names=setting.type_names)
        for mu in setting.frictions
    ]
    schema, names = _joint_schema([env.schema for env in envs])
    return [
        _World(env, mu, schema, schema.layout(own))
        for env, mu, own in zip(envs, setting.frictions, names, strict=True)
    ]


def _joint_schema(schemas: list[SceneSchema]) -> tuple[SceneSchema, list[list[str]]]:
    """One schema for several rooms, and the names that each room's objects have in it.

    An object of a type that all rooms have keeps its name; the others are numbered by room (``ramp_1``).
    """
    if len(schemas) == 1:
        return schemas[0], [list(schemas[0].order)]
    shared = set.intersection(*({t.name for t in s.types} for s in schemas))
    names = [
        [name if t in shared else f"{name}_{k}" for name, t in s.objects]
        for k, s in enumerate(schemas, start=1)
    ]
    objects = {
        new: t
        for own, s in zip(names, schemas, strict=True)
        for new, (_, t) in zip(own, s.objects, strict=True)
    }
    types = {t.name: t for s in schemas for t in s.types}
    return replace(schemas[0], types=tuple(types.values()), objects=tuple(objects.items())), names


def _ball_block(
    world: _World, options: Mapping[str, Any], seed: int, setting: BallExperiment, modes: AnalyticModes
) -> Block:
    env = world.env
    _, info = env.reset(seed=seed, options=dict(options))
    configuration = info["configuration"]
    rows, log = [env.vector], [info["contacts"]]
    for _ in range(BLOCK_STEPS):
        *_, info = env.step(0)
        rows.append(env.vector)
        log.append(info["contacts"])
    vectors = np.stack(rows)
    vectors.flags.writeable = False
    ball = env.schema.layout().index("ball")
    columns = [env.schema.layout().column(ball, prop) for prop in ("vx", "vy")]
    truth = _ball_truth(log[:-1], vectors[:-1, columns], world.friction, setting, modes)
    return Block(world.schema, world.layout, vectors, truth, configuration)


def _ball_truth(
    log: list[tuple[Contact, ...]],
    velocities: Float2D,
    friction: float,
    setting: BallExperiment,
    modes: AnalyticModes,
) -> Truth:
    acting = [[c for c in contacts if c.active] for contacts in log]
    cases = [
        _case(contacts, v, friction, setting.incline)
        for contacts, v in zip(acting, velocities.tolist(), strict=True)
    ]
    known = {
        case: (modes.index("x", case), modes.index("y", case)) for case in set(cases) if case is not None
    }
    numbers = np.array([(-1, -1) if case is None else known[case] for case in cases])
    return Truth(
        mode={"ball.vx": numbers[:, 0], "ball.vy": numbers[:, 1]},
        mode_names={"ball.vx": tuple(m.name for m in modes.x), "ball.vy": tuple(m.name for m in modes.y)},
        active=np.array([len(contacts) for contacts in acting]),
        corner=np.array([any(c.corner for c in contacts) for contacts in acting]),
    )


def _case(contacts: list[Contact], v: list[float], friction: float, incline: float) -> Case | None:
    """The analytic case of one transition; ``None`` for a corner hit or several active contacts."""
    if not contacts:
        return Case("none")
    contact = contacts[0]
    if len(contacts) > 1 or contact.corner:
        return None
    nx, ny = contact.normal
    surface = min((abs(nx - mx) + abs(ny - my), name) for name, (mx, my) in surface_normals(incline).items())[
        1
    ]
    sliding = surface == "floor" and abs(v[1]) <= REST
    if friction == 0.0:
        return Case(surface, sliding=sliding)
    tangential = -ny * v[0] + nx * (v[1] - GRAVITY_STEP)
    if abs(tangential) <= friction * contact.impulse:
        return Case(surface, "halt", friction, sliding)
    return Case(surface, "forward" if tangential > 0 else "backward", friction, sliding)
