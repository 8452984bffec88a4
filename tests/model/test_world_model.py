"""The whole model online: targets, reports, roll-outs, changing scenes, and what it refuses."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from worlds import (
    ROOM_MODES,
    ROOM_TARGETS,
    Raw,
    RawStep,
    formulas,
    learned,
    moved,
    room,
    scene,
    schema_of,
    transitions,
    wrong,
)

from relgym.config import ClusteringConfig, ModelConfig
from relgym.errors import ConfigError, ObservationError, QueryError, RelgymError, SchemaError
from relgym.model.predicting.prediction import Outcome
from relgym.model.world_model import WorldModel, with_action
from relgym.scene.objects import Kinematics, ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema

CART = SceneSchema(
    (ObjectType("cart", ("x",)), ObjectType("action", ("u",))), (("cart", "cart"), ("action", "action"))
)
X = Target("cart", "x")


def cart(x: float, u: float) -> Scene:
    return CART.scene({"cart": [x], "action": [u]})


def pushed(model: WorldModel, n: int, seed: int = 0) -> None:
    """Teach a cart that keeps 90 % of its x and is pushed by u."""
    rng = np.random.default_rng(seed)
    x, u = 1.0, float(rng.normal())
    for _ in range(n):
        new, push = 0.9 * x + u, float(rng.normal())
        model.learn_one(Transition(cart(x, u), cart(new, push)))
        x, u = new, push


def state(model: WorldModel) -> str:
    return json.dumps(model.to_json(history=True), sort_keys=True)


# ---------------------------------------------------------------------- a world without bodies
def test_a_flat_world_is_one_object_without_a_body() -> None:
    model = WorldModel(CART)
    pushed(model, 30)
    assert formulas(model, X) == ["x' = 0.9 x + action.u"]
    prediction = model.predict_one(cart(2.0, -0.5))
    assert prediction.ok
    assert prediction["cart", "x"].value == pytest.approx(1.3, abs=1e-12)
    assert prediction["cart", "x"].roles == ("cart", "action")


def test_the_action_is_never_a_target() -> None:
    model = WorldModel(CART)
    pushed(model, 30)
    assert model.targets == (X,)
    with pytest.raises(ConfigError, match="outside the world"):
        WorldModel(CART, targets=[Target("action", "u")])


def test_a_rollout_takes_its_actions_from_the_plan() -> None:
    model = WorldModel(CART)
    pushed(model, 30)
    steps = model.rollout(cart(1.0, 99.0), 3, actions=[[0.5], [0.0], [-1.0]])
    assert [s.scene["cart"]["x"] for s in steps] == pytest.approx([1.4, 1.26, 0.134], abs=1e-12)
    assert [s.scene["action"]["u"] for s in steps] == [0.5, 0.0, -1.0]
    with pytest.raises(ConfigError, match="from 1 to"):
        model.rollout(cart(1.0, 0.0), 0)
    with pytest.raises(ObservationError, match="action"):
        with_action(cart(1.0, 0.0), [1.0, 2.0])


def test_a_rollout_ends_where_no_mode_speaks() -> None:
    steps = WorldModel(CART, targets=[X]).rollout(cart(1.0, 0.0), 5)
    assert len(steps) == 1
    assert not steps[0].ok


# ---------------------------------------------------------------------- what is a target
def test_every_property_that_changes_becomes_a_target(room_steps: list[RawStep]) -> None:
    model = learned(schema_of(room_steps), room_steps[:60])
    # Positions follow from velocities by the declared kinematics; sizes never change.
    assert set(model.targets) == set(ROOM_TARGETS)


def test_exogenous_properties_are_never_targets() -> None:
    wind = ObjectType("wind", ("speed",), exogenous=("speed",))
    schema = SceneSchema((wind,), (("w", "wind"),))
    model = WorldModel(schema)
    model.learn_one(Transition(schema.scene({"w": [1.0]}), schema.scene({"w": [2.0]})))
    assert model.targets == ()
    with pytest.raises(ConfigError, match="outside the world"):
        WorldModel(schema, targets=[Target("wind", "speed")])


def test_unknown_targets_are_refused_and_named() -> None:
    with pytest.raises(SchemaError, match="no property 'y'"):
        WorldModel(CART, targets=[Target("cart", "y")])
    with pytest.raises(QueryError, match="unknown type 'ship'"):
        WorldModel(CART, targets=[Target("ship", "x")])
    with pytest.raises(QueryError, match=r"cart\.y is no target"):
        WorldModel(CART, targets=[X]).modes("cart", "y")


def test_a_later_target_may_use_the_next_value_of_an_earlier_one() -> None:
    schema = SceneSchema((ObjectType("cart", ("x", "v")),), (("cart", "cart"),))
    targets = [Target("cart", "v"), Target("cart", "x", (("cart", "v"),))]
    model, rng = WorldModel(schema, targets=targets), np.random.default_rng(0)
    for _ in range(40):
        x, v = rng.normal(size=2)
        new = 0.5 * v
        model.learn_one(Transition(schema.scene({"cart": [x, v]}), schema.scene({"cart": [x + new, new]})))
    assert formulas(model, targets[0]) == ["v' = 0.5 v"]
    assert [m.parameters for m in model.modes("cart", "x")] == [2]
    after = model.predict_one(schema.scene({"cart": [1.0, 3.0]})).scene["cart"]
    assert (after["x"], after["v"]) == pytest.approx((2.5, 1.5), abs=1e-12)


# ---------------------------------------------------------------------- outcomes
def test_before_learning_the_model_says_so() -> None:
    part = WorldModel(CART, targets=[X]).predict_one(cart(2.0, 1.0))["cart", "x"]
    assert part.outcome is Outcome.NO_MODE
    assert part.value == 2.0  # persistence, marked as such
    assert part.mode == 0
    with pytest.raises(KeyError, match="no prediction"):
        _ = WorldModel(CART, targets=[X]).predict_one(cart(2.0, 1.0))["cart", "y"]


def test_a_mode_without_its_roles_says_so(room_steps: list[RawStep]) -> None:
    rng = np.random.default_rng(0)
    steps: list[RawStep] = []
    for _ in range(40):
        raw: Raw = {
            "ball0": ("ball", {"px": 0.0, "py": 0.0, "d": 1.0, "w": float(rng.normal())}),
            "box0": ("box", {"px": 5.0, "py": 0.0, "load": float(rng.normal())}),
        }
        steps.append(moved(raw, {"ball0": {"w": 0.5 * raw["box0"][1]["load"]}}))
    model = learned(schema_of(steps, [Target("ball", "w")]), steps)
    assert formulas(model, Target("ball", "w")) == ["w' = 0.5 box.load"]
    alone: Raw = {"ball0": steps[0][0]["ball0"]}
    part = model.predict_one(scene(model.schema, alone))["ball0", "w"]
    assert part.outcome is Outcome.NO_ROLES
    assert part.value == alone["ball0"][1]["w"]


def test_reports_tell_what_changed(room_steps: list[RawStep]) -> None:
    schema = schema_of(room_steps, ROOM_TARGETS)
    model = WorldModel(schema)
    created: set[int] = set()
    for each in transitions(schema, room_steps[:100]):
        report = model.learn_one(each)
        assert set(report.parts) == {("ball0", "vx"), ("ball0", "vy")}
        assert report.changed == any(p.created or p.removed for p in report.parts.values())
        created |= {*report.parts["ball0", "vx"].created}
        created -= {*report.parts["ball0", "vx"].removed}
    assert created == {m.id for m in model.modes("ball", "vx")}
    assert model.seen == 100


def test_every_target_predicts_with_the_functions_it_has_now() -> None:
    # Refits change functions, resets of the noise scale remove them all: predictions must follow at once.
    rng = np.random.default_rng(0)
    model, x = WorldModel(CART, targets=[X]), 1.0
    for _ in range(300):
        new = 0.9 * x + 0.3 + float(rng.normal(scale=1e-6))
        model.learn_one(Transition(cart(x, 0.0), cart(new, 0.0)))
        part = model.predict_one(cart(2.0, 0.0))["cart", "x"]
        modes = {m.id: m for m in model.modes("cart", "x")}
        if part.ok:
            weights = dict(modes[part.mode].roles[0].terms)
            assert part.value == pytest.approx(
                weights.get("x", 0.0) * 2.0 + modes[part.mode].intercept, abs=1e-12
            )
        x = new if abs(new) < 2.9 else float(rng.uniform(-2, 2))
    assert part.ok
    assert part.value == pytest.approx(2.1, abs=1e-5)


# ---------------------------------------------------------------------- objects come and go
def scattered(seed: int, n: int) -> list[RawStep]:
    """The room with some of its boxes, in every scene others."""
    rng = np.random.default_rng(seed)
    steps = []
    for before, after in room(seed, n):
        missing = {f"box{k}" for k in range(3) if rng.random() < 0.3 and _far(before, f"box{k}")}
        steps.append(
            (
                {name: each for name, each in before.items() if name not in missing},
                {name: each for name, each in after.items() if name not in missing},
            )
        )
    return steps


def _far(raw: Raw, name: str) -> bool:
    return abs(raw[name][1]["px"] - raw["ball0"][1]["px"]) > 2.0


def test_objects_may_appear_and_vanish_between_scenes() -> None:
    steps = scattered(0, 300)
    model = learned(schema_of(steps, ROOM_TARGETS), steps)
    for target in ROOM_TARGETS:
        assert formulas(model, target) == ROOM_MODES[target.property]
    assert wrong(model, scattered(1, 150)) == 0


def test_what_vanishes_teaches_nothing(room_steps: list[RawStep]) -> None:
    schema = schema_of(room_steps, ROOM_TARGETS)
    model = WorldModel(schema)
    before, after = room_steps[0]
    gone = {name: each for name, each in after.items() if name != "ball0"}
    assert model.learn_one(Transition(scene(schema, before), scene(schema, gone))).parts == {}
    assert model.learn_one(Transition(scene(schema, gone), scene(schema, after))).parts == {}
    assert model.seen == 2


def test_several_objects_of_a_type_teach_one_model() -> None:
    steps = room(0, 150, boxes=4, balls=2)
    model = learned(schema_of(steps, ROOM_TARGETS), steps)
    assert sum(m.examples for m in model.modes("ball", "vx")) == 300
    for target in ROOM_TARGETS:
        assert formulas(model, target) == ROOM_MODES[target.property]
    fresh = room(1, 80, boxes=4, balls=2)
    assert wrong(model, fresh) == 0
    objects = [(p.object, p.property) for p in model.predict_one(scene(model.schema, fresh[0][0])).parts]
    assert sorted(objects) == [("ball0", "vx"), ("ball0", "vy"), ("ball1", "vx"), ("ball1", "vy")]


def test_kinematics_are_derived_from_the_predicted_velocity(room_model: WorldModel) -> None:
    for before, after in room(1, 20):
        found = room_model.predict_one(scene(room_model.schema, before)).scene["ball0"]
        assert found["px"] == pytest.approx(after["ball0"][1]["px"], abs=1e-12)
        assert found["py"] == pytest.approx(after["ball0"][1]["py"], abs=1e-12)


def test_the_next_scene_starts_the_next_prediction(room_model: WorldModel) -> None:
    raw: Raw = {
        "box0": ("box", {"px": 0.0, "py": 0.0, "sx": 4.0, "sy": 1.0}),
        "ball0": ("ball", {"px": 0.0, "py": 0.66, "d": 0.3, "vx": 0.01, "vy": -0.002}),
    }
    steps = room_model.rollout(scene(room_model.schema, raw), 12)
    assert len(steps) == 12
    assert all(s.ok for s in steps)
    y, v, bounced = 0.66, -0.002, False
    for each in steps:
        touching = y - 0.65 <= 1e-9
        v = -0.9 * v if touching and v <= 1e-9 else v - 0.00098
        y, bounced = y + v, bounced or touching
        assert each.scene["ball0"]["py"] == pytest.approx(y, abs=1e-12)
    assert bounced


# ---------------------------------------------------------------------- bad input leaves the model as it is
OTHER = SceneSchema((ObjectType("cart", ("x", "y")),), (("cart", "cart"),))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("after", [False, True])
def test_numbers_that_are_none_are_named_and_change_nothing(bad: float, after: bool) -> None:
    model = WorldModel(CART, targets=[X])
    pushed(model, 25)
    before = state(model)
    spoilt = Scene(CART, CART.layout(), np.array([bad, 1.0]))
    step = Transition(cart(1.0, 0.0), spoilt) if after else Transition(spoilt, cart(1.0, 0.0))
    with pytest.raises(ObservationError, match="object 'cart', property 'x'"):
        model.learn_one(step)
    with pytest.raises(ObservationError, match="object 'cart', property 'x'"):
        model.predict_one(spoilt)
    with pytest.raises(ObservationError, match="object 'cart', property 'x'"):
        model.predict_batch(CART.layout(), np.stack([cart(1.0, 0.0).vector, spoilt.vector]))
    assert state(model) == before


def test_another_schema_is_refused() -> None:
    model = WorldModel(CART, targets=[X])
    other = OTHER.scene({"cart": [1.0, 2.0]})
    before = state(model)
    with pytest.raises(ObservationError, match="another schema"):
        model.learn_one(Transition(other, other))
    with pytest.raises(ObservationError, match="another schema"):
        model.predict_one(other)
    assert state(model) == before


def test_a_batch_of_another_width_is_refused() -> None:
    model = WorldModel(CART, targets=[X])
    with pytest.raises(ObservationError, match=r"shape \(n, 2\), got \(3, 5\)"):
        model.predict_batch(CART.layout(), np.zeros((3, 5)))


@pytest.mark.parametrize("targets", [ROOM_TARGETS, None])
def test_a_shape_that_cant_be_changes_nothing(
    targets: tuple[Target, ...] | None, room_steps: list[RawStep]
) -> None:
    schema = schema_of(room_steps, targets)
    model = WorldModel(schema)
    for step in transitions(schema, room_steps[:5]):
        before = state(model)
        flat = Transition(step.before.replace({("box0", "sx"): -1.0}), step.after)
        with pytest.raises(RelgymError, match="box0"):
            model.learn_one(flat)
        with pytest.raises(RelgymError, match="box0"):
            model.predict_one(flat.before)
        assert state(model) == before
        model.learn_one(step)
    assert model.seen == 5


def test_an_equal_schema_is_the_same_schema() -> None:
    model = WorldModel(CART, targets=[X])
    pushed(model, 25)
    twin = replace(CART)
    assert model.predict_one(twin.scene({"cart": [2.0], "action": [0.0]})).ok


# ---------------------------------------------------------------------- noise, seeds and budgets
def test_noisy_worlds_are_learned_to_the_noise() -> None:
    rng = np.random.default_rng(0)
    model = WorldModel(CART, targets=[X])
    for _ in range(200):
        x, u = rng.normal(size=2)
        model.learn_one(Transition(cart(x, u), cart(0.9 * x + u + rng.normal(scale=1e-4), 0.0)))
    (mode,) = model.modes("cart", "x")
    assert mode.formula(2) == "x' = 0.9 x + action.u"
    assert mode.sigma == pytest.approx(1e-4, rel=0.2)


def test_the_seed_decides_the_draws_and_nothing_else(room_steps: list[RawStep]) -> None:
    schema = schema_of(room_steps, ROOM_TARGETS)
    found = [
        formulas(learned(schema, room_steps[:150], config=ModelConfig(seed=seed)), ROOM_TARGETS[0])
        for seed in (0, 1, 2)
    ]
    assert found == [ROOM_MODES["vx"]] * 3


def test_clauses_are_learned_within_the_budget(room_steps: list[RawStep]) -> None:
    """Where a search has overdrawn what steps earn, clauses wait until that is paid for."""
    schema, earned = schema_of(room_steps, ROOM_TARGETS), 100_000
    model = WorldModel(schema, ModelConfig(cells_per_step=earned, saved_cells=0, frames="world"))
    spent, waited = [], 0
    for each in transitions(schema, room_steps[:150]):
        poor = model._parts.agenda.saved + earned <= 0
        waiting = any(m.classifier.waits for m in model._parts.models.values())
        spent.append(model.learn_one(each).work)
        assert not (poor and spent[-1])
        waited += poor and waiting
    assert any(spent) and waited
    assert model.finish() > 0
    assert model.finish() == 0
    assert wrong(model, room(1, 100)) == 0


def test_own_properties_only() -> None:
    model = WorldModel(
        CART, ModelConfig(clustering=ClusteringConfig(own_only=True, max_terms=1)), targets=[X]
    )
    pushed(model, 60)
    assert all(m.parameters <= 1 for m in model.modes("cart", "x"))


def test_a_model_is_shown_with_what_it_knows() -> None:
    model = WorldModel(CART)
    assert repr(model) == "WorldModel(no targets yet; 0 transitions)"
    pushed(model, 30)
    assert repr(model) == "WorldModel(cart.x: 1 modes; 30 transitions)"


# ---------------------------------------------------------------------- what is declared, and what comes in
POINT = ObjectType("p", ("x", "v", "a"))


def points(**declared: object) -> SceneSchema:
    return SceneSchema((POINT,), (("one", "p"),), **declared)  # type: ignore[arg-type]


def test_kinematics_follow_one_another_in_whatever_order_they_were_declared() -> None:
    laws = (Kinematics("p", "x", "v"), Kinematics("p", "v", "a"))
    for order in (laws, laws[::-1]):
        schema = points(kinematics=order, targets=(Target("p", "a"),))
        model = WorldModel(schema)
        for a in (0.5, 1.0, 2.0, -1.0, 3.0):
            was = schema.scene({"one": [0.0, 1.0, a]})
            model.learn_one(Transition(was, was))
        found = model.predict_one(schema.scene({"one": [0.0, 1.0, 2.0]}))
        assert found.scene["one"].values.tolist() == [3.0, 3.0, 2.0]


@pytest.mark.parametrize(
    ("kinematics", "message"),
    [
        (
            (Kinematics("p", "x", "v"), Kinematics("p", "v", "x")),
            "follow from one another's next values in a circle",
        ),
        ((Kinematics("p", "x", "x"),), "in a circle"),
        ((Kinematics("p", "x", "v"), Kinematics("p", "x", "a")), r"several laws of kinematics for \['p.x'\]"),
        ((Kinematics("p", "x", "v", math.nan),), "expected a finite step"),
    ],
)
def test_kinematics_that_say_nothing_are_refused(kinematics: tuple[Kinematics, ...], message: str) -> None:
    with pytest.raises(SchemaError, match=message):
        points(kinematics=kinematics)


@pytest.mark.parametrize(
    ("targets", "error", "message"),
    [
        ([Target("p", "x", given=(("p", "v"),)), Target("p", "v")], ConfigError, "is no target before it"),
        ([Target("p", "x", given=(("p", "x"),))], ConfigError, "is no target before it"),
        ([Target("p", "x", given=(("p", "a"),))], ConfigError, "what follows from kinematics comes last"),
        ([Target("p", "v"), Target("p", "v")], ConfigError, "stands there twice"),
        (["p.x"], ConfigError, r"expected a Target, as Target\('ball', 'vx'\)"),
        ([Target("p", "a")], SchemaError, "follows from declared kinematics"),
    ],
)
def test_targets_are_in_causal_order(targets: list[Target], error: type[Exception], message: str) -> None:
    schema = points(kinematics=(Kinematics("p", "a", "x"),))
    with pytest.raises(error, match=message):
        WorldModel(schema, targets=targets)
    assert WorldModel(schema, targets=[Target("p", "v"), Target("p", "x", given=(("p", "v"),))])


def test_scenes_hold_numbers_of_their_own() -> None:
    schema = points()
    found = Scene(schema, schema.layout(), np.array([1, 2, 3]))
    assert (found.vector.dtype, found.replace({("one", "x"): 0.5})["one"]["x"]) == (np.float64, 0.5)
    for bad in (np.zeros(2), [1.0, 2.0], ["a", "b", "c"], np.zeros((1, 3))):
        with pytest.raises(ObservationError, match=r"expected (3 numbers|a state vector of shape)"):
            Scene(schema, schema.layout(), bad)  # type: ignore[arg-type]


def test_a_batch_of_another_world_is_refused() -> None:
    model = WorldModel(points())
    turned = SceneSchema((ObjectType("p", ("v", "x", "a")),), (("one", "p"),))
    for schema in (turned, SceneSchema((ObjectType("q", ("x", "v", "a")),), (("one", "q"),))):
        with pytest.raises(
            ObservationError, match="numbers and names of objects may differ, their types may not"
        ):
            model.predict_batch(schema.layout(), np.zeros((2, 3)))
    more = SceneSchema((POINT,), (("two", "p"), ("three", "p")))
    assert len(model.predict_batch(more.layout(), np.zeros((2, 6))).vectors) == 2


def test_an_object_of_another_type_is_another_object() -> None:
    """Of what became of the first one nothing was seen, least of all that it stayed."""
    q = ObjectType("q", ("x", "v", "a"))
    schema = SceneSchema((POINT, q), (("one", "p"),))
    other = SceneSchema((POINT, q), (("one", "q"),))
    model = WorldModel(schema)
    for k in range(20):
        before = schema.scene({"one": [float(k), 0.5, 0.0]})
        model.learn_one(Transition(before, before.replace({("one", "x"): k + 0.5})))
        model.learn_one(Transition(before, other.scene({"one": [float(k), 0.5, 0.0]})))
    assert model.predict_one(schema.scene({"one": [3.0, 0.5, 0.0]})).scene["one"]["x"] == 3.5
    assert model.property_model("p", "x").clusterer.seen == 20


def test_configurations_are_records() -> None:
    with pytest.raises(ConfigError, match="expected a ModelConfig"):
        WorldModel(points(), 3)  # type: ignore[arg-type]
    assert WorldModel(points(), {"features": ("trig",)}).config == ModelConfig(features=("trig",))
