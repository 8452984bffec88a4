"""Programs of models whose conditions, walls and roles nobody learned: as arrays, as compiled, as exported Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dreams import line_model, room_model
from hypothesis import given, settings
from hypothesis import strategies as st
from made_programs import by_source
from programs import arrays, assert_alike, looked_back, runner, scenes_of, scrambled
from worlds import scene, schema_of

from relgym.config import ModelConfig
from relgym.model.predicting.prediction import OUTCOMES
from relgym.model.predicting.querying import predict
from relgym.model.running.lowering import lowered
from relgym.model.running.trusting import trusting
from relgym.model.world_model import WorldModel
from relgym.program import records as ir
from relgym.program.source import python_source
from relgym.scene.objects import ACTION, ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema

SENTENCES = tuple(outcome.value for outcome in OUTCOMES)
WORLDS = {"room": room_model, "line": line_model}


def assert_everywhere_the_same(model: WorldModel, count: int, seed: int) -> None:
    """Arrays, the kernel and exported Python agree; one scene alone gets the bits it gets among others."""
    layout, vectors = scenes_of(model, count, seed)
    assert_alike(model._parts, layout, vectors)
    known = arrays(model._parts, layout, vectors)
    program = trusting(model._parts, layout, lowered(model._parts, layout))
    told = by_source(python_source(program, "", SENTENCES), vectors)
    for name in ("outcomes", "modes", "margins", "probabilities", "intervals"):
        np.testing.assert_array_equal(getattr(told, name), getattr(known, name), name)
    np.testing.assert_allclose(told.after, known.vectors, rtol=1e-12, atol=1e-12)
    run = runner(model._parts, layout)
    many = run.many(np.ascontiguousarray(vectors))
    assert many is not None
    for k, vector in enumerate(vectors[:4]):
        scene = Scene(model.schema, layout, vector.copy())
        percept = model._parts.perception.percept(layout, scene.vector[None])
        one = run.argued(scene, percept) or predict(model._parts, percept, scene)
        np.testing.assert_array_equal(one.scene.vector, many.vectors[k])
        assert [p.mode for p in one.parts] == many.modes[k].tolist()
        assert [OUTCOMES.index(p.outcome) for p in one.parts] == many.outcomes[k].tolist()


@pytest.mark.parametrize("name", WORLDS)
@settings(max_examples=8, deadline=None)
@given(data=st.data(), seed=st.integers(0, 1000))
def test_whatever_the_conditions(name: str, data: st.DataObject, seed: int) -> None:
    assert_everywhere_the_same(data.draw(scrambled(WORLDS[name]())), 24, seed)


@pytest.mark.parametrize("name", WORLDS)
@settings(max_examples=4, deadline=None)
@given(data=st.data(), seed=st.integers(0, 1000))
def test_whatever_the_conditions_once_somebody_looked_back(name: str, data: st.DataObject, seed: int) -> None:
    assert_everywhere_the_same(looked_back(data.draw(scrambled(WORLDS[name]())), seed), 16, seed)


# ---------------------------------------------------------------------- by hand
PUSHED = SceneSchema(
    (ObjectType("cart", ("x", "v")), ObjectType(ACTION, ("push",))),
    (("cart", "cart"), (ACTION, ACTION)),
    action_scale=(("push", 0.0, 10.0),),
    targets=(Target("cart", "v"),),
)


def pushed(**config: Any) -> WorldModel:
    """A cart with v' = v / 2 + 2 push; x never moves."""
    model = WorldModel(PUSHED, ModelConfig(**config))
    rng = np.random.default_rng(0)
    for x, v, push in rng.uniform((-5, -5, 0), (5, 5, 10), (40, 3)):
        before = PUSHED.scene({"cart": [x, v], ACTION: [push]})
        model.learn_one(Transition(before, before.replace({("cart", "v"): v / 2 + 2 * push})))
    model.finish()
    return model


def test_the_program_of_one_law_by_hand() -> None:
    model = pushed()
    layout = model.schema.layout()
    program = lowered(model._parts, layout)
    assert program.columns == ("cart.x", "cart.v", "action.push")
    assert (program.width, program.bodies, program.motion, program.kinematics) == (3, (), None, ())
    (answer,) = program.answers
    assert (answer.object, answer.property, answer.column, answer.body, answer.component) == (
        "cart",
        "v",
        1,
        -1,
        -1,
    )
    assert (answer.vote, answer.scope, answer.needs, answer.state, answer.said) == (
        None,
        None,
        (),
        "modes",
        True,
    )
    (mode,) = answer.modes
    assert mode.roles == () and mode.casting is None and mode.players == ("cart", ACTION)
    assert mode.function is not None
    (one, intercept), *terms = mode.function.terms
    assert one == ir.CONSTANT and intercept == pytest.approx(0.0, abs=1e-12)
    assert dict(terms) == {1: pytest.approx(0.5), 2: pytest.approx(2.0)}
    assert mode.register == 9  # behind three numbers now, three next ones, and NaN, 0 and 1
    assert program.registers == 10


