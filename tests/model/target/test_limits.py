"""Limits: a cart that drag stops, v' = max(0, v + push - drag), and constants that are no limits."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.config import ModelConfig
from relgym.model.predicting.prediction import Outcome, Prediction
from relgym.model.reports.explain import explain
from relgym.model.reports.report import describe
from relgym.model.target.limits import Limits
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema

SCHEMA = SceneSchema(
    (ObjectType("cart", ("v", "grip")), ObjectType("action", ("push", "drag"))),
    (("cart", "cart"), ("action", "action")),
    targets=(Target("cart", "v"),),
)
LATER = ModelConfig(frames="world")


def scene(v: float, push: float, drag: float, grip: float = 0.0) -> Scene:
    return SCHEMA.scene({"cart": [v, grip], "action": [push, drag]})


def free(before: Scene) -> float:
    cart, action = before["cart"], before["action"]
    return cart["v"] + action["push"] - action["drag"]


def stopped(before: Scene) -> float:
    return max(0.0, free(before))


def gripped(before: Scene) -> float:
    # Nothing but the grip stops the cart: the constant is no limit.
    return 0.0 if before["cart"]["grip"] > 0.5 else before["cart"]["v"] + before["action"]["push"] + 0.1


def scenes(n: int, rng: np.random.Generator) -> list[Scene]:
    drawn = zip(
        rng.uniform(0, 2, n), rng.uniform(0, 2, n), rng.uniform(0, 4, n), rng.integers(0, 2, n), strict=True
    )
    return [scene(*map(float, row)) for row in drawn]


def learned(law: object, n: int, rng: np.random.Generator) -> WorldModel:
    model = WorldModel(SCHEMA, LATER)
    for before in scenes(n, rng):
        after = before.replace({("cart", "v"): law(before)})  # type: ignore[operator]
        model.learn_one(Transition(before, after))
    return model


def test_a_stop_is_a_limit_and_every_prediction_exact(rng: np.random.Generator) -> None:
    model = learned(stopped, 300, rng)
    part = model.property_model("cart", "v")
    assert part.limits.least == pytest.approx(0.0, abs=1e-12)
    assert part.classifier.modes == tuple(m.id for m in part.modes if m.id != part.limits.low)
    fresh = scenes(200, rng)
    found = model.predict_batch(fresh[0].layout, np.stack([s.vector for s in fresh]))
    expected = np.array([stopped(s) for s in fresh])
    assert 40 < (expected == 0.0).sum() < 160
    np.testing.assert_allclose(found.vectors[:, 0], expected, atol=1e-9)
    single = [model.predict_one(s) for s in fresh]
    assert [p.scene["cart"]["v"] for p in single] == found.vectors[:, 0].tolist()
    assert [p.parts[0].mode for p in single] == found.modes[:, 0].tolist()
    assert [p.parts[0].roles for p in single if p.parts[0].mode == part.limits.low] == [
        ("cart",) for s in fresh if stopped(s) == 0.0
    ]


def test_people_are_told(rng: np.random.Generator) -> None:
    model = learned(stopped, 300, rng)
    assert "v' = 0 at least: a limit to what the others predict" in describe(model, details=True)
    assert "then at least 0  (" in describe(model)
    assert "then      at least 0" in explain(model, scene(1.0, 0.5, 3.0))


def test_a_limit_outlives_the_file(rng: np.random.Generator, tmp_path: object) -> None:
    model = learned(stopped, 300, rng)
    model.save(f"{tmp_path}/model.json")
    loaded = WorldModel.load(f"{tmp_path}/model.json")
    assert loaded.property_model("cart", "v").limits == model.property_model("cart", "v").limits
    assert loaded.predict_one(scene(1.0, 0.5, 3.0)).scene["cart"]["v"] == 0.0


def test_a_grip_is_no_limit(rng: np.random.Generator) -> None:
    # In the grip v' = 0, the smallest value there is; but no other mode leads below it.
    part = learned(gripped, 300, rng).property_model("cart", "v")
    assert any(not any(role.terms for role in mode.roles) for mode in part.modes)
    assert part.limits == Limits()


def test_a_value_beyond_a_limit_refutes_it(rng: np.random.Generator) -> None:
    model = learned(stopped, 300, rng)
    before = scene(0.5, 0.0, 3.0)
    model.learn_one(Transition(before, before.replace({("cart", "v"): -2.5})))
    assert model.property_model("cart", "v").limits == Limits()


def test_cut_off_by_hand() -> None:
    limits = Limits(low=3, high=0, least=-1.0)
    inside = Prediction("", "", -0.5, Outcome.PREDICTED, 1, ("a", "b"))
    assert limits.cut_off(inside) is inside
    below = limits.cut_off(Prediction("", "", -1.5, Outcome.PREDICTED, 1, ("a", "b")))
    assert (below.value, below.mode, below.roles) == (-1.0, 3, ("a",))
    values, modes = np.array([-2.0, np.nan, 4.0]), np.array([1, 0, 2])
    limits.cut_off_all(values, modes)
    np.testing.assert_array_equal(values, [-1.0, np.nan, 4.0])
    assert modes.tolist() == [3, 0, 2]
    assert Limits.from_json(limits.to_json()) == limits
    assert 3 in limits and 1 not in limits and 0 not in limits


def test_what_stays_at_a_limit_does_not_start_again() -> None:
    # A counter goes down by 4, stays at 0, and starts at 60 again when the bell rings: while it stays it shows that
    # it doesn't start, so what tells when it does is the bell.
    schema = SceneSchema(
        (ObjectType("clock", ("count", "bell")), ObjectType("action", ("a",))),
        (("clock", "clock"), ("action", "action")),
        targets=(Target("clock", "count"),),
    )
    rng = np.random.default_rng(3)
    model, count = WorldModel(schema, LATER), 60.0
    for _ in range(1500):
        bell = float(count == 0.0 and rng.random() < 0.05)
        before = schema.scene({"clock": [count, bell], "action": [rng.random()]})
        count = 60.0 if bell else max(0.0, count - 4.0)
        model.learn_one(Transition(before, schema.scene({"clock": [count, 0.0], "action": [0.0]})))
    model.finish()
    for start, bell, then in [(0.0, 0.0, 0.0), (0.0, 1.0, 60.0), (40.0, 0.0, 36.0), (2.0, 0.0, 0.0)]:
        scene = schema.scene({"clock": [start, bell], "action": [0.5]})
        assert model.predict_one(scene)["clock", "count"].value == pytest.approx(then), (start, bell)


def test_examples_at_a_limit_are_those_of_the_modes_that_lead_beyond_it() -> None:
    limits = Limits(low=4, least=0.0)
    labels, fits = limits.credited(
        np.array([4, 4, 7, 4]),
        np.array([[False, False], [False, False], [True, False], [False, False]]),
        np.array([[-3.0, 5.0], [-1.0, -2.0], [6.0, 5.0], [np.nan, 1.0]]),
        (7, 9),
        1e-9,
    )
    assert labels.tolist() == [7, 7, 7, 4]
    assert fits.tolist() == [[True, False], [True, True], [True, False], [False, False]]
