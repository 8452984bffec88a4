"""A program that stays while its model learns says what arrays say, at every step."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from dreams import line_model, room_model

from relgym.laws.inertia import Inertia
from relgym.laws.records import Share
from relgym.logic.clause import Definition
from relgym.model import running
from relgym.model.grounds import Grounds
from relgym.model.parts import Parts
from relgym.model.prediction import ScenePrediction
from relgym.model.querying import predict
from relgym.model.target.limits import Limits
from relgym.model.target.property_model import PropertyModel
from relgym.model.target.spread import Spreads
from relgym.model.target.stops import Stops
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene
from relgym.wrappers import ModelLearner


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel is there, and programs are lowered for the first scene that is asked."""
    monkeypatch.setattr(running, "PATIENCE", 0)
    running.KERNEL.load()


def told(prediction: ScenePrediction) -> list[object]:
    """All that a prediction says, NaN being itself."""
    parts = [
        repr([getattr(p, name) for name in p.__slots__]) for p in prediction.parts
    ]  # what takes no part in comparisons among them
    return [*parts, prediction.scene.vector.tobytes()]


def by_arrays(model: WorldModel, scene: Scene) -> ScenePrediction:
    parts = model._parts
    return predict(parts, parts.perception.percept(scene.layout, scene.vector[None]), scene)


