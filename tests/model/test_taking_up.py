"""What came as predicted is counted, and offered to what is kept or learned from as one of many."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from relgym.errors import ObservationError
from relgym.experiments.bodies.worlds import Setting, body_rooms
from relgym.model.files.archive import parts_to_arrays, parts_to_json
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.predicting.calibration import LATEST
from relgym.model.predicting.motion import Laws
from relgym.model.predicting.prediction import LateAudit
from relgym.model.predicting.prequential import StepReport, compared
from relgym.model.predicting.querying import predict
from relgym.model.running.grounds import Grounds
from relgym.model.target.hindsight import Standing
from relgym.model.target.property_model import PropertyModel
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.scheduling.agenda import Budget
from relgym.wrappers import ModelLearner


@pytest.fixture(scope="module")
def stream() -> list[Transition]:
    learner = ModelLearner(gym.make("relgym/BallBoxRamp-v0"), predict=False)
    learner.reset(seed=3)
    found = []
    for _ in range(1_500):
        *_, terminated, truncated, info = learner.step(0)
        if info["relgym"].transition is not None:
            found.append(info["relgym"].transition)
        if terminated or truncated:
            learner.reset()
    return found


def written(model: WorldModel) -> tuple[object, dict[str, bytes]]:
    arrays = parts_to_arrays(model._parts)
    flat = {f"{k}": repr(v).encode() for k, v in sorted(arrays.items(), key=str)}
    return parts_to_json(model._parts, history=True), flat


@pytest.fixture(scope="module")
def boxes() -> list[Transition]:
    """Two boxes and a disc that turn, pushed about."""
    (room,) = body_rooms(Setting(("box", "box"), friction=0.5), 1, seed=1)
    scenes = [Scene(room.schema, room.layout, vector) for vector in room.vectors[:40]]
    return [Transition(before, after) for before, after in pairwise(scenes)]


@pytest.mark.parametrize(("name", "share"), [("stream", 0.4), ("boxes", 0.1)])
def test_taking_up_is_looking_back_and_learning(
    name: str, share: float, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = request.getfixturevalue(name)
    confirmed = 0
    whole = Laws._confirmed

    def counted(self: Laws, *given: object) -> bool:
        nonlocal confirmed
        found = whole(self, *given)  # type: ignore[arg-type]
        confirmed += found
        return found

    monkeypatch.setattr(Laws, "_confirmed", counted)
    schema = stream[0].before.schema
    quick, slow = (WorldModel(schema, {"downsampling": 0.0}) for _ in range(2))
    for transition in stream:
        said, studied = (model.predict_one(transition.before) for model in (quick, slow))
        compare_and_learn(quick, transition, said)
        slow.look_back(studied, compared(studied, transition.after)[0])
        slow.learn_one(transition)
    assert confirmed > share * len(stream)
    assert written(quick) == written(slow)


BOX = SceneSchema(
    (ObjectType("cart", ("x", "v")), ObjectType("action", ("force",))), (("a", "cart"), ("action", "action"))
)


def steps(count: int, *, wind: int = -1, seed: int = 0) -> Iterator[Transition]:
    """A cart that is pushed and goes half as fast beyond a mark; from some step on a wind blows."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        x, v = rng.integers(-160, 161, size=2) / 8.0
        force = float(rng.integers(-4, 5))
        later = (0.5 * v if x > 8.0 else v) + 0.25 * force + (1.0 if 0 <= wind <= k else 0.0)
        yield Transition(
            BOX.scene({"a": [x, v], "action": [force]}), BOX.scene({"a": [x, later], "action": [0.0]})
        )


def learned(model: WorldModel, some: Iterable[Transition]) -> list[StepReport]:
    return [compare_and_learn(model, step, model.predict_one(step.before)) for step in some]


SPEED = Target("cart", "v")


