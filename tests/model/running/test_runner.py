"""Programs follow the model: none answers for a model that isn't any more, and what has no program still answers."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from dreams import LINE_STEPS, cart_model, line_model, room_model
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import MODELS, arrays, assert_alike, looked_back, scenes_of
from worlds import LINE_TARGETS, learned, schema_of, transitions

from relgym.config import ModelConfig
from relgym.model.percepts.perception import Percept
from relgym.model.predicting.calibration import Audit, Key
from relgym.model.predicting.prediction import LateAudit, Prediction, ScenePrediction
from relgym.model.predicting.querying import predict
from relgym.model.running import runner as running
from relgym.model.running.compiled import KERNEL
from relgym.model.running.lowering import lowered
from relgym.model.world_model import WorldModel
from relgym.program.records import BeyondError
from relgym.scene.objects import Scene
from relgym.wrappers import ModelLearner

ALONE = running._alone


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel is there, and programs are lowered for the first scene that is asked."""
    monkeypatch.setattr(running, "_alone", lambda asked, scenes: False)
    KERNEL.load()


def assert_fresh(model: WorldModel, scene: Scene) -> None:
    """One scene and a batch get what arrays say of the model as it is."""
    known = arrays(model._parts, scene.layout, scene.vector[None])
    one, many = model.predict_one(scene), model.predict_batch(scene.layout, scene.vector[None])
    for vector in (one.scene.vector, many.vectors[0]):
        np.testing.assert_array_equal(vector, known.vectors[0])
    assert [p.mode for p in one.parts] == many.modes[0].tolist() == known.modes[0].tolist()
    np.testing.assert_array_equal(many.outcomes, known.outcomes)


@settings(max_examples=8, deadline=None)
@given(st.lists(st.booleans(), min_size=30, max_size=60), st.integers(0, 100))
def test_learning_and_predicting_in_any_turn(turns: list[bool], start: int) -> None:
    schema = schema_of(LINE_STEPS, LINE_TARGETS)
    model = WorldModel(schema, ModelConfig(frames="world"))
    stream = iter(transitions(schema, LINE_STEPS[start : start + len(turns) + 1]))
    transition = next(stream)
    for learns in turns:
        if learns:
            transition = next(stream)
            model.learn_one(transition)
        assert_fresh(model, transition.before)


def test_laws_that_change_are_followed() -> None:
    schema = schema_of(LINE_STEPS, LINE_TARGETS)
    model = WorldModel(schema)
    for transition in transitions(schema, LINE_STEPS[:150]):
        model.learn_one(transition)
        assert_fresh(model, transition.before)


@pytest.mark.parametrize("change", ["finish", "merge"])
def test_other_changes_are_followed(change: str) -> None:
    schema = schema_of(LINE_STEPS, LINE_TARGETS)
    model, other = (learned(schema, part) for part in (LINE_STEPS[:40], LINE_STEPS[40:200]))
    scene = transitions(schema, LINE_STEPS[200:201])[0].before
    model.predict_one(scene)
    changes: dict[str, Callable[[], object]] = {"finish": model.finish, "merge": lambda: model.merge(other)}
    changes[change]()
    assert_fresh(model, scene)


def test_hindsight_is_followed() -> None:
    schema = schema_of(LINE_STEPS, LINE_TARGETS)
    model = learned(schema, LINE_STEPS[:200], config=ModelConfig(frames="world"))
    scene = transitions(schema, LINE_STEPS[200:201])[0].before
    for _ in range(80):
        found = model.predict_one(scene)
        model.look_back(found, {(p.object, p.property): 1.0 for p in found.parts})
    assert any(model.property_model(t.type, t.property).undecided for t in model.targets)
    assert_fresh(model, scene)


