"""What is measured of bodies that push, turn and stack: laws read off a stream, on scenes that no learner saw.

A *contact step* is one transition of one body that touches something; every one counts. What the engine itself leaves
unsettled is counted apart, by its own residual (`relgym.experiments.bodies.worlds.checked_rooms`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass
from time import process_time
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.bodies.worlds import Setting, body_masses, body_rooms, checked_rooms
from relgym.experiments.rooms import Room
from relgym.laws.book import LawBook
from relgym.laws.inertia import AREA, SQUARE
from relgym.laws.learner import LawLearner
from relgym.laws.text import law_rows
from relgym.laws.touching import Contacts
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.world_model import WorldModel
from relgym.scene.geometry.areas import mean_squares
from relgym.scene.objects import Float2D, SceneLayout
from relgym.scene.relations import Extractor

__all__ = [
    "Tally",
    "asked",
    "law_trial",
    "learned",
    "model_trial",
    "rolled",
    "setting_of",
    "tally",
    "watched",
]

TEST: Final = 510
"""Seed of the scenes to test on; nothing was chosen on it but for the conveyor (`relgym.experiments.bodies.suite`)."""

EXACT, CLOSE = 1e-9, 1e-6

TOGETHER: Final = 50
"""Scenes that are predicted at once while laws are learned."""

NUDGE: Final = 1e-12
"""By so much the first velocities of a roll-out are changed to see how it grows."""


@dataclass(frozen=True, slots=True)
class Tally:
    """Steps of bodies, counted.

    Attributes
    ----------
    contacts, right, wrong
        Contact steps, those that are claimed and right, and those that are claimed and wrong.
    free, free_wrong
        Steps of bodies that touch nothing, and wrong claims among them.
    unsettled
        Contact steps that the engine left unsettled; they aren't among the others.
    """

    contacts: int
    right: int
    wrong: int
    free: int
    free_wrong: int
    unsettled: int = 0

    @property
    def right_share(self) -> float:
        """Of contact steps, in per cent."""
        return 100.0 * self.right / max(1, self.contacts)

    @property
    def wrong_share(self) -> float:
        """Of all steps, in per cent."""
        return 100.0 * (self.wrong + self.free_wrong) / max(1, self.contacts + self.free)


def learned(rooms: Iterable[Room], *, seed: int = 0, learner: LawLearner | None = None) -> LawLearner:
    """Laws learned from rooms, transition by transition; by a new learner unless one is handed in.

    Every transition is predicted by the laws that were learned before it. As long as these stay the same, scenes are
    predicted together.
    """
    for room in rooms:
        learner = learner or LawLearner(room.schema, room.schema.targets or (), seed=seed)
        book, now = learner.book, room.vectors[:-1]
        relations = Extractor(room.schema).extract(room.layout, now)
        contacts = Contacts.of(book.cast(room.layout), relations, now)
        stays = dict.fromkeys(range(len(room.layout.names)), True)
        laws: tuple[object, ...] = ()
        for k in range(len(room)):
            first = k - k % TOGETHER
            if k == first or laws != _laws(book):
                part = slice(k, first + TOGETHER)
                some = Contacts.of(contacts.cast, relations.rows(part), now[part])
                laws, told, begun = _laws(book), book.motion(some, now[part]), k
            motion = told.scene(k - begun)
            learner.learn_one(contacts.scene(k), now[k], room.vectors[k + 1], stays, motion)
    assert learner is not None, "nothing to learn from"
    return learner


def _laws(book: LawBook) -> tuple[object, ...]:
    """What predictions follow from."""
    return (*book.free.values(), book.pair, book.inertia, book.tolerance)


def tally(
    book: LawBook,
    rooms: Iterable[Room],
    tolerance: float = EXACT,
    residuals: Sequence[NDArray[np.float64]] | None = None,
) -> Tally:
    """How many steps of all moving bodies laws have right, one step ahead; turning rates count as velocities do.

    Parameters
    ----------
    book
        The laws.
    rooms
        What is to be predicted.
    tolerance
        Largest error of what is right.
    residuals
        The engine's own for each room, shape ``(steps, bodies that move)``: steps with a larger one than `tolerance`
        are counted apart.
    """
    counts = np.zeros(6, dtype=int)
    for number, room in enumerate(rooms):
        cast = book.cast(room.layout)
        now = room.vectors[:-1]
        contacts = Contacts.of(cast, Extractor(room.schema).extract(room.layout, now), now)
        motion = book.motion(contacts, now)
        after = cast.padded(room.vectors[1:])[cast.velocities].transpose(0, 2, 1)
        movers = list(cast.movers)
        with np.errstate(invalid="ignore"):
            good = (np.abs(motion.velocity - after).max(axis=0) <= tolerance)[:, movers]
        known, touched = motion.known[:, movers], motion.touched[:, movers]
        open_ = np.zeros_like(touched) if residuals is None else touched & (residuals[number] > tolerance)
        touched, flying = touched & ~open_, ~touched
        counts += [
            touched.sum(), (touched & known & good).sum(), (touched & known & ~good).sum(),
            flying.sum(), (flying & known & ~good).sum(), open_.sum(),
        ]  # fmt: skip
    return Tally(*counts.tolist())


def rolled(
    book: LawBook, room: Room, starts: Sequence[int], steps: int, *, nudge: float = 0.0
) -> NDArray[np.float64]:
    """Largest error of a position or angle in roll-outs from some of a room's scenes; infinite where laws decline.

    Actions are those that were taken. With `nudge` all velocities begin by so much too large.
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
    vectors[:, rates] += nudge
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
            off = [abs(p.value - transition.after[p.object][p.property]) for p in said.parts]
            names, claimed = [p.object for p in said.parts], [p.ok for p in said.parts]
            before = transition.before.vector[None]
            counts += _counted(room, before, names, np.array([claimed]), np.array([off]))
            compare_and_learn(model, transition, said)
    assert model is not None, "nothing to learn from"
    return model, Tally(*counts.tolist())