def test_what_comes_true_is_learned_from_as_one_of_many_and_counts_for_all() -> None:
    model = WorldModel(BOX, targets=[SPEED])
    whole = WorldModel(BOX, {"downsampling": 0.0}, targets=[SPEED])
    some = list(steps(3_000))
    reports = learned(model, some)
    learned(whole, some)
    kept = len(model.property_model("cart", "v").clusterer.rows)
    assert kept < 0.5 * len(some) < len(whole.property_model("cart", "v").clusterer.rows)
    assert kept == sum(("a", "v") in r.learned.parts for r in reports if r.learned is not None)
    for one, other in zip(model.modes("cart", "v"), whole.modes("cart", "v"), strict=True):
        assert one.same_function(other)
    found = sum(mode.examples for mode in model.modes("cart", "v"))
    assert found + model.property_model("cart", "v").clusterer.noise_examples == len(some)
    told = [float(m) for m in model.property_model("cart", "v").classifier.counts.values()]
    assert 0.97 * len(some) <= sum(told) <= len(some)


def test_the_model_predicts_what_one_that_learned_from_all_does() -> None:
    model = WorldModel(BOX, targets=[SPEED])
    learned(model, steps(3_000))
    fresh = list(steps(1_000, seed=1))
    wrong = [k for k, step in enumerate(fresh) if compared(model.predict_one(step.before), step.after)[1]]
    assert len(wrong) <= 0.02 * len(fresh)


def test_another_law_is_learned_whole_as_soon_as_it_comes() -> None:
    model = WorldModel(BOX, targets=[SPEED])
    reports = learned(model, steps(2_200, wind=2_000))
    late = [("a", "v") in r.learned.parts for r in reports[2_000:2_100] if r.learned is not None]
    assert all(late[:5])
    assert np.mean(late) > 0.9
    assert np.mean([("a", "v") in r.learned.parts for r in reports[1_800:2_000] if r.learned]) < 0.6


def test_what_was_only_counted_leaves_programs_as_they_are() -> None:
    model = WorldModel(BOX, targets=[SPEED])
    reports = learned(model, steps(3_000))
    counted = [r for r in reports if r.learned is not None and r.learned.counted]
    assert len(counted) > 500
    for step in steps(400, seed=2):
        before = Grounds.of(model._parts)
        report = compare_and_learn(model, step, model.predict_one(step.before))
        if report.learned is not None and report.learned.counted:
            assert before.same(Grounds.of(model._parts))
            percept = model._parts.perception.percept(step.before.layout, step.before.vector[None])
            said = predict(model._parts, percept, step.before)
            assert [p.value for p in model.predict_one(step.before).parts] == [p.value for p in said.parts]


def test_a_model_that_was_saved_leaves_out_the_same(tmp_path: Path) -> None:
    model, some = WorldModel(BOX, targets=[SPEED]), list(steps(1_500))
    learned(model, some[:1_000])
    model.save(tmp_path / "model", history=True)
    again = WorldModel.load(tmp_path / "model")
    learned(model, some[1_000:])
    learned(
        again,
        [Transition(*(again.schema.scene(s.values()) for s in (t.before, t.after))) for t in some[1_000:]],
    )
    assert written(model) == written(again)


def test_what_was_left_out_is_nobodys_miss_when_modes_are_searched_anew() -> None:
    model, some = WorldModel(BOX, targets=[SPEED]), list(steps(1_000))
    learned(model, some)
    known = model.property_model("cart", "v")
    known.clusterer._start_over()
    assert known.clusterer.noise_examples == len(known.clusterer.rows)
    known.clusterer.search.discover(model._parts.tables["cart"], len(known.clusterer.rows) - 1, Budget())
    found = sum(mode.examples for mode in known.modes)
    assert known.modes
    assert found + known.clusterer.noise_examples == len(some)


def test_looks_that_are_due_after_so_many_examples_are_taken() -> None:
    model, seen = WorldModel(BOX, targets=[SPEED]), []
    known, measure = model._parts, PropertyModel._measure
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PropertyModel, "_measure", lambda *args: seen.append(1) or measure(*args))
        learned(model, steps(3_000))
    rows = len(known.models[SPEED].clusterer.rows)
    assert len(seen) >= rows // 256