@pytest.mark.parametrize(
    ("name", "steps", "least", "options"),
    [
        ("relgym/BallBoxRamp-v0", 500, 0.5, {}),
        ("relgym/BallBoxRamp-v0", 350, 0.5, {"config": {"frames": "world"}}),
        ("relgym/TruckPush-v0", 120, 0.3, {"learn_reward": True, "learn_termination": True}),
        ("CartPole-v1", 200, 0.3, {}),
        ("MountainCar-v0", 300, 0.3, {}),
    ],
)
def test_a_program_that_stays_says_what_arrays_say(
    monkeypatch: pytest.MonkeyPatch, name: str, steps: int, least: float, options: dict[str, object]
) -> None:
    env = ModelLearner(gym.make(name), **options)  # type: ignore[arg-type]
    env.action_space.seed(3)
    env.reset(seed=3)
    answered, lowerings = 0, 0
    run, lowered = WorldModel._run_one, running.lowered

    def compared(self: WorldModel, scene: Scene) -> ScenePrediction | None:
        nonlocal answered
        found = run(self, scene)
        if found is not None:
            answered += 1
            assert told(found) == told(by_arrays(self, scene))
        return found

    def counted(*args: object) -> object:
        nonlocal lowerings
        lowerings += 1
        return lowered(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(WorldModel, "_run_one", compared)
    monkeypatch.setattr(running, "lowered", counted)
    for _ in range(steps):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    assert answered > least * steps
    assert lowerings < 0.6 * steps


def test_grounds_are_the_same_until_something_is_said_otherwise() -> None:
    env = ModelLearner(gym.make("relgym/BallBoxRamp-v0"))
    env.reset(seed=0)
    for _ in range(30):
        env.step(env.action_space.sample())
    model = env.model
    known = Grounds.of(model._parts)
    assert known.same(Grounds.of(model._parts))
    target = model.targets[0]
    fallback = model._parts.models[target].fallback
    fallback.scope = type(fallback.scope)()
    assert not known.same(Grounds.of(model._parts))
    assert np.isfinite(env.scene.vector).all()


# ---------------------------------------------------------------------- what is read, thing by thing
def role_model() -> Parts:
    """Modes with roles; a copy."""
    return copy.deepcopy(line_model()._parts)


def lawful_model() -> Parts:
    """Laws that govern; a copy."""
    return copy.deepcopy(room_model("auto")._parts)


def part_of(parts: Parts) -> PropertyModel:
    """A target of several modes, some of which have roles."""
    return next(m for m in parts.models.values() if m.casting.classifiers and len(m.classifier.modes) > 1)


def another_mode(part: PropertyModel) -> None:
    """The same function, refitted: another record."""
    cluster = next(iter(part.clusterer.clusters.values()))
    cluster.mode = replace(cluster.mode, sigma=0.5)


def renumbered(part: PropertyModel) -> None:
    clusters = part.clusterer.clusters
    number = max(clusters)
    clusters[number + 1] = clusters.pop(number)


def relearned(part: PropertyModel) -> None:
    pair = next(iter(part.classifier._pairs.values()))
    pair.classifier = copy.copy(pair.classifier)


def seen_more(part: PropertyModel) -> None:
    part.classifier._familiarity().seen.add(-12345)


def cast_anew(part: PropertyModel) -> None:
    cast = next(iter(part.casting.classifiers.values()))
    cast.descriptions[0].definition = Definition(())


def less_in_common(part: PropertyModel) -> None:
    cast = next(iter(part.casting.classifiers.values()))
    described = cast.descriptions[0]
    assert described.common is not None
    described.common = np.zeros_like(described.common) if described.common.any() else ~described.common


def cast_wrongly(part: PropertyModel) -> None:
    cast = next(iter(part.casting.classifiers.values()))
    cast.errors = 0.0 if cast.errors else 1.0


def set_(name: str, value: Callable[[], object]) -> Callable[[PropertyModel], None]:
    return lambda part: setattr(part, name, value())


CHANGES: dict[str, Callable[[PropertyModel], None]] = {
    "a mode": another_mode,
    "an id": renumbered,
    "limits": set_("limits", Limits),
    "stops": set_("stops", Stops),
    "spreads": set_("spreads", Spreads),
    "surmise": lambda part: setattr(part, "surmise", not part.surmise),
    "approximate": lambda part: setattr(part.clusterer.population, "approximate", True),
    "scope": lambda part: setattr(part.fallback, "scope", copy.copy(part.fallback.scope)),
    "a pair": relearned,
    "a situation": seen_more,
    "a role": cast_anew,
    "what players share": less_in_common,
    "how roles are bound": cast_wrongly,
}


@pytest.mark.parametrize("name", sorted(CHANGES))
def test_whatever_is_said_otherwise_is_noticed(name: str) -> None:
    parts = role_model()
    known = Grounds.of(parts)
    assert known.same(Grounds.of(parts))
    CHANGES[name](part_of(parts))
    assert not known.same(Grounds.of(parts))


def test_votes_are_followed_without_lowering_anew() -> None:
    parts = role_model()
    known = Grounds.of(parts)
    for pair in part_of(parts).classifier._pairs.values():
        pair.classifier.count(0, True)
        pair.contradictions += 1.0
    assert known.same(Grounds.of(parts))


LAWS: dict[str, Callable[[Parts], None]] = {
    "pairs": lambda parts: setattr(book(parts), "pair", replace(book(parts).pair, bits=1.0)),  # type: ignore[type-var]
    "inertia": lambda parts: setattr(book(parts), "inertia", Inertia()),
    "free": lambda parts: book(parts).free.update(
        {k: replace(v, bits=1.0) for k, v in book(parts).free.items()}
    ),
    "shares": lambda parts: book(parts).shares.update({("a", "b"): Share()}),
    "tolerance": lambda parts: setattr(book(parts), "tolerance", 0.5),
    "who is governed": lambda parts: setattr(parts.laws, "governed", frozenset()),
}


def book(parts: Parts):  # type: ignore[no-untyped-def]
    assert parts.laws is not None
    return parts.laws.learner.book


@pytest.mark.parametrize("name", sorted(LAWS))
def test_another_law_is_noticed(name: str) -> None:
    parts = lawful_model()
    known = Grounds.of(parts)
    assert known.same(Grounds.of(parts))
    LAWS[name](parts)
    assert not known.same(Grounds.of(parts))


def test_where_laws_govern_votes_are_not_read() -> None:
    parts = lawful_model()
    known = Grounds.of(parts)
    (governed, *_) = [m for t, m in parts.models.items() if parts.governs(t)]
    governed.latest = 99
    assert known.same(Grounds.of(parts))
