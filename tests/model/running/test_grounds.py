"""A program that stays while its model learns says what arrays say, at every step."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from dreams import LINE_STEPS, line_model, room_model
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import LINE_TARGETS, schema_of, transitions

from relgym.classification.binary import majority
from relgym.clustering.mode import NOISE
from relgym.config import ModelConfig
from relgym.envs.dreams.setting import recorded
from relgym.laws.book import LawBook
from relgym.laws.inertia import Inertia
from relgym.laws.records import Share
from relgym.logic.clause import Definition
from relgym.model.parts import Parts
from relgym.model.predicting.prediction import Prediction, ScenePrediction
from relgym.model.predicting.querying import predict
from relgym.model.running import runner as running
from relgym.model.running.compiled import KERNEL
from relgym.model.running.grounds import Grounds
from relgym.model.running.lowering import lowered
from relgym.model.running.runner import Runner
from relgym.model.target.hindsight import Hindsight
from relgym.model.target.limits import Limits
from relgym.model.target.property_model import PropertyModel
from relgym.model.target.scope import Scope
from relgym.model.target.spread import Spreads
from relgym.model.target.stops import Stop, Stops
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene
from relgym.wrappers import ModelLearner


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel is there, and programs are lowered for the first scene that is asked."""
    monkeypatch.setattr(running, "_alone", lambda asked, scenes: False)
    KERNEL.load()


def told(prediction: ScenePrediction) -> list[object]:
    """All that a prediction says, NaN being itself."""
    fields = [name for name in Prediction.__slots__ if name != "record"]
    parts = [repr([*(getattr(p, name) for name in fields), p.audit]) for p in prediction.parts]
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


# ---------------------------------------------------------------------- kept programs and fresh ones
def fresh_and_kept(model: WorldModel, scene: Scene) -> tuple[Runner, Runner] | None:
    """What runs the program that was kept, and one that was lowered just now; None where there is none."""
    model.predict_one(scene)
    kept = model._programs.of(model._parts, scene.layout, 1)
    machine = KERNEL.load()
    if kept is None or machine is None:
        return None
    return Runner(model._parts, scene.layout, lowered(model._parts, scene.layout), machine), kept


def assert_nothing_stale(model: WorldModel, scene: Scene) -> bool:
    """The program that was kept is, number for number, the one that would be made now."""
    pair = fresh_and_kept(model, scene)
    if pair is None:
        return False
    fresh, kept = pair
    # Whether it is known how right predictions were is written when that pays: let both know.
    assert fresh._settles() == kept._settles()
    for part in ("code", "numbers"):
        np.testing.assert_array_equal(fresh._space[part], kept._space[part], part)
    assert [t.spoken for t in fresh._tellers] == [t.spoken for t in kept._tellers]
    assert [sorted(t._spreads) for t in fresh._tellers] == [sorted(t._spreads) for t in kept._tellers]
    now = scene.vector
    for one, other in zip(fresh._tellers, kept._tellers, strict=True):
        assert [s(now) for s in one._spreads.values()] == [s(now) for s in other._spreads.values()]
    return True


@pytest.mark.parametrize("frames", ["auto", "world"])
@settings(max_examples=3, deadline=None)
@given(start=st.integers(0, 150), forgets=st.booleans())
def test_a_kept_program_is_the_one_that_would_be_made_now(frames: str, start: int, forgets: bool) -> None:
    schema = schema_of(LINE_STEPS, LINE_TARGETS)
    model = WorldModel(schema, ModelConfig(frames=frames, history=100 if forgets else 200_000))  # type: ignore[arg-type]
    stream = transitions(schema, LINE_STEPS[start : start + 140])
    found = 0
    for k, transition in enumerate(stream):
        if k % 3 == 0:
            found += assert_nothing_stale(model, transition.before)
        model.learn_one(transition)
    model.finish()
    assert assert_nothing_stale(model, stream[-1].before)
    assert found > 20


def _swap(model: WorldModel, **changes: Any) -> None:
    for part in model._parts.models.values():
        for name, value in changes.items():
            setattr(part, name, value)


def _other_mode(model: WorldModel) -> None:
    for part in model._parts.models.values():
        for cluster in part.clusterer.clusters.values():
            cluster.mode = replace(cluster.mode, intercept=cluster.mode.intercept + 1.0)


def _other_guess(model: WorldModel) -> None:
    for part in model._parts.models.values():
        part.fallback.unexplained = True


def _other_scope(model: WorldModel) -> None:
    for part in model._parts.models.values():
        part.fallback.scope = Scope(None, -1.0, 1.0)