def test_a_late_audit_of_what_is_no_target_any_more_is_none() -> None:
    model, some = WorldModel(BOX, targets=[SPEED]), list(steps(400))
    learned(model, some)
    before = some[0].before
    percept = model._parts.perception.percept(before.layout, before.vector[None])
    said = predict(model._parts, percept, before)
    assert all(isinstance(p.record, LateAudit) for p in said.parts)
    del model._parts.models[SPEED]
    assert [p.audit for p in said.parts] == [None]


def gusty(count: int, seed: int = 0) -> Iterator[Transition]:
    """A kite that rises or falls as the wind goes, which nothing shows, and which turns every 40 steps or so."""
    schema, rng = SceneSchema((ObjectType("kite", ("h",)),), (("k", "kite"),)), np.random.default_rng(seed)
    h, wind = 1.0, 1.0
    before = schema.scene({"k": [h]})
    for _ in range(count):
        wind = -wind if rng.random() < 1.0 / 40.0 else wind
        h = 0.9 * h + wind
        before, last = schema.scene({"k": [h]}), before
        yield Transition(last, before)


def test_what_held_last_is_asked_of_what_follows_alone(tmp_path: Path) -> None:
    some = list(gusty(2_000))
    model = WorldModel(some[0].before.schema, targets=[Target("kite", "h")])
    learned(model, some)
    before, now = some[-1].before, some[-1].after
    wind = now["k"]["h"] - 0.9 * before["k"]["h"]
    told = model.predict_one(now)[("k", "h")]
    assert told.audit.speaker == LATEST
    assert told.value == pytest.approx(0.9 * now["k"]["h"] + wind)
    # Of any other scene it isn't known how the wind goes.
    other = now.schema.scene({"k": [now["k"]["h"] + 0.125]})
    assert math.isnan(model.predict_one(other)[("k", "h")].audit.values[LATEST])
    vectors = np.stack([other.vector, now.vector, other.vector])
    model.save(tmp_path / "kite.json.gz", history=True)
    for same in (model, WorldModel.load(tmp_path / "kite.json.gz"), copy.deepcopy(model)):
        one_by_one = [same.predict_one(scene) for scene in (other, now, other)]
        for _ in range(3):  # arrays, then a program
            many = same.predict_batch(now.layout, vectors)
            for k, one in enumerate(one_by_one):
                assert one.scene.vector.tobytes() == many.vectors[k].tobytes()
                part = one[("k", "h")]
                assert (part.mode, part.probability) == (many.modes[k, 0], many.probabilities[k, 0])
            same.predict_batch(now.layout, np.repeat(vectors, 2_000, axis=0))
        rolled = same.rollout_batch(now.layout, vectors, 3)
        for k, scene in enumerate((other, now, other)):
            along = [step for step in same.rollout(scene, 3) if step.ok]
            assert rolled.lasted[k] == len(along)
            last = along[-1].scene if along else scene
            assert rolled.vectors[k].tobytes() == last.vector.tobytes()
    model.learn_one(Transition(now, other))  # it goes on from there
    assert math.isnan(model.predict_one(now)[("k", "h")].audit.values[LATEST])


def test_modes_have_the_shares_of_what_came_that_they_have_where_all_is_learned_from() -> None:
    """Also where several explain an example: it counts for the simplest, not for the one that predicted it."""
    model, whole = (WorldModel(BOX, {"downsampling": share}, targets=[SPEED]) for share in (0.0075, 0.0))
    some = list(steps(3_000, seed=4))
    for each in (model, whole):
        learned(each, some)
    found = [{m.formula(): m.examples for m in each.modes("cart", "v")} for each in (model, whole)]
    assert found[0].keys() == found[1].keys()
    assert all(abs(found[0][name] - count) <= 0.03 * len(some) for name, count in found[1].items())