def test_a_program_is_lowered_once_it_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "_alone", ALONE)
    model = learned(schema := schema_of(LINE_STEPS, LINE_TARGETS), LINE_STEPS[:60])
    scene = transitions(schema, LINE_STEPS[60:61])[0].before
    calls: list[object] = []

    def counted(*args: object) -> object:
        calls.append(args)
        return lowered(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(running, "lowered", counted)
    for asked in range(1, 6):
        model.predict_one(scene)
        assert len(calls) == (asked > 1)


def test_programs_that_cannot_tell_rest() -> None:
    schema = schema_of(LINE_STEPS, LINE_TARGETS)
    scene = transitions(schema, LINE_STEPS[:1])[0].before
    asked: list[int] = []

    class Runner:
        def __init__(self, now: int) -> None:
            self.now = now

        def sure(self, _: Scene) -> None:
            return None

        def argued(self, *_: object, **__: object) -> object:
            asked.append(self.now)
            return "told" if 383 <= self.now < 386 else None

    programs, parts = running.Programs(), SimpleNamespace(resumes=lambda *_: False)
    for now in range(400):
        programs.changed()
        programs.of = lambda *_, now=now: Runner(now)  # type: ignore[method-assign]
        programs.one(parts, scene, lambda _: None)  # type: ignore[arg-type, return-value]
    # Rests of 1, 3, 7, 15, 31, 63, 127, then 128; whoever can tell is asked each time, and rests shortly if he can't.
    assert asked == [0, 2, 6, 14, 30, 62, 126, 254, 383, 384, 385, 386, 388, 392]


@pytest.mark.parametrize("make", [cart_model, line_model, room_model, lambda: room_model("auto")])
def test_small_worlds_have_programs(make: Callable[[], WorldModel]) -> None:
    model = make()
    assert lowered(model._parts, model.schema.layout()).answers


def test_what_has_no_program_says_why() -> None:
    schema = schema_of(LINE_STEPS, LINE_TARGETS)
    fcl = WorldModel(schema, ModelConfig(geometry="fcl"))
    with pytest.raises(BeyondError, match="geometry 'fcl'"):
        lowered(fcl._parts, schema.layout())


def fields_of(part: Prediction) -> list[object]:
    """All that a prediction says; NaN as a word, since it differs from itself."""
    told = [
        part.object,
        part.property,
        part.value,
        part.outcome,
        part.mode,
        part.roles,
        part.margin,
        part.frame,
    ]
    said = [*told, part.spread, part.probability, part.interval, part.audit]
    return [repr(each) for each in said]


@pytest.mark.parametrize("name", sorted(MODELS))
def test_a_program_that_settles_says_what_arrays_say(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "REPAID", 0)
    model = looked_back(MODELS[name](), seed=3)
    layout, vectors = scenes_of(model, 60, seed=4)
    for vector in vectors:
        scene = Scene(model.schema, layout, vector)
        known = predict(model._parts, model._parts.perception.percept(layout, vector[None]), scene)
        found = model.predict_one(scene)
        np.testing.assert_array_equal(found.scene.vector, known.scene.vector)
        assert [fields_of(part) for part in found.parts] == [fields_of(part) for part in known.parts]


def test_many_single_scenes_are_settled_by_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    model = looked_back(cart_model())
    layout, vectors = scenes_of(model, 1, seed=4)
    scene = Scene(model.schema, layout, vectors[0])
    monkeypatch.setattr(running, "REPAID", 3)
    argued: list[Scene] = []
    whole = running.Runner.argued

    def noted(
        self: running.Runner, scene: Scene, percept: Percept, *, resumes: bool = False
    ) -> ScenePrediction | None:
        argued.append(scene)
        return whole(self, scene, percept, resumes=resumes)

    monkeypatch.setattr(running.Runner, "argued", noted)
    for _ in range(6):
        model.predict_one(scene)
    assert len(argued) == 3
    found = model.predict_one(scene)
    assert all(isinstance(p.record, Audit) for p in found.parts)
    model.look_back(found, {(p.object, p.property): 0.0 for p in found.parts})
    model.predict_one(scene)
    assert len(argued) == 4


def test_a_late_audit_is_worked_out_once_and_copied_as_what_it_says() -> None:
    asked = []
    audit = Audit(Key(0, 1, 2), (1.0,), 0)
    late = LateAudit(lambda: asked.append(1) or audit, audit.key, 0, 3.0)
    copied = pickle.loads(pickle.dumps(late))
    assert late() == late() == copied() == audit
    assert (copied.key, copied.speaker, copied.present) == (audit.key, 0, 3.0)
    assert asked == [1]


def test_who_reads_another_prediction_is_right_as_probably_as_both() -> None:
    # box.px' = px + truck.vx', the latter from modes of which it isn't known yet when they hold.
    env = ModelLearner(gym.make("relgym/TruckPush-v0"))
    env.action_space.seed(3)
    env.reset(seed=3)
    scenes = []
    for _ in range(150):
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        scenes.append(info["relgym"].transition.before)
        if terminated or truncated:
            env.reset()
    model = env.model
    assert isinstance(model, WorldModel)
    vectors = np.array([scene.vector for scene in scenes[-60:]])
    assert_alike(model._parts, scenes[0].layout, vectors)
    compared = 0
    for scene in scenes[-60:]:
        known = model.predict_one(scene)
        truck = known["truck", "vx"]
        for name in ("box1", "box2", "box3"):
            box = known[name, "px"]
            if not (truck.ok and box.mode):
                continue
            calibration = model.property_model("box", "px").calibration
            own = calibration.assess(box.audit.key, box.audit.values).probability
            assert box.probability == own * truck.probability
            compared += truck.probability < 1.0
    assert compared > 20