def test_what_was_never_learned_has_no_mode() -> None:
    model = WorldModel(PUSHED)
    (answer,) = lowered(model._parts, PUSHED.layout()).answers
    assert (answer.state, answer.modes) == ("none", ())


def test_features_become_registers_of_their_own() -> None:
    rng = np.random.default_rng(0)
    model = WorldModel(PUSHED, ModelConfig(features=("products",)))
    for x, v, push in rng.uniform((-5, -5, 1), (5, 5, 10), (80, 3)):
        before = PUSHED.scene({"cart": [x, v], ACTION: [push]})
        model.learn_one(Transition(before, before.replace({("cart", "v"): 0.5 * v * push})))
    model.finish()
    layout = PUSHED.layout()
    (answer,) = lowered(model._parts, layout).answers
    (feature,) = answer.features
    assert [f.column for f in feature.factors] == [1, 2]
    vectors = rng.uniform((-5, -5, 1), (5, 5, 10), (20, 3))
    assert_alike(model._parts, layout, vectors)
    told = by_source(model.to_python(layout), vectors)
    np.testing.assert_allclose(told.after[:, 1], 0.5 * vectors[:, 1] * vectors[:, 2], rtol=1e-9)
    assert (told.outcomes == 0).all()


def test_who_plays_a_role_is_cast_where_several_could() -> None:
    """Two light balls and a heavy one: whom the heavy one met is looked for; whom a light one met is not."""
    model = line_model()
    layout = model.schema.layout()
    answers = {(a.object, a.property): a for a in lowered(model._parts, layout).answers}
    names = [layout.names[i] for i in layout.bodies]
    (met,) = (mode for mode in answers["heavy0", "vx"].modes if mode.roles)
    assert met.players == ("heavy0", None)
    (role,) = met.roles
    (weight, columns), *others = role.terms
    assert others == [] and weight == pytest.approx(2 * 1.0 / (1.0 + 3.0))  # 2 m / (m + n)
    light = {names.index(f"light{k}"): layout.column(layout.index(f"light{k}"), "vx") for k in (0, 1)}
    assert dict(enumerate(columns)) == {k: light.get(k, -1) for k in range(3)}
    assert met.casting is not None and met.casting.roles == 1
    (who,) = met.casting.descriptions
    assert who.objects == sum(1 << k for k in light) and who.places == (0,)
    for name in ("light0", "light1"):
        assert all(mode.roles == () and mode.casting is None for mode in answers[name, "vx"].modes)
        assert {mode.players for mode in answers[name, "vx"].modes} == {(name,), (name, "heavy0")}


def test_more_bodies_than_bits_are_beyond_it() -> None:
    raw = {
        f"ball{k}": ("ball", {"px": 3.0 * k, "py": 0.0, "d": 1.0, "vx": 0.0, "vy": 0.0}) for k in range(63)
    }
    schema = schema_of([(raw, raw)], [Target("ball", "vx")])
    with pytest.raises(ir.BeyondError, match="more than 62 bodies"):
        lowered(WorldModel(schema)._parts, scene(schema, raw).layout)
    some = dict(list(raw.items())[:62])
    assert len(lowered(WorldModel(schema)._parts, scene(schema, some).layout).bodies) == 62


def test_a_function_that_a_user_registered_is_beyond_it() -> None:
    from relgym.clustering.features import register_function

    register_function("cubed_for_lowering", lambda x: x**3)
    rng = np.random.default_rng(0)
    model = WorldModel(PUSHED, ModelConfig(features=("cubed_for_lowering",)))
    for x, v, push in rng.uniform(-2, 2, (80, 3)):
        before = PUSHED.scene({"cart": [x, v], ACTION: [push]})
        model.learn_one(Transition(before, before.replace({("cart", "v"): v**3})))
    model.finish()
    with pytest.raises(ir.BeyondError, match="cubed_for_lowering"):
        lowered(model._parts, PUSHED.layout())