def asked(model: WorldModel, rooms: Iterable[Room]) -> Tally:
    """How a model's claims come out where it doesn't go on learning, as `watched` counts."""
    counts = np.zeros(5, dtype=int)
    for room in rooms:
        found = model.predict_batch(room.layout, room.vectors[:-1])
        columns = [room.layout.column(room.layout.index(name), prop) for name, prop in found.parts]
        off = np.abs(found.vectors - room.vectors[1:])[:, columns]
        claimed = found.outcomes == OUTCOMES.index(Outcome.PREDICTED)
        counts += _counted(room, room.vectors[:-1], [name for name, _ in found.parts], claimed, off)
    return Tally(*counts.tolist())


def _counted(
    room: Room, before: Float2D, names: Sequence[str], claimed: NDArray[np.bool_], off: NDArray[np.float64]
) -> NDArray[np.int64]:
    """What `Tally` holds, of predictions of some steps: whose they are, which are claimed, by how much they are off.

    `before` has shape ``(n, width)``, `claimed` and `off` ``(n, predictions)``.
    """
    relations = Extractor(room.schema).extract(room.layout, before)
    touched = np.asarray(relations.relation("intersect").any(axis=2))
    counts, bad = np.zeros(5, dtype=np.int64), ~(off <= EXACT)
    for name in dict.fromkeys(names):
        own = [k for k, other in enumerate(names) if other == name]
        right, wrong = (claimed & ~bad)[:, own].all(axis=1), (claimed & bad)[:, own].any(axis=1)
        here = touched[:, room.layout.bodies.index(room.layout.index(name))]
        counts += [
            here.sum(), (here & right).sum(), (here & wrong).sum(), (~here).sum(), (~here & wrong).sum(),
        ]  # fmt: skip
    return counts


# ------------------------------------------------------------------ trials
def setting_of(data: Mapping[str, Any]) -> Setting:
    """The setting that plain data stand for."""
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in data.items()}
    return Setting(**values)


def law_trial(
    *,
    setting: Mapping[str, Any],
    seed: int,
    episodes: int,
    tests: Sequence[Mapping[str, Any]],
    test_episodes: int,
    tolerance: float = EXACT,
    checked: bool = False,
    rolls: int = 0,
) -> dict[str, Any]:
    """Learn laws in one world, and test them in others.

    Parameters
    ----------
    setting, seed, episodes
        Where laws are learned: so many episodes of 200 steps.
    tests, test_episodes
        Where they are tested, each with so many episodes of `TEST`.
    tolerance
        Largest error of a velocity that is right.
    checked
        Whether to count apart what the engine left unsettled.
    rolls
        Of how many test episodes three roll-outs of 100 steps are made.

    Returns
    -------
    ``tallies`` of the tests, as lists; ``laws``, what was learned; ``inertia``, the largest relative error of masses
    and of moments over masses; ``rolled``, errors of roll-outs, and ``grown``, the same for first velocities off by
    `NUDGE`; ``seconds``, processor time of learning.
    """
    home = setting_of(setting)
    rooms = body_rooms(home, episodes, seed=seed)
    started = process_time()
    learner = learned(rooms, seed=seed)
    seconds = process_time() - started
    tallies, errors, grown = [], [], []
    for data in tests:
        there = setting_of(data)
        found = checked_rooms(there, test_episodes, seed=TEST) if checked else []
        fresh = [room for room, _ in found] or body_rooms(there, test_episodes, seed=TEST)
        schema = fresh[0].schema
        book = learner.book.on(schema, schema.targets or ())
        told = tally(book, fresh, tolerance, [residual for _, residual in found] or None)
        tallies.append(list(astuple(told)))
        for room in fresh[:rolls]:
            errors += rolled(book, room, (0, 50, 99), 100).tolist()
            grown += rolled(book, room, (0, 50, 99), 100, nudge=NUDGE).tolist()
    return {
        "tallies": tallies,
        "laws": [str(row) for row in law_rows(learner.book, learner.book.sources)],
        "inertia": list(_inertia_errors(learner.book, home)),
        "rolled": [_plain(value) for value in errors],
        "grown": [_plain(value) for value in grown],
        "seconds": seconds,
    }


