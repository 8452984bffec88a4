"""Worlds other than the thesis' rooms: space, spin, masses, materials, noise, and physics that no law can state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from relgym.experiments.benchmark import Shown
from relgym.experiments.criterion import Measure, measured
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.laws.motion import episode
from relgym.experiments.laws.score import TESTS, laws_of, score, score_laws, taught
from relgym.experiments.laws.worlds import Ball, Material, World
from relgym.experiments.rooms import Room
from relgym.laws.book import LawBook
from relgym.model.reports.report import report as report_of

__all__ = [
    "INEXPRESSIBLE",
    "TRIALS",
    "Trial",
    "constants",
    "inexpressible",
    "noise",
    "noisy",
    "other_worlds",
    "trial_rooms",
]

_ROUGH: Final = Material(0.9, 0.2)
_SLIDES: Final = "max(0, u_t - 0.2 J_n)"
_BOUNCES: Final = "max(u_n, -0.9 v_n)"
_STEPS: Final = 200
_TRAIN, _TEST = 40, 20
"""Rooms that are learned from, and tested on."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A world, and the laws of touching pairs that are true there, along the normal and along the slip direction.

    Attributes
    ----------
    name
        For people.
    world
        The world.
    laws
        The true formulas, such as ``max(u_n, -0.9 v_n)``.
    frame
        The frame in which they hold.
    """

    name: str
    world: World
    laws: frozenset[str]
    frame: str = "contact"


def _balls(*masses: float, types: Sequence[str] = ()) -> tuple[Ball, ...]:
    return tuple(Ball(types[k] if types else "ball", 0.08 + 0.02 * k, mass) for k, mass in enumerate(masses))


_MATERIALS: Final[Mapping[str, Material]] = {
    "stone": Material(0.9, 0.0),
    "wood": Material(0.6, 0.2),
    "rubber": Material(0.3, 0.4),
}

TRIALS: Final = (
    Trial(
        "space", World(3, blocks=("block",) * 12, materials={"block": _ROUGH}), frozenset({_BOUNCES, _SLIDES})
    ),
    Trial(
        "a spinning ball",
        World(2, (Ball(spins=True),), materials={"block": _ROUGH}),
        # Friction 0.2 acts on the surface of a disc, which is three times as easy to move as its centre.
        frozenset({_BOUNCES, "max(0, u_t - 0.6 J_n)"}),
        "point",
    ),
    Trial(
        "two balls of unknown mass",
        World(2, _balls(3.0, 1.0, types=("heavy", "light")), between=Material(0.9)),
        frozenset({_BOUNCES, "u_t"}),
    ),
    Trial(
        "five balls",
        World(2, _balls(1.0, 1.5, 2.0, 2.5, 3.0), between=Material(0.9), weighed=True),
        frozenset({_BOUNCES, "u_t"}),
    ),
    Trial(
        "five rough balls",
        World(2, _balls(1.0, 1.5, 2.0, 2.5, 3.0), materials={"block": _ROUGH}, between=_ROUGH, weighed=True),
        frozenset({_BOUNCES, _SLIDES}),
    ),
    Trial(
        "three materials",
        World(2, blocks=("stone", "wood", "rubber") * 3, materials=_MATERIALS),
        frozenset(
            {_BOUNCES, "max(u_n, -0.6 v_n)", "max(u_n, -0.3 v_n)", "u_t", _SLIDES, "max(0, u_t - 0.4 J_n)"}
        ),
    ),
)
"""Worlds that the benchmark *other-worlds* learns."""


def _weaker(speed: float) -> float:
    return 0.9 - 4.0 * speed


def _brittle(speed: float) -> float:
    return 0.9 if speed < 0.02 else 0.5


INEXPRESSIBLE: Final[Mapping[str, World]] = {
    "restitution falls with speed": World(2, materials={"block": Material(_weaker)}),
    "restitution falls with speed, friction": World(2, materials={"block": Material(_weaker, 0.2)}),
    "restitution drops at a speed": World(2, materials={"block": Material(_brittle)}),
    "soft contact": World(2, materials={"block": Material(spring=1.0)}),
}
"""Worlds of the benchmark *inexpressible*."""


def trial_rooms(world: World, count: int, *, seed: int, steps: int = _STEPS) -> list[Room]:
    """Episodes in so many rooms of a world."""
    schema, rng = world.schema(), np.random.default_rng(seed)
    return [Room(schema, schema.layout(), episode(world, steps=steps, rng=rng)) for _ in range(count)]


def _formulas(book: LawBook) -> tuple[str, frozenset[str]]:
    """The frame of the laws of touching pairs, and their formulas to six digits."""
    if book.pair is None:
        return "", frozenset()
    return book.pair.frame, frozenset(law.formula(6) for axis in book.pair.axes for law in axis)


# ------------------------------------------------------------------ other worlds
def other_worlds(seeds: Sequence[int]) -> Shown:
    """The laws of each trial world, found and right."""
    measures: list[Measure] = []
    notes: list[str] = []
    for trial in TRIALS:
        missed, shares = [], []
        for seed in seeds:
            model = taught(trial_rooms(trial.world, _TRAIN, seed=seed))
            frame, found = _formulas(laws_of(model))
            missed.append(len(found ^ trial.laws) + (frame != trial.frame))
            shares.append(100.0 * score(model, trial_rooms(trial.world, _TEST, seed=TESTS[0])).share)
        measures.append(measured(f"{trial.name}: laws missed or invented", 0, missed))
        measures.append(measured(f"{trial.name}: wrong or abstained, %", 0.1, shares))
        notes += [f"{trial.name}: {row}" for row in report_of(model).laws]
    shares = [100.0 * _transplanted(seed) for seed in seeds]
    measures.append(measured("space by laws of contact from the plane: wrong or abstained, %", 0.1, shares))
    return Shown(measures, notes)


def _transplanted(seed: int) -> float:
    """Share of wrong predictions in space, by free flight in space and contacts in the plane alone."""
    plane = World(2, materials={"block": _ROUGH})
    space = TRIALS[0].world
    below, above = (laws_of(taught(trial_rooms(w, _TRAIN, seed=seed))) for w in (plane, space))
    above.pair = below.pair
    above.forget()
    return score_laws(above, trial_rooms(space, _TEST, seed=TESTS[0])).share


# ------------------------------------------------------------------ noise
def noisy(parts: Sequence[Episode], sd: float, *, rng: np.random.Generator) -> Iterator[Episode]:
    """The same episodes, with independent noise on everything that moves: positions and velocities."""
    for part in parts:
        vectors = part.vectors.copy()
        for i, t in enumerate(part.layout.types):
            if not t.velocity:
                continue
            own = [k for k in (*t.pose_columns()[:2], *t.velocity_columns()) if k >= 0]
            columns = part.layout.offsets[i] + np.array(own)
            vectors[:, columns] += sd * rng.standard_normal((len(vectors), len(columns)))
        yield replace(part, vectors=vectors)


def noise(seeds: Sequence[int], episodes: int = 24) -> Shown:
    """Restitution and friction from noisy states."""
    measures = []
    for experiment in (1, 2):
        setting = BALL_EXPERIMENTS[experiment]
        truth = {"v_n": -setting.elasticity, "J_n": -setting.frictions[0]}
        for sd in (1e-6, 1e-5, 1e-4):
            off: dict[str, list[float]] = {name: [] for name, value in truth.items() if value}
            frames = []
            for seed in seeds:
                parts = list(ball_episodes(experiment, seed=seed, episodes=episodes))
                book = laws_of(taught(noisy(parts, sd, rng=np.random.default_rng([seed, 1]))))
                frames.append(_formulas(book)[0] != "contact")
                for name, values in off.items():
                    values.append(100.0 * abs(constants(book).get(name, 0.0) / truth[name] - 1.0))
            title = f"experiment {experiment}, sd {sd:g}"
            measures.append(measured(f"{title}: other frames", 0, frames))
            measures += [measured(f"{title}: weight of {n} off by, %", 1.0, v) for n, v in off.items()]
    return Shown(measures)


def constants(book: LawBook) -> dict[str, float]:
    """Weights of the laws of touching pairs by feature, those of 1 and the rarer ones of a feature left out."""
    found: dict[str, float] = {}
    for axis in () if book.pair is None else book.pair.axes:
        for law in axis:
            for name, weight in (term for piece in law.pieces for term in piece.terms if term[1] != 1.0):
                found.setdefault(name, weight)
    return found


# ------------------------------------------------------------------ what no law can state
def inexpressible(seeds: Sequence[int]) -> Shown:
    """Laws of contacts that aren't of their form must abstain."""
    measures: list[Measure] = []
    for name, world in INEXPRESSIBLE.items():
        laws, models = [], []
        for seed in seeds:
            model = taught(trial_rooms(world, _TRAIN, seed=seed))
            fresh = trial_rooms(world, _TEST, seed=TESTS[0])
            laws.append(score_laws(laws_of(model), fresh))
            models.append(score(model, fresh))
        total = laws[0].transitions
        measures.append(measured(f"{name}: laws wrong of {total:,}", 0, [s.wrong for s in laws]))
        measures.append(measured(f"{name}: model wrong", 0, [s.wrong for s in models]))
        measures.append(measured(f"{name}: model abstained", total, [s.abstained for s in models]))
    return Shown(measures)