def curve(count: int, *, sign: float = 1.0, seed: int = 0) -> Iterator[Transition]:
    """A cart whose next speed is a curve of its speed, through noise: it is known roughly."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        x, v, force = rng.uniform(-3.0, 3.0, size=3)
        later = 0.5 * v + sign * (math.sin(2.0 * v) + 0.3 * force) + 0.05 * rng.normal()
        yield Transition(
            BOX.scene({"a": [x, v], "action": [force]}), BOX.scene({"a": [x, later], "action": [0.0]})
        )


def test_of_what_is_roughly_known_some_is_learned_from_until_the_world_changes() -> None:
    model = WorldModel(BOX, targets=[SPEED])
    learned(model, curve(4_200))
    known = model.property_model("cart", "v")
    assert known.standing is Standing.COARSE

    def shares(some: Iterable[Transition]) -> list[float]:
        taken = [("a", "v") in r.learned.parts for r in learned(model, some) if r.learned is not None]
        return [float(np.mean(part)) for part in np.array_split(taken, 4)]

    assert max(shares(curve(800, seed=1))) < 0.1
    first, *others = shares(curve(400, sign=-1.0, seed=2))
    assert first >= 0.8 and others[0] == 1.0  # it takes some outside of their intervals to notice


def test_models_of_what_is_roughly_known_are_hardly_worse_for_it() -> None:
    some, fresh = list(curve(6_000)), list(curve(500, seed=9))
    left = []
    for share in (0.0075, 0.0):
        model = WorldModel(BOX, {"downsampling": share}, targets=[SPEED])
        learned(model, some)
        off = [model.predict_one(s.before).scene["a"]["v"] - s.after["a"]["v"] for s in fresh]
        left.append(float(np.sqrt(np.mean(np.square(off)))))
    assert left[0] < 1.05 * left[1]


def test_regressions_learn_from_what_is_left_out() -> None:
    model = WorldModel(BOX, targets=[SPEED])
    reports = learned(model, curve(1_500))
    left_out = sum(r.learned is not None and not r.learned.parts for r in reports)
    assert left_out > 500
    assert model._parts.regressions["cart"].seen == 1_500


def test_what_rests_on_something_rough_that_was_left_out_is_not_to_blame() -> None:
    ball, action = ObjectType("ball", ("v", "p")), ObjectType("action", ("u", "reset"))
    given = Target("ball", "p", (("ball", "v"),))
    schema = SceneSchema(
        (ball, action), (("b", "ball"), ("action", "action")), targets=(Target("ball", "v"), given)
    )
    model, rng = WorldModel(schema), np.random.default_rng(0)
    v, p, left_out = 0.3, 0.0, 0
    for _ in range(5_200):
        u, reset = rng.uniform(-1.0, 1.0), float(rng.random() < 0.1)
        later = 0.8 * v + 0.4 * u + 3e-3 * rng.normal()
        place = 0.0 if reset else p + later
        before = schema.scene({"b": [v, p], "action": [u, reset]})
        step = Transition(before, schema.scene({"b": [later, place], "action": [u, reset]}))
        (report,) = learned(model, [step])
        left_out += report.learned is not None and ("b", "v") not in report.learned.parts
        v, p = later, place
    assert left_out > 200
    assert not model.property_model("ball", "p").undecided


def test_weights_of_a_regression_that_are_missing_say_nothing() -> None:
    model = WorldModel(BOX, targets=[Target("cart", "x"), SPEED])
    learned(model, steps(200))
    regression = model._parts.regressions["cart"]
    for ridge in regression._ridges:
        ridge.weights = ridge.weights[:1]
    known = regression.sums(regression.targets[1])
    assert known is not None
    assert all(np.isnan(row).all() for row in known[0])


@pytest.mark.parametrize("off", [Decimal("0.5"), np.float32(0.5), "0.5", math.nan, None])
def test_residuals_that_are_no_finite_numbers_are_refused_before_anything_is_learned(off: Any) -> None:
    model = WorldModel(BOX, targets=[SPEED])
    learned(model, steps(20))
    before = written(model)
    (step,) = steps(1, seed=1)
    said = model.predict_one(step.before)
    with pytest.raises(ObservationError, match="expected finite numbers by"):
        model.take_up(step, said, {("a", "v"): off})
    assert written(model) == before