def _plain(value: float) -> float | None:
    """JSON knows no infinity."""
    return value if np.isfinite(value) else None


def _inertia_errors(book: LawBook, setting: Setting) -> tuple[float | None, float | None]:
    """Largest relative error of masses, up to their common factor, and of moments over masses; None if not known."""
    bodies = body_masses(setting, seed=TEST)
    types = ["disc", *setting.bodies]
    squares = mean_squares([body.shape for body in bodies], (0, 1))
    extents = np.array([body.extents for body in bodies]).T
    features = {
        AREA: squares[0] * extents[0] * extents[1],
        SQUARE: (squares[1:] * extents**2).sum(axis=0),
        "sx": extents[0],
        "sy": extents[1],
        "mass": np.array([body.mass for body in bodies]),
        "moment": np.array([body.moment for body in bodies]),
    }
    mass, inertia = None, book.inertia
    if inertia.mass is not None:
        names = ["disc", *(f"body{k + 1}" for k in range(len(setting.bodies)))]
        told = inertia.mass.values(features, names if inertia.mass.by == "object" else types)
        ratio = told / features["mass"]
        mass = float(np.abs(ratio / ratio[0] - 1.0).max())
    gyration = None
    pieces = [inertia.gyration(name) for name in types]
    if all(each is not None and each.piece is not None for each in pieces):
        every = features | {"1": np.ones(len(types)), "moment/mass": features["moment"] / features["mass"]}
        said = [
            each.piece.values(every, every["1"])[k]
            for k, each in enumerate(pieces)
            if each is not None and each.piece is not None
        ]
        gyration = float(np.abs(np.array(said) / every["moment/mass"] - 1.0).max())
    return mass, gyration


def model_trial(
    *, setting: Mapping[str, Any], seed: int, episodes: int, test_episodes: int, timed: int = 0
) -> dict[str, Any]:
    """The whole model, modes and all: what it claims while it learns and of fresh scenes, and what learning costs.

    Parameters
    ----------
    setting, seed, episodes
        Where it learns: so many episodes of 200 steps.
    test_episodes
        Fresh ones, of `TEST`.
    timed
        Further episodes that are learned from for the time that takes.

    Returns
    -------
    ``learning`` and ``fresh``, tallies as lists; ``scenes``, per cent of fresh scenes of which all is claimed and
    right, and of those of which some claim is wrong; ``cost``, processor time of a transition in the timed episodes, in
    ms, or None; ``forces``, what is said of those that act from afar.
    """
    there = setting_of(setting)
    model, told = watched(body_rooms(there, episodes, seed=seed))
    later = body_rooms(there, timed, seed=seed + 1_000)
    started = process_time()
    for room in later:
        for transition in room.transitions():
            model.learn_one(transition)
    cost = 1e3 * (process_time() - started) / sum(map(len, later)) if later else None
    right = wrong = count = 0
    rooms = body_rooms(there, test_episodes, seed=TEST)
    for room in rooms:
        found = model.predict_batch(room.layout, room.vectors[:-1])
        columns = [room.layout.column(room.layout.index(name), prop) for name, prop in found.parts]
        off = np.abs(found.vectors - room.vectors[1:])[:, columns].max(axis=1) > EXACT
        right += int((found.ok & ~off).sum())
        wrong += int((found.ok & off).sum())
        count += len(off)
    return {
        "learning": list(astuple(told)),
        "fresh": list(astuple(asked(model, rooms))),
        "scenes": [100.0 * right / count, 100.0 * wrong / count],
        "cost": cost,
        "forces": sorted({str(force) for advice in model.advice() for force in advice.forces}),
    }
