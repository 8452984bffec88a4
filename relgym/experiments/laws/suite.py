"""Benchmarks of laws of motion: accuracy, transfer, scaling, noise (`relgym benchmark laws`)."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from time import perf_counter, process_time
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.experiments.benchmark import Shown, Suite, whole
from relgym.experiments.criterion import Measure, measured
from relgym.experiments.data import BALL_EXPERIMENTS, BallExperiment, ball_episodes, truck_episodes
from relgym.experiments.laws.classic import CLASSICS, Classic, classic_transitions
from relgym.experiments.laws.scaling import scaling
from relgym.experiments.laws.score import SEEDS, TESTS, Part, Score, score, taught
from relgym.experiments.laws.trials import inexpressible, noise, other_worlds
from relgym.experiments.rollouts import largest_errors
from relgym.experiments.rooms import rooms
from relgym.model.reports.report import report as report_of
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition
from relgym.scene.relations import Extractor
from relgym.scene.schema import SceneSchema

__all__ = ["SUITE", "part"]


def _both(name: str, scores: Sequence[Score], total: str, abstained: float = 0) -> list[Measure]:
    """Wrong predictions, and those that were not made; of the latter so many are allowed."""
    return [
        measured(f"{name} wrong of {total}", 0, [s.wrong for s in scores]),
        measured(f"{name} abstained of {total}", abstained, [s.abstained for s in scores]),
    ]


def _one_step(seeds: Sequence[int]) -> Shown:
    measures, notes = [], []
    for experiment in (1, 2):
        scores = []
        sentences: set[int] = set()
        for seed in seeds:
            model = taught(ball_episodes(experiment, seed=seed))
            scores += [score(model, ball_episodes(experiment, seed=test, test=True)) for test in TESTS]
            sentences.add(len(report_of(model).laws))
        measures += _both(f"experiment {experiment}:", scores, "24,000")
        measures.append(measured(f"experiment {experiment}: sentences", 3, sorted(sentences)))
        notes.append(
            model.describe(details=True, frame="world", incline=BALL_EXPERIMENTS[experiment].incline)
        )
    return Shown(measures, notes)


def _rollouts(seeds: Sequence[int]) -> Shown:
    measures = []
    for experiment in (1, 2):
        values = []
        for seed in seeds:
            model = taught(ball_episodes(experiment, seed=seed))
            for test in TESTS:
                episodes = list(ball_episodes(experiment, seed=test, episodes=80, test=True))
                values.append(int((largest_errors(model, episodes) > 1e-6).sum()))
        measures.append(measured(f"experiment {experiment}: of 80 off by more than 1e-6", 0, values))
    return Shown(measures)


def _transfer(seeds: Sequence[int]) -> Shown:
    measures = []
    for incline, elasticity, friction in ((30.0, 0.9, 0.0), (30.0, 0.9, 0.2), (45.0, 0.95, 0.2)):
        home = BallExperiment(incline, elasticity, (friction,), 80)
        models = [taught(ball_episodes(home, seed=seed)) for seed in seeds]
        for other in (15.0, 30.0, 45.0, 60.0, 75.0):
            away = BallExperiment(other, elasticity, (friction,), 120)
            values = [score(m, ball_episodes(away, seed=TESTS[0], test=True)).bad for m in models]
            name = f"learned at {incline:g}, used at {other:g} degrees, mu {friction:g}: of 24,000"
            measures.append(measured(name, 0, values))
    return Shown(measures)


def _rooms(seeds: Sequence[int]) -> Shown:
    measures = []
    for experiment in (1, 2):
        setting = BALL_EXPERIMENTS[experiment]
        for objects, count in ((12, 40), (60, 8)):
            values = []
            for seed in seeds:
                model = taught(ball_episodes(experiment, seed=seed))
                found = rooms(
                    count,
                    objects=objects,
                    elasticity=setting.elasticity,
                    friction=setting.frictions[0],
                    rng=np.random.default_rng([TESTS[0], seed]),
                    steps=400,
                )
                values.append(score(model, found))
            measures += _both(f"laws of {experiment}, {objects} objects:", values, f"{400 * count}")
    return Shown([*measures, *scaling()])


def _parts_of_the_world(seeds: Sequence[int]) -> Shown:
    measures = []
    for experiment in (1, 2):
        for kind in ("floor", "wall"):
            found = [
                score(
                    taught(ball_episodes(experiment, seed=seed), partial(_touching, kind)),
                    ball_episodes(experiment, seed=TESTS[0], test=True),
                )
                for seed in seeds
            ]
            name, most = (
                f"experiment {experiment}, contacts with {kind}s only:",
                0 if kind == "floor" else 24_000,
            )
            measures += _both(name, found, "24,000", most)
    return Shown(measures)


def _touching(kind: str, episode: Part) -> NDArray[np.bool_]:
    """Transitions in which the ball touches nothing but objects of one type."""
    found = Extractor(episode.schema).extract(episode.layout, episode.vectors[:-1])
    ball = episode.layout.bodies.index(episode.layout.index("ball"))
    others = [k for k, i in enumerate(episode.layout.bodies) if episode.layout.types[i].name != kind]
    return np.logical_not(found.relation("intersect")[:, ball][:, others].any(axis=1))


def _online(seeds: Sequence[int]) -> Shown:
    measures = []
    for experiment, episodes, at in ((1, 8, (1, 2, 4, 8)), (2, 40, (2, 4, 8, 16, 40))):
        exact, costs, found = [], [], {n: list[int]() for n in at}
        test = list(ball_episodes(experiment, seed=TESTS[0], test=True))
        for seed in seeds:
            model: WorldModel | None = None
            spent: list[float] = []
            for k, episode in enumerate(ball_episodes(experiment, seed=seed, episodes=episodes), start=1):
                model = model or WorldModel(episode.schema)
                spent += [_timed(model, transition) for transition in episode.transitions()]
                if k in at:
                    found[k].append(score(model, test).bad)
            exact.append(found[episodes][-1] == 0)
            costs.append(1e3 * sum(spent) / len(spent))
        for n in at:
            limit = 0 if n == episodes else 24_000
            measures.append(
                measured(f"experiment {experiment}: wrong or abstained after {n}", limit, found[n])
            )
        share = sum(exact) / len(exact)
        measures.append(
            measured(f"experiment {experiment}: exact after {episodes}, share", 0.9, [share], ">=")
        )
        measures.append(measured(f"experiment {experiment}: predict and learn, ms", 1.0, costs))
    return Shown(measures)


def _timed(model: WorldModel, transition: Transition) -> float:
    start = perf_counter()
    model.predict_one(transition.before)
    model.learn_one(transition)
    return perf_counter() - start


_FRAMES: Final[tuple[Literal["auto", "world"], ...]] = ("auto", "world")


def _no_contact(seeds: Sequence[int]) -> Shown:
    streams: dict[str, Callable[[int], tuple[SceneSchema, list[Transition]]]] = {"truck-push": _truck}
    for classic in CLASSICS:
        for body in (False, True):
            name = f"{classic.env}{' as a body' if body else ''}"
            streams[name] = partial(_classic, classic, body)
    measures = []
    for name, stream in streams.items():
        pairs = [[_learned(*stream(seed), frames) for frames in _FRAMES] for seed in seeds]
        measures.append(measured(f"{name}: other modes", 0, [one[0] != two[0] for one, two in pairs]))
        measures.append(measured(f"{name}: time, ratio", 1.2, [one[1] / two[1] for one, two in pairs]))
    return Shown(measures)


def _truck(seed: int) -> tuple[SceneSchema, list[Transition]]:
    episodes = list(truck_episodes("step", seed=seed, repeats=1))
    return episodes[0].schema, [each for episode in episodes for each in episode.transitions()]


def _classic(classic: Classic, body: bool, seed: int) -> tuple[SceneSchema, list[Transition]]:
    return classic_transitions(classic, 400, seed=seed, body=body)


def _learned(
    schema: SceneSchema, transitions: Sequence[Transition], frames: Literal["auto", "world"]
) -> tuple[str, float]:
    """The modes after some transitions, and the seconds of processor time that learning them took."""
    model, start = WorldModel(schema, ModelConfig(frames=frames)), process_time()
    for transition in transitions:
        model.learn_one(transition)
    return json.dumps(model.to_json()["targets"]), process_time() - start


_PARTS: Final[Mapping[str, tuple[str, Callable[[Sequence[int]], Shown]]]] = {
    "one-step": ("One step", _one_step),
    "roll-outs": ("Roll-outs of 200 steps", _rollouts),
    "inclines": ("Other inclines", _transfer),
    "rooms": ("Rooms never seen", _rooms),
    "contacts-of-one-kind": ("Contacts of one kind", _parts_of_the_world),
    "online": ("Online", _online),
    "other-worlds": ("Other worlds", other_worlds),
    "noise": ("Noisy states", noise),
    "no-contact": ("Nothing for laws to say", _no_contact),
    "inexpressible": ("Physics that laws can't state", inexpressible),
}


def part(*, name: str, seeds: Sequence[int]) -> dict[str, Any]:
    """Measure one benchmark, as a task for the store of results."""
    return _PARTS[name][1](seeds).to_json()


SUITE: Final = Suite(
    "laws",
    "Laws of motion: accuracy, transfer, scaling, noise",
    {
        name: whole(title, "relgym.experiments.laws.suite:part", {"name": name}, SEEDS)
        for name, (title, _) in _PARTS.items()
    },
    seeds=len(SEEDS),
    head="Every transition counts, corners and double contacts included.",
)