def _other_classifier(model: WorldModel) -> None:
    for part in model._parts.models.values():
        for state in part.classifier._pairs.values():
            c = state.classifier
            state.classifier = majority(c.i, c.j, c.scope, (1.0, 2.0))
        part.classifier._pairs_changed()


def _other_experience(model: WorldModel) -> None:
    for part in model._parts.models.values():
        part.classifier._familiarity().seen.add(1)


def _other_players(model: WorldModel) -> None:
    for part in model._parts.models.values():
        for cast in part.casting.classifiers.values():
            for description in cast.descriptions:
                description.definition = Definition((), 2)


def _other_company(model: WorldModel) -> None:
    for part in model._parts.models.values():
        for cast in part.casting.classifiers.values():
            for description in cast.descriptions:
                assert description.common is not None
                description.common = ~description.common


def _other_doubt(model: WorldModel) -> None:
    for part in model._parts.models.values():
        for cast in part.casting.classifiers.values():
            cast.errors = 1.0


CHANGES: dict[str, Callable[[WorldModel], None]] = {
    "a mode": _other_mode,
    "limits": lambda model: _swap(model, limits=Limits(7, NOISE, 0.0, np.inf)),
    "walls": lambda model: _swap(model, stops=Stops((Stop(7, 0.0, "px", 1.0, 0.0, -1.0, 0.1),))),
    "spreads": lambda model: _swap(model, spreads=Spreads()),
    "hindsight": lambda model: _swap(model, hindsight=Hindsight([(1, 1)] * 100)),
    "nothing is explained": _other_guess,
    "scope": _other_scope,
    "conditions": _other_classifier,
    "experience": _other_experience,
    "players": _other_players,
    "what players had in common": _other_company,
    "errors among players": _other_doubt,
}


@pytest.mark.parametrize("change", sorted(CHANGES))
def test_no_program_outlives_what_it_was_lowered_from(change: str) -> None:
    model = copy.deepcopy(line_model())
    scene = transitions(model.schema, LINE_STEPS[:1])[0].before
    pair = fresh_and_kept(model, scene)
    assert pair is not None
    CHANGES[change](model)
    model._programs.changed()
    assert assert_nothing_stale(model, scene)
    found = fresh_and_kept(model, scene)
    assert found is not None and found[1] is not pair[1]


def test_a_program_stays_where_votes_alone_are_counted() -> None:
    model = copy.deepcopy(line_model())
    scene = transitions(model.schema, LINE_STEPS[:1])[0].before
    pair = fresh_and_kept(model, scene)
    part = next(p for p in model._parts.models.values() if p.classifier.classifiers)
    part.classifier.classifiers[0].count(0, True)
    part.classifier._voting.recount(0)
    mode = part.classifier.modes[0]
    part.classifier.counts[mode] += 1000.0
    model._programs.changed()
    assert assert_nothing_stale(model, scene)
    found = fresh_and_kept(model, scene)
    assert pair is not None and found is not None and found[1] is pair[1]


LAWFUL: dict[str, Callable[[LawBook], None]] = {
    "the law of pairs": lambda book: setattr(book, "pair", None),
    "a free law": lambda book: book.free.update(ball=replace(book.free["ball"])),
    "the tolerance": lambda book: setattr(book, "tolerance", 0.25),
    "a share": lambda book: book.shares.update({("ball", "ball"): Share(constant=0.25)}),
}


@pytest.mark.parametrize("change", sorted(LAWFUL))
def test_no_program_outlives_its_laws(change: str) -> None:
    model = copy.deepcopy(room_model("auto"))
    scene = recorded(model).starts[0]
    pair = fresh_and_kept(model, scene)
    assert model._parts.laws is not None and pair is not None
    LAWFUL[change](model._parts.laws.learner.book)
    model._programs.changed()
    assert assert_nothing_stale(model, scene)
    found = fresh_and_kept(model, scene)
    assert found is not None and found[1] is not pair[1]


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


OTHERWISE: dict[str, Callable[[PropertyModel], None]] = {
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


@pytest.mark.parametrize("name", sorted(OTHERWISE))
def test_whatever_is_said_otherwise_is_noticed(name: str) -> None:
    parts = role_model()
    known = Grounds.of(parts)
    assert known.same(Grounds.of(parts))
    OTHERWISE[name](part_of(parts))
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
    governed.hindsight = Hindsight([(1, 1)] * 200)
    assert governed.undecided
    assert known.same(Grounds.of(parts))
