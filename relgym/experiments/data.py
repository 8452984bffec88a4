"""The thesis' data sets: episodes of consecutive transitions with ground truth from the envs' own contact logs.

Nothing in the truth owes anything to a learner: it comes from what the physics engine touched, or from the
layout that the truck env drew.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import Any

import numpy as np

from relgym.envs.arguments import physical_action
from relgym.envs.ball_box_ramp import BallBoxRampEnv, configurations
from relgym.envs.ball_scenes import ball_places
from relgym.envs.physics import Contact
from relgym.envs.truck_push import TruckPushEnv
from relgym.envs.truck_scenes import layouts
from relgym.errors import ConfigError
from relgym.experiments.analytic import (
    GRAVITY_STEP,
    REST,
    AnalyticModes,
    Case,
    analytic_modes,
    surface_normals,
    truck_modes,
)
from relgym.experiments.episodes import Episode, Truth
from relgym.experiments.scenes import SCENES, ThesisScenes
from relgym.scene.objects import Float1D, Float2D, SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = [
    "BALL_EXPERIMENTS",
    "THESIS_EXPERIMENTS",
    "BallExperiment",
    "Episode",
    "Truth",
    "ball_episodes",
    "truck_episodes",
]


@dataclass(frozen=True, slots=True)
class BallExperiment:
    """Parameters of one of the ball experiments (§4.3–§4.5).

    Attributes
    ----------
    incline, elasticity, frictions
        Of ramps, in degrees, and of contacts.
    episodes
        Of the training.
    type_names
        As of the env.
    objects
        Kinds that stand in the room.
    scenes
        From where sizes, places and speeds are drawn; none: as in the env. Those of `THESIS_EXPERIMENTS` make modes as
        frequent as in the thesis' tables (`relgym.experiments.scenes`).
    """

    incline: float
    elasticity: float
    frictions: tuple[float, ...]
    episodes: int
    type_names: str = "shape"
    objects: tuple[str, ...] = ("box", "ramp")
    scenes: ThesisScenes | None = None

    def modes(self) -> AnalyticModes:
        """The analytic modes of its rooms."""
        return analytic_modes(self.incline, self.elasticity, self.frictions)


BALL_EXPERIMENTS: Mapping[int, BallExperiment] = {
    1: BallExperiment(30.0, 0.9, (0.0,), 80),
    2: BallExperiment(45.0, 0.95, (0.2,), 160),
    3: BallExperiment(45.0, 0.95, (0.1, 0.2), 480, "thesis"),
}
"""The thesis' three experiments, in the env's scenes: 16,000, 32,000 and 96,000 examples."""

THESIS_EXPERIMENTS: Mapping[int, BallExperiment] = {
    number: replace(setting, scenes=SCENES[number]) for number, setting in BALL_EXPERIMENTS.items()
}
"""The same in scenes with the thesis' frequencies."""

TEST_EPISODES = 120
"""Episodes of a test set: 24,000 examples (§4.2)."""

EPISODE_STEPS = 200

_ATTEMPTS = 100
"""How often a scene is drawn anew that doesn't fit its room."""


