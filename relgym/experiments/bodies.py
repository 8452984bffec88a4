"""Benchmarks of bodies that push, turn and stack: laws read off a stream, on scenes that no learner saw.

``python -m relgym.experiments.bodies pushing transfer --seeds 2 --json bodies.json`` measures two of them with two
training seeds. A *contact step* is one transition of one body that touches something; every one counts.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from time import process_time
from typing import Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from relgym.experiments.body_worlds import Setting, body_rooms
from relgym.experiments.criterion import Measure, measured, one_of, report
from relgym.experiments.law_score import Section
from relgym.experiments.law_score import taught as model_of
from relgym.experiments.plan import Course, Tests
from relgym.experiments.rooms import Room
from relgym.laws.book import LawBook
from relgym.laws.learner import LawLearner
from relgym.laws.text import law_rows
from relgym.laws.touching import Contacts
from relgym.model.fitting import compare_and_learn
from relgym.model.prediction import ScenePrediction
from relgym.model.world_model import WorldModel
from relgym.planning import PlanningAgent, TreeSearch
from relgym.scene.objects import Float2D, SceneLayout, Transition
from relgym.scene.relations import Extractor

__all__ = ["Tally", "asked", "learned", "main", "rolled", "tally", "watched"]

SEEDS: Final = (410, 411, 412, 413, 414)
"""Training seeds; nothing was chosen on them."""

TEST: Final = 510
"""Seed of the scenes to test on; nothing was chosen on it either."""

EXACT, CLOSE = 1e-9, 1e-6


@dataclass(frozen=True, slots=True)
class Tally:
    """Contact steps, those that are claimed and right, claimed and wrong, and claims of free flight that are wrong."""

    contacts: int
    right: int
    wrong: int
    free: int
    free_wrong: int

    @property
    def right_share(self) -> float:
        """Of contact steps, in per cent."""
        return 100.0 * self.right / max(1, self.contacts)

    @property
    def wrong_share(self) -> float:
        """Of all steps, in per cent."""
        return 100.0 * (self.wrong + self.free_wrong) / max(1, self.contacts + self.free)


def learned(rooms: Iterable[Room], *, seed: int = 0, learner: LawLearner | None = None) -> LawLearner:
    """Laws learned from rooms, transition by transition; by a new learner unless one is handed in."""
    for room in rooms:
        learner = learner or LawLearner(room.schema, room.schema.targets or (), seed=seed)
        cast = learner.book.cast(room.layout)
        relations = Extractor(room.schema).extract(room.layout, room.vectors)
        stays = dict.fromkeys(range(len(room.layout.names)), True)
        for k in range(len(room)):
            here = Contacts.of(cast, relations.rows(slice(k, k + 1)), room.vectors[k : k + 1])
            learner.learn_one(here, room.vectors[k], room.vectors[k + 1], stays)
    assert learner is not None, "nothing to learn from"
    return learner


def tally(book: LawBook, rooms: Iterable[Room], tolerance: float = EXACT) -> Tally:
    """How many steps of all moving bodies laws have right, one step ahead; turning rates count as velocities do."""
    counts = np.zeros(5, dtype=int)
    for room in rooms:
        cast = book.cast(room.layout)
        now = room.vectors[:-1]
        contacts = Contacts.of(cast, Extractor(room.schema).extract(room.layout, now), now)
        motion = book.motion(contacts, now)
        after = cast.padded(room.vectors[1:])[cast.velocities].transpose(0, 2, 1)
        movers = list(cast.movers)
        with np.errstate(invalid="ignore"):
            good = (np.abs(motion.velocity - after).max(axis=0) <= tolerance)[:, movers]
        known, touched = motion.known[:, movers], motion.touched[:, movers]
        counts += [
            touched.sum(), (touched & known & good).sum(), (touched & known & ~good).sum(),
            (~touched).sum(), (~touched & known & ~good).sum(),
        ]  # fmt: skip
    return Tally(*counts.tolist())


def rolled(book: LawBook, room: Room, starts: Sequence[int], steps: int) -> NDArray[np.float64]:
    """Largest error of a position or angle in roll-outs from some of a room's scenes; infinite where laws decline.

    Actions are those that were taken.
    """
    cast, layout = book.cast(room.layout), room.layout
    moving = [layout.bodies[body] for body in cast.movers]
    pairs = [
        (layout.column(i, law.property), layout.column(i, law.rate))
        for i in moving
        for law in room.schema.kinematics
        if law.type == layout.types[i].name
    ]
    places, rates = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
    outside = [c for i, t in enumerate(layout.types) if not t.has_body for c in _columns(layout, i)]
    rows = np.array(starts)
    vectors = room.vectors[rows].copy()
    worst = np.zeros(len(rows))
    for step in range(steps):
        vectors[:, outside] = room.vectors[rows + step][:, outside]
        motion = book.motion(
            Contacts.of(cast, Extractor(room.schema).extract(layout, vectors), vectors), vectors
        )
        movers = list(cast.movers)
        worst[~motion.known[:, movers].all(axis=1)] = np.inf
        for body in movers:
            vectors[:, cast.velocities[:, body]] = motion.velocity[:, :, body].T
        vectors[:, places] += vectors[:, rates]
        error = np.abs(vectors[:, places] - room.vectors[rows + step + 1][:, places]).max(axis=1)
        worst = np.maximum(worst, np.where(np.isfinite(error), error, np.inf))
        vectors[~np.isfinite(worst)] = room.vectors[rows + step + 1][~np.isfinite(worst)]
    return worst


def _columns(layout: SceneLayout, index: int) -> range:
    part = layout.slice(index)
    return range(part.start, part.stop)


# ------------------------------------------------------------------ sections
_WORLDS: Final = tuple(product((0.0, 0.5), (0.0, 0.8)))


def _bodies(seed: int) -> tuple[str, ...]:
    """Two to four boxes, by turns."""
    return ("box",) * (2 + seed % 3)


def _shares(name: str, tallies: Sequence[Tally], right: float, wrong: float) -> list[Measure]:
    counted = sum(t.contacts for t in tallies)
    return [
        measured(
            f"{name}: right, % of {counted:,} contact steps", right, [t.right_share for t in tallies], ">="
        ),
        measured(f"{name}: claimed and wrong, %", wrong, [t.wrong_share for t in tallies]),
    ]


def _pushing(seeds: Sequence[int], episodes: int) -> Section:
    measures: list[Measure] = []
    notes: list[str] = []
    for friction, elasticity in _WORLDS:
        tallies = []
        for seed in seeds:
            setting = Setting(_bodies(seed), friction, elasticity)
            book = learned(body_rooms(setting, episodes, seed=seed)).book
            tallies.append(tally(book, body_rooms(setting, 20, seed=TEST)))
            notes += (
                _told(f"friction {friction:g}, elasticity {elasticity:g}", book) if seed == seeds[0] else []
            )
        measures += _shares(f"friction {friction:g}, elasticity {elasticity:g}", tallies, 99.9, 0.05)
    return "pushing", measures, notes


def _told(title: str, book: LawBook) -> list[str]:
    return [f"{title}: {row}" for row in law_rows(book, book.sources)]


def _stacks(seeds: Sequence[int], episodes: int) -> Section:
    measures = []
    for elasticity in (0.0, 0.3):
        setting = Setting(("box",) * 3, 0.5, elasticity, gravity=9.8, driven=False)
        tallies = []
        for seed in seeds:
            book = learned(body_rooms(setting, episodes, seed=seed)).book
            tallies.append(tally(book, body_rooms(setting, 20, seed=TEST), CLOSE))
        measures += _shares(f"gravity, friction 0.5, elasticity {elasticity:g}", tallies, 98.0, 0.2)
    return "boxes that fall, topple and stack", measures, []


def _masses(seeds: Sequence[int], episodes: int) -> Section:
    measures: list[Measure] = []
    notes: list[str] = []
    kinds = (("uniform", ("box", "box", "box")), ("own", ("box", "box")))
    for masses, bodies in kinds:
        setting = Setting(bodies, 0.5, masses=masses)  # type: ignore[arg-type]
        tallies = []
        for seed in seeds:
            book = learned(body_rooms(setting, episodes, seed=seed)).book
            tallies.append(tally(book, body_rooms(setting, 20, seed=TEST)))
            notes += [f"{masses}: {text}" for text in book.inertia.sentences()] if seed == seeds[0] else []
        measures += _shares(f"masses not seen, {masses}", tallies, 99.9, 0.05)
    return "masses not seen", measures, notes


def _transfer(seeds: Sequence[int], episodes: int) -> Section:
    measures = []
    for friction in (0.0, 0.5):
        home = Setting(("box", "box"), friction)
        away = replace(home, bodies=("box",) * 10)
        strange = replace(home, bodies=("box", "hexagon", "triangle", "tee"))
        books = [learned(body_rooms(home, episodes, seed=seed)).book for seed in seeds]
        for name, other in (("10 boxes", away), ("a hexagon, a triangle and a T", strange)):
            rooms = body_rooms(other, 10, seed=TEST)
            schema = rooms[0].schema
            tallies = [tally(book.on(schema, schema.targets or ()), rooms) for book in books]
            measures += _shares(f"friction {friction:g}, {name}", tallies, 99.9, 0.05)
    return "learned with two boxes", measures, []


def _rollouts(seeds: Sequence[int], episodes: int) -> Section:
    measures = []
    for friction, elasticity in _WORLDS:
        shares = []
        for seed in seeds:
            setting = Setting(_bodies(seed), friction, elasticity)
            book = learned(body_rooms(setting, episodes, seed=seed)).book
            errors = [rolled(book, room, (0, 50, 99), 100) for room in body_rooms(setting, 20, seed=TEST)]
            shares.append(100.0 * float((np.concatenate(errors) <= CLOSE).mean()))
        name = f"friction {friction:g}, elasticity {elasticity:g}: within 1e-6, %"
        measures.append(measured(name, 95.0, shares, ">="))
    return "roll-outs of 100 steps", measures, []


FORCES: Final = {
    "linear damping": Setting(damping=0.5),
    "conveyor": Setting(friction=0.5, conveyor=1.0),
    "wind": Setting(wind=3.0),
    "magnet": Setting(magnet=0.3),
    "spring": Setting(spring=5.0),
    "quadratic drag": Setting(drag=0.3),
}
"""Worlds with what moves bodies beside contacts."""


def _forces(seeds: Sequence[int], episodes: int) -> Section:
    measures: list[Measure] = []
    notes: list[str] = []
    for name, setting in FORCES.items():
        tallies = []
        for seed in seeds:
            book = learned(body_rooms(setting, episodes, seed=seed)).book
            tallies.append(tally(book, body_rooms(setting, 20, seed=TEST)))
            notes += _told(name, book) if seed == seeds[0] else []
        measures.append(measured(f"{name}: claimed and wrong, %", 0.1, [t.wrong_share for t in tallies]))
        notes.append(f"{name}: right, % of contact steps: {min(t.right_share for t in tallies):.4g}")
    return "other forces", measures, notes


def watched(rooms: Iterable[Room], *, model: WorldModel | None = None) -> tuple[WorldModel, Tally]:
    """A model that predicts each transition and then learns from it; how its claims came out, by steps of bodies.

    A step of a body is right if everything that is to be predicted of it is claimed and right, and wrong if something
    that is claimed is off.
    """
    counts = np.zeros(5, dtype=int)
    for room in rooms:
        model = model or WorldModel(room.schema)
        for transition in room.transitions():
            said = model.predict_one(transition.before)
            counts += _told_of(room, said, transition)
            compare_and_learn(model, transition, said)
    assert model is not None, "nothing to learn from"
    return model, Tally(*counts.tolist())


def asked(model: WorldModel, rooms: Iterable[Room]) -> Tally:
    """How a model's claims come out where it doesn't go on learning, as `watched` counts."""
    counts = np.zeros(5, dtype=int)
    for room in rooms:
        for transition in room.transitions():
            counts += _told_of(room, model.predict_one(transition.before), transition)
    return Tally(*counts.tolist())


def _told_of(room: Room, said: ScenePrediction, transition: Transition) -> NDArray[np.int64]:
    """What `Tally` holds, of one prediction."""
    relations = Extractor(room.schema).extract(room.layout, transition.before.vector[None])
    touched = relations.relation("intersect")[0].any(axis=1)
    names = [room.layout.names[i] for i in room.layout.bodies]
    found = {part.object: [True, False] for part in said.parts}
    for part in said.parts:
        off = not abs(part.value - transition.after[part.object][part.property]) <= EXACT
        found[part.object][0] &= part.ok and not off
        found[part.object][1] |= part.ok and off
    counts = np.zeros(5, dtype=np.int64)
    for name, (right, wrong) in found.items():
        if touched[names.index(name)]:
            counts += [1, right, wrong, 0, 0]
        else:
            counts += [0, 0, 0, 1, wrong]
    return counts


def _forced(seeds: Sequence[int], episodes: int) -> Section:
    """The whole model in worlds with other forces: what it claims while it learns, and of scenes that it never saw."""
    measures: list[Measure] = []
    notes: list[str] = []
    for name, setting in FORCES.items():
        while_, later = [], []
        for seed in seeds:
            model, told = watched(body_rooms(setting, episodes, seed=seed))
            while_.append(told)
            later.append(asked(model, body_rooms(setting, 5, seed=TEST)))
        measures.append(measured(f"{name}: claimed and wrong, %", 0.1, [t.wrong_share for t in later]))
        notes.append(f"{name}: right, % of contact steps: {min(t.right_share for t in later):.4g}")
        notes.append(f"{name}: claimed and wrong while learning, %: {max(t.wrong_share for t in while_):.4g}")
    return "other forces, the whole model", measures, notes


def _models(seeds: Sequence[int], episodes: int) -> Section:
    """The whole model, modes and all: what it claims, and what a transition costs once it has learned."""
    right, wrong, costs = [], [], []
    for seed in seeds:
        setting = Setting(friction=0.5)
        rooms = body_rooms(setting, episodes, seed=seed)
        model = model_of(rooms)
        started = process_time()
        later = body_rooms(setting, 2, seed=seed + 1_000)
        for room in later:
            for transition in room.transitions():
                model.learn_one(transition)
        costs.append(1e3 * (process_time() - started) / sum(map(len, later)))
        for room in body_rooms(setting, 5, seed=TEST):
            found = model.predict_batch(room.layout, room.vectors[:-1])
            off = _off(room.layout, found.parts, found.vectors, room.vectors[1:])
            right.append(100.0 * float((found.ok & ~off).mean()))
            wrong.append(100.0 * float((found.ok & off).mean()))
    measures = [
        measured("scenes right, %", 99.0, right, ">="),
        measured("scenes claimed and wrong, %", 0.05, wrong),
        measured("learning from a transition, ms", 3.0, costs),
    ]
    return "the whole model", measures, []


REAL: Final = 5_000
"""Real steps from which ``relgym/BoxPush-v0`` is learned, with random actions."""

DELIVERY: Final = Course(
    "push",
    "BoxPush",
    "relgym/BoxPush-v0",
    repeat=10,
    limit=100,
    search=TreeSearch(horizon=30, batch=256, expansions=4_096),
)
"""How parcels are delivered: a decision lasts ten steps. Who pushes gets nothing before he is behind the parcel; a tree
spreads until he is, sequences of actions drawn about a mean often don't."""


