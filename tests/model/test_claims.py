"""Small worlds that can't be explained whole: what is claimed of them must be right."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count, islice, pairwise
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from points import schema_of

from relgym.experiments.laws.trials import trial_rooms
from relgym.experiments.laws.worlds import Ball, Material, World
from relgym.experiments.strangers.suite import measure
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.predicting.prediction import ScenePrediction
from relgym.model.world_model import WorldModel
from relgym.reporting.parser import parse_rules
from relgym.scene.objects import Scene, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.wrappers import ModelLearner

Row = tuple[float, ...]
Numbers = Iterator[Row]
Acts = Iterator[tuple[Row, Row, Row]]
"""What was, what was done, and what followed."""


def pixels(rng: np.random.Generator) -> Numbers:
    """A ball of 1.5 pixels a step between two walls, shown in whole pixels, with its last displacement."""
    x, v, last = float(rng.uniform(10.0, 90.0)), 1.5, 0.0
    while True:
        x += v
        if not 0.0 <= x <= 100.0:
            x, v = (-x if x < 0.0 else 200.0 - x), -v
        shown = float(np.round(x))
        yield shown, shown - last
        last = shown


def byte(rng: np.random.Generator) -> Numbers:
    """A byte that switches between 0 and 192 once in 200 steps, and late to a value never seen."""
    value = 0.0
    for k in count(1):
        yield (value,)
        if rng.random() < 0.005:
            value = (192.0 if value == 0.0 else 0.0) if k < 800 else float(rng.integers(1, 191))


def resampled(rng: np.random.Generator) -> Numbers:
    """A number drawn anew once in a hundred steps."""
    value = rng.normal()
    while True:
        yield (float(value),)
        if rng.random() < 0.01:
            value = rng.normal()


def wrapped(rng: np.random.Generator) -> Numbers:
    """A number that grows by 7 and starts over at 360."""
    value = float(rng.uniform(0.0, 360.0))
    while True:
        yield (value,)
        value = (value + 7.0) % 360.0


def clock(rng: np.random.Generator) -> Numbers:
    """A number that is raised every tenth step, which nothing shows."""
    value = float(rng.normal())
    for k in count(int(rng.integers(0, 10)) + 1):
        yield (value,)
        if k % 10 == 0:
            value += 1.0


def regimes(rng: np.random.Generator) -> Numbers:
    """A number that rises for a while, then falls for a while: once in 33 steps it turns, which nothing shows."""
    value, rises = float(rng.normal()), False
    while True:
        yield (value,)
        rises ^= bool(rng.random() < 0.03)
        value += 0.3 if rises else -0.1


def motor(rng: np.random.Generator) -> Acts:
    """A motor whose torque saturates, and how far it has turned; set anew once in a hundred steps."""
    w, turned = 0.0, 0.0
    for k in count():
        if k % 100 == 0:
            w, turned = rng.normal(size=2).tolist()
        u = float(rng.uniform(-1.0, 1.0))
        now, w = w, 0.9 * w + min(max(2.0 * u, -1.0), 1.0)
        yield (now, turned), (u,), (w, turned + 0.1 * w)
        turned += 0.1 * w


def delayed(rng: np.random.Generator) -> Acts:
    """A cart that does what it was told a step ago, which nothing shows."""
    x, v, last = 0.0, 0.0, 0.0
    while True:
        u, now = float(rng.choice([-1.0, 0.0, 1.0])), (x, v)
        v = 0.95 * v + 0.1 * last
        x, last = x + v, u
        yield now, (u,), (x, v)


def teleported(rng: np.random.Generator) -> Acts:
    """What is moved by the action, and found somewhere else once in a hundred steps."""
    place = (0.0, 0.0)
    while True:
        u, now = float(rng.uniform(-1.0, 1.0)), place
        place = (place[0] + u, place[1] + 0.5 * u)
        if rng.random() < 0.01:
            place = (float(rng.uniform(-10.0, 10.0)), float(rng.uniform(-10.0, 10.0)))
        yield now, (u,), place


def acted(world: Callable[[np.random.Generator], Acts], seed: int, steps: int) -> list[Transition]:
    schema = schema_of(("x", "y"), ("u",))
    found = []
    for now, action, then in islice(world(np.random.default_rng(seed)), steps):
        before = {"self": now, "action": action}
        found.append(Transition(schema.scene(before), schema.scene(before | {"self": then})))
    return found


def stream(
    schema: SceneSchema, world: Callable[[np.random.Generator], Numbers], seed: int, steps: int
) -> list[Transition]:
    rows = list(islice(world(np.random.default_rng(seed)), steps + 2))[1:]
    scenes = [schema.scene({"self": row, "action": ()}) for row in rows]
    return [Transition(a, b) for a, b in pairwise(scenes)]


def typical(steps: list[Transition], name: str, prop: str) -> float:
    """What a property mostly changes by, where it does."""
    moved = np.abs([t.after[name][prop] - t.before[name][prop] for t in steps])
    return float(np.median(moved[moved > 0.0])) if moved.any() else 0.0


def watched(model: WorldModel, steps: list[Transition]) -> list[ScenePrediction]:
    """What was said of each step before it was learned."""
    said = []
    for step in steps:
        said.append(model.predict_one(step.before))
        compare_and_learn(model, step, said[-1])
    return said


def claimed_and_off(said: list[ScenePrediction], steps: list[Transition]) -> float:
    """Share of predictions that were claimed and off by more than a twentieth of what mostly changes."""
    wrong = []
    sizes = {(p.object, p.property): typical(steps, p.object, p.property) for p in said[-1].parts}
    for each, step in zip(said, steps, strict=True):
        for part in each.parts:
            error = abs(part.value - step.after[part.object][part.property])
            wrong.append(part.ok and error > max(1e-9, 0.05 * sizes.get((part.object, part.property), 0.0)))
    return float(np.mean(wrong))


def squares(said: list[ScenePrediction], steps: list[Transition], prop: str) -> tuple[float, float]:
    """What predictions, fallback values included, and saying that nothing changes left of a property."""
    came = np.array([s.after["self"][prop] for s in steps])
    now = np.array([s.before["self"][prop] for s in steps])
    told = np.array([each["self", prop].value for each in said])
    return float(np.square(told - came).sum()), float(np.square(now - came).sum())


@pytest.mark.parametrize("world", [pixels, byte, resampled, wrapped, clock, regimes])
def test_what_is_claimed_is_right(world: Callable[[np.random.Generator], Numbers]) -> None:
    props = ("x", "v") if world is pixels else ("x",)
    schema = schema_of(props)
    model = WorldModel(schema)
    steps = stream(schema, world, 1, 1_200)
    watched(model, steps[:600])
    said = watched(model, steps[600:])
    assert claimed_and_off(said, steps[600:]) <= 0.01
    fresh = stream(schema, world, 2, 400)
    asked = [model.predict_one(step.before) for step in fresh]
    assert claimed_and_off(asked, fresh) <= 0.01
    for prop in props:
        own, nothing = squares(asked, fresh, prop)
        assert own <= 1.05 * nothing + 1e-12


@pytest.mark.parametrize("world", [motor, delayed, teleported])
def test_what_is_claimed_is_right_where_things_are_done(world: Callable[[np.random.Generator], Acts]) -> None:
    model, steps, fresh = (
        WorldModel(schema_of(("x", "y"), ("u",))),
        acted(world, 1, 1_000),
        acted(world, 2, 300),
    )
    watched(model, steps[:500])
    said = watched(model, steps[500:])
    asked = [model.predict_one(step.before) for step in fresh]
    assert claimed_and_off(said, steps[500:]) <= 0.01
    assert claimed_and_off(asked, fresh) <= 0.01
    if world is motor:
        assert all(each.ok for each in asked)


def reweighed(rng: np.random.Generator) -> Acts:
    """A mass on a spring, another one in each episode of 200 steps, which nothing shows."""
    for k in count():
        if k % 200 == 0:
            x, v, mass = float(rng.normal()), float(rng.normal()), float(rng.uniform(0.5, 2.0))
        u, now = float(rng.uniform(-1.0, 1.0)), (x, v)
        v += 0.1 * (u - x) / mass
        x += 0.1 * v
        yield now, (u,), (x, v)


@pytest.mark.parametrize("seed", [1, 2])
def test_of_laws_that_come_and_go_none_is_claimed(seed: int, tmp_path: Path) -> None:
    model = WorldModel(schema_of(("x", "y"), ("u",)))
    watched(model, acted(reweighed, seed, 1_600))
    assert model.property_model("self", "y").calibration.fleeting
    fresh = acted(reweighed, 50 + seed, 600)
    asked = [model.predict_one(step.before) for step in fresh]
    assert claimed_and_off(asked, fresh) <= 0.01
    told = model.predict_batch(fresh[0].before.layout, np.array([step.before.vector for step in fresh]))
    assert told.ok.tolist() == [each.ok for each in asked]
    model.save(tmp_path / "model.relgym")
    again = WorldModel.load(tmp_path / "model.relgym")
    assert again.property_model("self", "y").calibration.fleeting
    assert [again.predict_one(step.before).ok for step in fresh] == [each.ok for each in asked]


def valley(rng: np.random.Generator, wide: float = 0.1) -> Acts:
    """A car in a valley: each episode of 200 steps begins so near its midst, and chance pushes it about."""
    for k in count():
        if k % 200 == 0:
            x, v = float(rng.uniform(-0.5 - wide, -0.5 + wide)), 0.0
        u, now = float(rng.integers(0, 3)) - 1.0, (x, v)
        v = v + 0.001 * u - 0.0025 * np.cos(3.0 * x)
        x += v
        yield now, (u,), (x, v)


@pytest.mark.parametrize("seed", range(3))
def test_an_approximation_is_not_claimed_where_it_was_never_tried(seed: int) -> None:
    model, steps = WorldModel(schema_of(("x", "y"), ("u",))), acted(valley, seed, 1_000)
    watched(model, steps)
    assert model.property_model("self", "y").clusterer.approximate
    for wide in (0.1, 0.5):
        fresh = acted(partial(valley, wide=wide), 50, 1_000)
        asked = [model.predict_one(step.before) for step in fresh]
        assert claimed_and_off(asked, fresh) <= 0.01
        told = model.predict_batch(fresh[0].before.layout, np.array([step.before.vector for step in fresh]))
        assert told.ok.tolist() == [each.ok for each in asked]
    near = [part.ok for each in asked for part in each.parts]
    if seed == 2:  # one approximation was found, and leaves a fifth: it isn't asked
        assert not any(near)
    else:
        assert 0.1 < np.mean(near) < 0.9  # where it was tried it is claimed


@pytest.mark.parametrize("seed", [0, 2])
def test_nothing_is_claimed_of_what_calms_down_and_comes_again(seed: int) -> None:
    """The stream ends in a calm, in which all that a bad law says of an epidemic is right."""
    assert measure("relgym-strangers/Epidemic-v0", seed)["claimed_off"] <= 0.01


def right_from(said: list[ScenePrediction], steps: list[Transition]) -> int:
    """From which step on 49 of 50 predictions are claimed and right."""
    right = [
        bool(p.parts) and p.ok and abs(p.parts[0].value - s.after["self"]["v"]) < 1e-9
        for p, s in zip(said, steps, strict=True)
    ]
    return next(k for k in range(len(right) - 49) if sum(right[k : k + 50]) >= 49)


def drifting(rng: np.random.Generator, halved: bool) -> Acts:
    """What falls, twice or half as fast."""
    for v, u in rng.normal(size=(600, 2)).tolist():
        yield (v,), (u,), (v + 0.1 * u - (0.5 if halved else 1.0),)


def dragged(rng: np.random.Generator, doubled: bool) -> Acts:
    """What a force moves and drag slows, one step after the other."""
    v = 3.0
    for u in rng.uniform(-1.0, 1.0, 600).tolist():
        now, v = v, (0.9 if doubled else 0.95) * v + 0.3 * u
        yield (now,), (u,), (v,)


@pytest.mark.parametrize("world", [drifting, dragged])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_law_that_changed_is_doubted_at_once(
    world: Callable[[np.random.Generator, bool], Acts], seed: int
) -> None:
    schema, rng = schema_of(("v",), ("u",)), np.random.default_rng(seed)
    before, after = (
        [
            Transition(schema.scene({"self": now, "action": u}), schema.scene({"self": then, "action": u}))
            for now, u, then in world(rng, changed)
        ]
        for changed in (False, True)
    )
    model = WorldModel(schema)
    said = watched(model, before), watched(model, after)
    assert claimed_and_off(said[1], after) <= 0.01
    # Right again as soon as the first law was found, or nearly; which is kept.
    assert right_from(said[1], after) <= 2 * right_from(said[0], before)
    assert len(model.modes("self", "v")) == 2


def geared(rng: np.random.Generator, other: bool, count: int = 1_000) -> Acts:
    """What one of two laws moves, as a switch stands; each of them may be another one."""
    for v, w, u in rng.uniform(-1.0, 1.0, (count, 3)).tolist():
        pushed, slowed = (v + 2.0 * u, 0.25 * v) if other else (v + u, 0.5 * v)
        yield (v, w), (u,), (pushed if w > 0.0 else slowed, w)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_modes_of_a_world_that_changed_take_no_part_in_the_vote(seed: int, tmp_path: object) -> None:
    schema, rng = schema_of(("v", "w"), ("u",)), np.random.default_rng(seed)
    first, then, back = (
        [
            Transition(schema.scene({"self": now, "action": u}), schema.scene({"self": then, "action": u}))
            for now, u, then in geared(rng, changed)
        ]
        for changed in (False, True, False)
    )
    model = WorldModel(schema, targets=[Target("self", "v")])
    begun = right_from(watched(model, first), first)
    part = model.property_model("self", "v")
    old = {mode.id for mode in part.modes}
    assert len(old) == 2
    assert not part.past
    said = watched(model, then)
    assert right_from(said, then) <= max(2 * begun, 200)
    assert claimed_and_off(said, then) <= 0.01
    assert part.past == old
    assert set(part.classifier.modes) == {mode.id for mode in part.modes} - old
    assert model.describe(details=True).count("has ended: others hold now") == 2
    assert model.describe().count("has ended: v' = ") == 2
    steps = sum(branch.steps for branch in model.rules().properties[0].branches)
    assert 0.9 * len(then) < steps <= len(then)  # of those before none goes by what holds now
    assert parse_rules(model.describe(digits=17)).properties[0].ended == model.rules().properties[0].ended

    model.save(path := f"{tmp_path}/model.json", history=True)
    again = WorldModel.load(path)
    known = again.property_model("self", "v")
    assert known.past == old
    assert [again.predict_one(s.before) for s in back] == [model.predict_one(s.before) for s in back]
    merged = WorldModel.load(path)
    merged.merge(again)
    assert not merged.property_model("self", "v").past  # of two histories neither comes first
    said = watched(again, back)  # the old laws hold again, and needn't be found again
    assert {mode.id for mode in known.modes} == {mode.id for mode in part.modes}
    assert not known.past & old
    late = [abs(p["self", "v"].value - s.after["self"]["v"]) < 1e-9 for p, s in zip(said, back, strict=True)]
    assert np.mean(late[-500:]) > 0.85


def test_soft_contacts_of_moving_discs_are_not_claimed() -> None:
    discs = World(
        2, (Ball("disc"), Ball("disc")), ("block",) * 4, {"block": Material()}, between=Material(spring=0.3)
    )

    def episodes(seed: int, count: int) -> list[Transition]:
        found = []
        for room in trial_rooms(discs, count, seed=seed, steps=60):
            scenes = [Scene(room.schema, room.layout, vector) for vector in room.vectors]
            found += [Transition(a, b) for a, b in pairwise(scenes)]
        return found

    steps, fresh = episodes(0, 8), episodes(1, 4)
    model = WorldModel(steps[0].before.schema)
    watched(model, steps)
    asked = [model.predict_one(step.before) for step in fresh]
    assert claimed_and_off(asked, fresh) <= 0.01
    assert np.mean([part.ok for each in asked for part in each.parts]) > 0.9  # flight is claimed


def test_the_record_goes_with_the_model(tmp_path: object) -> None:
    schema = schema_of(("x",))
    model = WorldModel(schema)
    steps = stream(schema, clock, 1, 400)
    watched(model, steps)
    scenes: list[Scene] = [step.before for step in steps[:50]]
    told = [model.predict_one(scene)["self", "x"] for scene in scenes]
    assert all(np.isfinite(part.probability) and np.isfinite(part.interval) for part in told)
    for history in (True, False):
        path = f"{tmp_path}/model.json"
        model.save(path, history=history)
        again = WorldModel.load(path)
        assert [again.predict_one(scene)["self", "x"] for scene in scenes] == told
    batch = model.predict_batch(scenes[0].layout, np.array([scene.vector for scene in scenes]))
    assert batch.probabilities[:, 0].tolist() == [part.probability for part in told]
    assert batch.intervals[:, 0].tolist() == [part.interval for part in told]
    assert [bool(ok) for ok in batch.ok] == [part.ok for part in told]


def test_what_rests_on_an_approximation_is_as_uncertain_as_it_comes_out() -> None:
    # x' = x + v' exactly, v' only roughly: never quite right, which isn't a fault that another one is to blame for.
    env = ModelLearner(gym.make("MountainCar-v0"))
    env.action_space.seed(0)
    env.reset(seed=0)
    held: list[bool] = []
    for step in range(800):
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        report = info["relgym"]
        for part in report.prediction.parts if step >= 400 else ():
            off = report.residuals[part.object, part.property]
            if part.property == "x0" and not math.isnan(part.interval):
                held.append(abs(off) <= part.interval)
        if terminated or truncated:
            env.reset()
    assert len(held) > 300
    assert np.mean(held) >= 0.9