def ball_episodes(
    experiment: int | BallExperiment,
    *,
    seed: int,
    episodes: int | None = None,
    order: int | None = 0,
    test: bool = False,
) -> Iterator[Episode]:
    """Episodes of a ball experiment, one after the other.

    Episode k shows configuration k mod 40 (of each friction in turn), so 80 episodes show each one twice.

    Parameters
    ----------
    experiment
        1, 2 or 3, or parameters of your own.
    seed
        Determines sizes, positions and speeds of every episode.
    episodes
        How many; default: as many as in the thesis, 120 for a test set.
    order
        Determines in which order the episodes come, without changing them; ``None``: unshuffled.
    test
        Whether to draw a test set, whose scenes differ from those of all training sets.

    Notes
    -----
    Cost: about 25 microseconds a transition.
    """
    setting = _experiment(experiment)
    count = episodes if episodes is not None else (TEST_EPISODES if test else setting.episodes)
    worlds = _worlds(setting)
    modes, cases = setting.modes(), _cases(setting)
    numbers = np.arange(count)
    if order is not None:
        np.random.default_rng([seed, order, int(test)]).shuffle(numbers)
    for k in numbers.tolist():
        world = worlds[k % len(worlds)]
        options = cases[k // len(worlds) % len(cases)]
        episode_seed = int(np.random.SeedSequence([seed, int(test), k]).generate_state(1)[0])
        yield _ball_episode(world, options, episode_seed, setting, modes)


@dataclass(frozen=True)
class _World:
    """A room with one friction, and the schema and layout that its episodes have."""

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


def _cases(setting: BallExperiment) -> Sequence[Mapping[str, Any]]:
    if sorted(setting.objects) == ["box", "ramp"]:
        return configurations()
    places, directions = ball_places(len(setting.objects)), ("left", "right")
    return [{"ball": place, "direction": direction} for place in places for direction in directions]


def _worlds(setting: BallExperiment) -> list[_World]:
    envs = [
        BallBoxRampEnv(
            setting.incline, setting.elasticity, mu, setting.objects, type_names=setting.type_names
        )
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


def _ball_episode(
    world: _World, options: Mapping[str, Any], seed: int, setting: BallExperiment, modes: AnalyticModes
) -> Episode:
    env = world.env
    info = _begun(env, options, seed, setting)
    configuration = info["configuration"]
    rows, log = [env.vector], [info["contacts"]]
    for _ in range(EPISODE_STEPS):
        *_, info = env.step(0)
        rows.append(env.vector)
        log.append(info["contacts"])
    vectors = np.stack(rows)
    vectors.flags.writeable = False
    ball = env.schema.layout().index("ball")
    columns = [env.schema.layout().column(ball, prop) for prop in ("vx", "vy")]
    truth = _ball_truth(log[:-1], vectors[:-1, columns], world.friction, setting, modes)
    return Episode(world.schema, world.layout, vectors, truth, configuration)


def _begun(
    env: BallBoxRampEnv, case: Mapping[str, Any], seed: int, setting: BallExperiment
) -> dict[str, Any]:
    """Reset the env to a scene of a case; what it says of it."""
    if setting.scenes is None:
        _, info = env.reset(seed=seed, options=dict(case))
        return info
    rng = np.random.default_rng(seed)
    names = set(env.reset_options)
    alone = {"only": setting.objects[0]} if len(setting.objects) == 1 else {}
    for _ in range(_ATTEMPTS):
        options = setting.scenes.options({**case, **alone}, setting.incline, rng)
        try:
            _, info = env.reset(seed=seed, options={k: v for k, v in options.items() if k in names})
        except ConfigError:
            continue  # too wide, or too low for the ball
        return info
    raise ConfigError(f"{dict(case)}: none of {_ATTEMPTS} draws of a scene fits its room")


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
        touched=tuple(frozenset(c.other for c in contacts) for contacts in log),
        pushing=tuple(frozenset(c.other for c in contacts) for contacts in acting),
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


TRUCK_EPISODE_STEPS = 40


def truck_episodes(
    resample: str = "step",
    *,
    seed: int,
    n_boxes: int = 3,
    repeats: int = 2,
    force_range: tuple[float, float] = (300.0, 500.0),
    friction_range: tuple[float, float] = (0.05, 0.5),
    order: int | None = 0,
    bystanders: int = 0,
    test: bool = False,
) -> Iterator[Episode]:
    """Episodes of the box pushing domain (§3.1): layouts x permutations of the boxes x repeats, 48 of 40 steps.

    With the default ranges the truck never stops.

    Parameters
    ----------
    resample
        ``"step"``: force and frictions are drawn at every step; ``"episode"``: once an episode.
    seed
        Determines sizes, positions, frictions and forces of every episode.
    n_boxes
        Number of boxes.
    repeats
        How often each permutation of each layout is shown, with other sizes (thesis: 2).
    force_range, friction_range
        From where pushing force and frictions are drawn.
    order
        Determines in which order the episodes come, without changing them; ``None``: unshuffled.
    bystanders
        How many boxes stand beside the track.
    test
        Whether to draw a test set, whose scenes differ from those of all training sets.

    Notes
    -----
    Cost: about 30 microseconds a transition.
    """
    env = TruckPushEnv(n_boxes, resample, friction_range, (0.0, 500.0), bystanders, task=None)
    boxes = tuple(f"box{k + 1}" for k in range(n_boxes))
    cases = list(product(range(repeats), range(1, len(layouts(n_boxes)) + 1), permutations(boxes)))
    numbers = np.arange(len(cases))
    if order is not None:
        np.random.default_rng([seed, order, int(test)]).shuffle(numbers)
    for k in numbers.tolist():
        _, layout, names = cases[k]
        rng = np.random.default_rng([seed, int(test), k])
        forces = rng.uniform(*force_range, TRUCK_EPISODE_STEPS if resample == "step" else 1)
        forces = np.broadcast_to(forces, TRUCK_EPISODE_STEPS)
        yield _truck_episode(env, {"layout": layout, "order": names}, int(rng.integers(2**31)), forces)


def _truck_episode(env: TruckPushEnv, options: Mapping[str, Any], seed: int, forces: Float1D) -> Episode:
    _, info = env.reset(seed=seed, options=dict(options))
    ((_, low, high),) = env.schema.action_scale
    rows, actions = [env.vector], []
    for force in forces.tolist():
        action = np.array([2.0 * (force - low) / (high - low) - 1.0])
        actions.append(physical_action(env.schema, action))
        env.step(action)
        rows.append(env.vector)
    vectors = np.hstack([np.stack(rows), np.stack([*actions, np.zeros(1)])])
    vectors.flags.writeable = False
    modes = truck_modes(sum(len(stack) for stack in env.stacks))
    heights = tuple(sorted((len(stack) for stack in env.stacks), reverse=True))
    number = next(k for k, mode in enumerate(modes) if mode.heights == heights)
    truth = Truth(
        mode={"truck.vx": np.full(len(forces), number)},
        mode_names={"truck.vx": tuple(mode.name for mode in modes)},
        active=np.zeros(len(forces), dtype=np.int64),
        corner=np.zeros(len(forces), dtype=np.bool_),
    )
    return Episode(env.schema, env.schema.layout(), vectors, truth, info["configuration"])
