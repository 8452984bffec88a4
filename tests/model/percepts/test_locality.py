"""Large scenes are looked at locally: what is near decides, names and numbers of bodies don't matter."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from relgym.errors import ConfigError
from relgym.experiments.rooms import Room, rooms
from relgym.model.percepts import locality
from relgym.model.percepts.locality import Neighbourhoods
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Scene, Target, Transition
from relgym.scene.relations import Extractor
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box


def room(objects: int, *, seed: int, steps: int = 100) -> Room:
    return rooms(
        1, objects=objects, elasticity=0.9, friction=0.0, rng=np.random.default_rng(seed), steps=steps
    )[0]


def taught(model: WorldModel, *lessons: Room) -> WorldModel:
    for lesson in lessons:
        for transition in lesson.transitions():
            model.learn_one(transition)
    return model


def test_all_that_touches_is_in_the_small_scene() -> None:
    place = room(60, seed=1)
    model = WorldModel(place.schema)
    extractor = Extractor(place.schema)
    for vector in place.vectors[::10]:
        scene = Scene(place.schema, place.layout, vector.copy())
        near = Neighbourhoods(model._parts, scene)
        touched = extractor.extract(place.layout, vector[None]).relation("intersect")[0, 0]
        there = {place.layout.names[k] for k in near.window(0).objects}
        assert {place.layout.names[place.layout.bodies[k]] for k in np.flatnonzero(touched)} <= there
        assert len(there) <= locality.NEAREST
        named = near.named(0)
        assert set(named.layout.names) == there
        assert all((named[name].values == scene[name].values).all() for name in there)
        assert near.window(0).scene["ball"] is not None


def test_what_is_learned_locally_is_what_is_learned_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    lessons = [room(20, seed=k) for k in range(4)]
    whole = taught(WorldModel(lessons[0].schema), *lessons)
    monkeypatch.setattr(locality, "MOST", 10)
    monkeypatch.setattr(locality, "NEAREST", 12)
    local = taught(WorldModel(lessons[0].schema), *lessons)
    assert local.seen == whole.seen == 400
    off = []
    for transition in room(20, seed=9).transitions():
        said, true = local.predict_one(transition.before), transition.after
        off.append(abs(said.scene["ball"]["vy"] - true["ball"]["vy"]) > 1e-6)
        monkeypatch.setattr(locality, "MOST", 100)
        assert (
            not off[-1]
            or abs(whole.predict_one(transition.before).scene["ball"]["vy"] - true["ball"]["vy"]) > 1e-6
        )
        monkeypatch.setattr(locality, "MOST", 10)
    assert np.mean(off) < 0.05
    scene = Scene(lessons[0].schema, lessons[0].layout, lessons[0].vectors[30].copy())
    one = local.predict_one(scene)
    batch = local.predict_batch(lessons[0].layout, lessons[0].vectors[30:33])
    assert batch.vectors[0].tobytes() == one.scene.vector.tobytes()
    assert [part.object for part in one.parts] == ["ball", "ball"]
    assert "ball.vx" in local.explain(scene)
    assert pickle.loads(pickle.dumps(local)).predict_one(scene).scene == one.scene


def test_a_model_of_small_rooms_predicts_a_room_of_a_thousand_bodies() -> None:
    model = taught(WorldModel(room(8, seed=0).schema), *(room(8, seed=k) for k in range(6)))
    hall = room(995, seed=3, steps=60)
    wrong = []
    for transition in hall.transitions():
        said = model.predict_one(transition.before)
        wrong.append(abs(said.scene["ball"]["vy"] - transition.after["ball"]["vy"]) > 1e-6)
        model.learn_one(transition)
        assert not hasattr(model._percept, "relations")  # of the whole scene nothing was perceived
    assert np.mean(wrong) < 0.1


def test_many_moving_bodies_are_predicted_in_one_batch_and_some_are_learned_of() -> None:
    cart = ObjectType("cart", ("px", "py", "vx", "sx", "sy"), Box(), velocity=("vx", None, None))
    schema = SceneSchema(
        (cart,), tuple((f"c{k}", "cart") for k in range(120)), targets=(Target("cart", "vx"),)
    )
    rng, layout = np.random.default_rng(0), schema.layout()
    model = WorldModel(schema)
    for _ in range(12):
        now = np.stack(
            [3.0 * np.arange(120), np.zeros(120), rng.normal(size=120), np.ones(120), np.ones(120)], axis=1
        )
        then = now * (1.0, 1.0, 0.5, 1.0, 1.0)
        report = model.learn_one(
            Transition(Scene(schema, layout, now.ravel()), Scene(schema, layout, then.ravel()))
        )
        assert 0 < len(report.parts) <= locality.SINGLY
    said = model.predict_one(Scene(schema, layout, now.ravel()))
    assert len(said.parts) == 120
    assert np.allclose(said.scene.vector.reshape(120, 5)[:, 2], 0.5 * now[:, 2])
    still = Scene(schema, layout, now.ravel())
    first, second = (model.learn_one(Transition(still, still)).parts.keys() for _ in range(2))
    assert first != second  # one that rests in its turn


def test_many_kinds_of_which_all_are_learned_of_are_refused_before_anything_is_spent() -> None:
    kinds = tuple(
        ObjectType(f"t{k}", ("px", "py", "vx", "sx", "sy"), Box(), velocity=("vx", None, None))
        for k in range(200)
    )
    schema = SceneSchema(kinds, tuple((f"o{k}", f"t{k}") for k in range(200)))
    values = np.stack([3.0 * np.arange(200), *np.zeros((2, 200)), *np.ones((2, 200))], axis=1)
    scene = Scene(schema, schema.layout(), values.ravel())
    model = WorldModel(schema)
    with pytest.raises(ConfigError, match=r"200 bodies of more than 32 types, and 200 of them .* at most 50"):
        model.learn_one(Transition(scene, scene))
    some = WorldModel(schema, targets=(Target("t7", "vx"),))
    some.learn_one(Transition(scene, scene))
    assert some.predict_one(scene).scene == scene


def test_more_properties_than_one_model_learns_are_refused() -> None:
    wide = ObjectType("wide", tuple(f"p{k}" for k in range(400)))
    schema = SceneSchema((wide,), (("w", "wide"),))
    model = WorldModel(schema)
    with pytest.raises(ConfigError, match="400 properties change, and one model learns at most 256"):
        model.learn_one(Transition(schema.scene({"w": np.zeros(400)}), schema.scene({"w": np.ones(400)})))
    assert (model.seen, model.targets) == (0, ())
    with pytest.raises(ConfigError, match="at most 256"):
        WorldModel(schema, targets=[Target("wide", f"p{k}") for k in range(257)])
    named = WorldModel(schema, targets=[Target("wide", "p3")])
    named.learn_one(Transition(schema.scene({"w": np.zeros(400)}), schema.scene({"w": np.ones(400)})))
    assert named.seen == 1
