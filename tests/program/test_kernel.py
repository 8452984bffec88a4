"""The kernel says what arrays say: of learned models, of laws that nobody would learn, and whatever the scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dreams import room_model
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import (
    MODELS,
    assert_alike,
    books,
    crowded,
    lawful,
    looked_back,
    room_schema,
    runner,
    scenes_of,
    with_laws,
)

from relgym.experiments.laws.trials import TRIALS
from relgym.laws.learner import LawLearner
from relgym.model.running.lowering import lowered
from relgym.model.running.trusting import trusting
from relgym.scene.objects import Scene


@pytest.mark.parametrize("name", MODELS)
def test_learned_models(name: str) -> None:
    model = MODELS[name]()
    layout, vectors = scenes_of(model, 120)
    assert_alike(model._parts, layout, vectors)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", MODELS)
def test_what_somebody_looked_back_at(name: str, seed: int) -> None:
    model = looked_back(MODELS[name](), seed)
    layout, vectors = scenes_of(model, 60, seed)
    program = trusting(model._parts, layout, lowered(model._parts, layout))
    parts = model._parts
    asked = [t for t in parts.targets if parts.models[t].asks_regressions and not parts.governs(t)]
    asked = [t for t in asked if parts.regressions[t.type].sums(t.property) is not None]
    assert asked or name not in (
        "cart with a rough velocity",
        "cart on a hill",
        "room by modes",
        "line with roles",
    )
    assert any(a.regression is not None for a in program.answers) == bool(asked)
    assert any(a.trust is not None and a.trust.distant for a in program.answers) == (name == "cart on a hill")
    assert_alike(model._parts, layout, vectors)


@pytest.mark.slow
@pytest.mark.parametrize("trial", [t for t in TRIALS if t.world.dimensions == 2], ids=lambda t: t.name)
def test_laws_of_other_worlds(trial: Any) -> None:
    parts, layout, vectors = lawful(trial)
    assert_alike(parts, layout, vectors, 1e-14)


@settings(max_examples=6, deadline=None)
@given(data=st.data(), shapes=st.integers(1, 3), balls=st.integers(1, 3), seed=st.integers(0, 10**6))
def test_laws_of_any_form(data: st.DataObject, shapes: int, balls: int, seed: int) -> None:
    schema = room_schema(shapes, balls)
    learner = LawLearner(schema, schema.targets or (), seed=0)
    learner.book = data.draw(books(schema))
    parts = with_laws(schema, learner)
    assert_alike(parts, schema.layout(), crowded(schema, 30, seed))


@pytest.mark.slow
@settings(max_examples=1000, deadline=None)
@given(data=st.data(), shapes=st.integers(1, 3), balls=st.integers(1, 3), seed=st.integers(0, 10**6))
def test_laws_of_any_form_in_a_hundred_thousand_scenes(
    data: st.DataObject, shapes: int, balls: int, seed: int
) -> None:
    schema = room_schema(shapes, balls)
    learner = LawLearner(schema, schema.targets or (), seed=0)
    learner.book = data.draw(books(schema))
    assert_alike(with_laws(schema, learner), schema.layout(), crowded(schema, 100, seed))


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_learned_models_in_a_hundred_thousand_scenes(name: str) -> None:
    model = MODELS[name]()
    for seed in range(10):
        assert_alike(model._parts, *scenes_of(model, 10_000, seed))


@pytest.mark.parametrize("name", MODELS)
def test_a_scene_alone_gets_the_same_bits(name: str) -> None:
    model = MODELS[name]()
    layout, vectors = scenes_of(model, 60)
    run = runner(model._parts, layout)
    many = run.many(np.ascontiguousarray(vectors))
    assert many is not None
    for k, vector in enumerate(vectors):
        scene = Scene(model.schema, layout, vector.copy())
        one = run.argued(scene, model._parts.perception.percept(layout, scene.vector[None]))
        assert one is not None
        np.testing.assert_array_equal(one.scene.vector, many.vectors[k])
        assert [p.mode for p in one.parts] == many.modes[k].tolist()


@pytest.mark.parametrize("name", MODELS)
def test_a_single_scene_is_told_as_arrays_tell_it(name: str) -> None:
    from relgym.model.predicting.querying import predict

    model = MODELS[name]()
    layout, vectors = scenes_of(model, 60)
    run = runner(model._parts, layout)
    for vector in vectors:
        scene = Scene(model.schema, layout, vector.copy())
        percept = model._parts.perception.percept(layout, scene.vector[None])
        known, said = predict(model._parts, percept, scene), run.argued(scene, percept)
        assert said is not None
        assert [repr(p) for p in said.parts] == [repr(p) for p in known.parts]


def test_a_body_that_cannot_be_is_left_to_arrays() -> None:
    model = room_model("auto")
    layout, vectors = scenes_of(model, 3)
    index = layout.bodies[0]
    vectors[1, layout.offsets[index] + layout.types[index].pose_columns()[6]] = -1.0
    assert runner(model._parts, layout).many(np.ascontiguousarray(vectors)) is None