def _planned(seeds: Sequence[int], episodes: int) -> Section:
    """Parcels delivered by plans in a model that was learned from random actions."""
    shares = []
    for seed in seeds:
        env = gym.make(DELIVERY.env_id, disable_env_checker=True)
        agent = PlanningAgent(
            env,
            task="given",
            search=DELIVERY.search,
            repeat=DELIVERY.repeat,
            random_steps=REAL,
            restarts=False,
            seed=seed,
        )
        agent.learn(REAL)
        good, played = Tests(DELIVERY, min(100, episodes)).successes(agent)
        shares.append(100.0 * good / played)
    return "planned deliveries", [measured("delivered, % of episodes", 80.0, shares, ">=")], []


def _off(
    layout: SceneLayout, parts: Iterable[tuple[str, str]], found: Float2D, after: Float2D
) -> NDArray[np.bool_]:
    columns = [layout.column(layout.index(name), prop) for name, prop in parts]
    off: NDArray[np.bool_] = np.abs(found - after)[:, columns].max(axis=1) > EXACT
    return off


_SECTIONS: Final[dict[str, Callable[[Sequence[int], int], Section]]] = {
    "pushing": _pushing,
    "stacks": _stacks,
    "masses": _masses,
    "transfer": _transfer,
    "rollouts": _rollouts,
    "forces": _forces,
    "forced": _forced,
    "models": _models,
    "planned": _planned,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure some benchmarks, print them; 1 if a figure misses its limit.

    Parameters
    ----------
    arguments
        Of the command line: names of benchmarks, numbers of training seeds and of episodes of 200 steps.
    """
    parser = argparse.ArgumentParser(prog="python -m relgym.experiments.bodies", description=__doc__)
    parser.add_argument("names", nargs="*", type=one_of(_SECTIONS), help="benchmarks (default: all)")
    parser.add_argument("--seeds", type=int, default=len(SEEDS), help="training seeds (default: %(default)s)")
    parser.add_argument(
        "--episodes", type=int, default=100, help="to learn from, 200 steps each (default: 100)"
    )
    parser.add_argument("--json", type=Path, help="also write the figures there")
    chosen = parser.parse_args(arguments)
    figures = {}
    fine = True
    for name in chosen.names or _SECTIONS:
        title, measures, notes = _SECTIONS[name](SEEDS[: chosen.seeds], chosen.episodes)
        print(report(title, measures, notes), flush=True)
        figures[title] = [m.to_json() for m in measures]
        fine &= all(m.ok for m in measures)
    if chosen.json is not None:
        chosen.json.write_text(json.dumps(figures, indent=2), encoding="utf-8")
    return 0 if fine else 1


if __name__ == "__main__":
    raise SystemExit(main())
