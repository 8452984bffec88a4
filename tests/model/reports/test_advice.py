"""What isn't explained is called so, with what would explain it; approximations and laws are told apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from points import formulas, learned, schema_of, transitions

from relgym.model.learning.fitting import compare_and_learn
from relgym.model.predicting.prediction import Outcome
from relgym.model.reports.advice import LAST_RESORT, Advice, _choose, _Trial, _try, together
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Target, Transition
from relgym.scene.schema import SceneSchema

SCHEMA = schema_of(("x", "v"), ("a",))


def hills(n: int, seed: int = 0) -> list[Transition]:
    """The slope under a car is a sine of where it is; x is drawn anew, so that only v is a matter of law."""
    rng = np.random.default_rng(seed)
    starts = np.column_stack([rng.uniform(-3.0, 3.0, n), rng.normal(size=n)])
    actions = rng.normal(size=(n, 1))
    return transitions(
        SCHEMA, lambda s, u: [s[0] + 1.0, s[1] + 0.1 * u[0] + 0.3 * np.sin(2.0 * s[0])], starts, actions
    )


def beside_a_cart(
    kind: str, after: Callable[[float, float], list[float]]
) -> tuple[SceneSchema, list[Transition]]:
    """Object *hill* of such a type, by the law given, and one of another type whose law is linear; 300 steps."""
    types = (ObjectType(kind, ("x", "v")), ObjectType("cart", ("w",)))
    schema = SceneSchema(types, (("hill", kind), ("cart", "cart")))
    rng = np.random.default_rng(0)
    steps = [
        Transition(
            schema.scene({"hill": [x, v], "cart": [w]}),
            schema.scene({"hill": after(x, v), "cart": [0.9 * w]}),
        )
        for x, v, w in rng.uniform(-3.0, 3.0, size=(300, 3))
    ]
    return schema, steps


def dice(n: int) -> list[Transition]:
    """What follows has nothing to do with what was."""
    rng = np.random.default_rng(0)
    noise = rng.normal(size=n).tolist()
    return transitions(
        SCHEMA, lambda s, u: [s[0], noise.pop()], rng.normal(size=(n, 2)), rng.normal(size=(n, 1))
    )


@pytest.fixture(scope="module")
def plain() -> WorldModel:
    return learned(SCHEMA, hills(300))


def test_what_is_followed_is_what_most_need_and_fits() -> None:
    """Of 40 numbers, now and next, there are 3,321 products, and with sines and cosines 29,641."""
    schema = schema_of(tuple(f"x{k}" for k in range(40)), ("a",))
    starts = np.random.default_rng(0).normal(size=(3, 40))
    wide = learned(schema, transitions(schema, lambda s, u: [x + 1.0 for x in s], starts, np.zeros((3, 1))))
    sines = Advice("self.x0", 1.0, 1.0, ("trig",), "", 0.0)
    products = [Advice(f"self.x{k}", 1.0, 1.0, ("products",), "", 0.0) for k in (1, 2)]
    nothing = Advice("self.x3", 1.0, 1.0, (), "", 1.0)
    assert together(wide._parts, [nothing]) == ()
    assert together(wide._parts, [sines, nothing]) == ("trig",)
    assert together(wide._parts, [sines, *products]) == ("products",)
    narrow = learned(SCHEMA, hills(3))
    assert together(narrow._parts, [sines, *products]) == ("products", "trig")


def test_advised_features_are_on_and_behind_what_was(plain: WorldModel) -> None:
    assert plain.advised_features() == ("trig",)
    assert learned(SCHEMA, hills(300), features=("trig",)).advised_features() == ("trig",)


def test_a_curve_has_no_linear_law(plain: WorldModel) -> None:
    assert plain.modes("self", "v") == ()
    assert formulas(plain, "x") == ["x' = x + 1"]


def test_its_outcome_says_so(plain: WorldModel) -> None:
    scene = hills(1, seed=5)[0].before
    prediction = plain.predict_one(scene)
    assert prediction["self", "v"].outcome is Outcome.UNEXPLAINED
    assert prediction["self", "x"].ok
    layout = scene.layout
    batch = plain.predict_batch(layout, scene.vector[None])
    assert batch.vectors[0].tolist() == prediction.scene.vector.tolist()


def test_the_advice_names_the_smallest_library_that_explains_it(plain: WorldModel) -> None:
    (advice,) = plain.advice()
    assert (advice.target, advice.features) == ("self.v", ("trig",))
    assert advice.law == "v' = v + 0.1 action.a + 0.3 sin(2 x)"
    assert advice.remains < 1e-6
    assert "ModelConfig(features=('trig',)) explains it" in plain.describe(details=True)


def test_taken_it_gives_the_law() -> None:
    model = learned(SCHEMA, hills(300), features=("trig",))
    assert formulas(model, "v") == ["v' = v + 0.3 sin(2 x) + 0.1 action.a"]
    assert model.advice() == ()


def test_among_several_types_it_is_for_the_one_that_lacks_it() -> None:
    # Of the other type's linear laws features would only make worse ones.
    schema, steps = beside_a_cart("hill", lambda x, v: [x + 1.0, v + 0.3 * np.sin(2.0 * x)])
    model = learned(schema, steps, features=("cart:products",))
    (advice,) = model.advice()
    assert advice.features == ("cart:products", "hill:trig")
    assert "ModelConfig(features=('cart:products', 'hill:trig')) explains it" in model.describe(details=True)
    model = learned(schema, steps, features=advice.features)
    assert [m.formula(4) for m in model.modes("hill", "v")] == ["v' = v + 0.3 sin(2 x)"]
    assert model.advice() == ()


def test_what_other_targets_need_stays_on() -> None:
    schema, steps = beside_a_cart("steep-hill", lambda x, v: [x + 0.3 * np.sin(2.0 * x), v + 0.1 * x * v])
    model = learned(schema, steps, features=("steep-hill:trig",))
    (advice,) = model.advice()
    assert advice.features == ("steep-hill:trig", "steep-hill:products")
    model = learned(schema, steps, features=advice.features)
    assert [m.formula(4) for m in model.modes("steep-hill", "x")] == ["x' = x + 0.3 sin(2 x)"]
    assert [m.formula(4) for m in model.modes("steep-hill", "v")] == ["v' = v + 0.1 x v"]
    assert model.advice() == ()


def test_scenes_that_no_mode_applies_to_are_unexplained() -> None:
    types = (ObjectType("ball", ("v",)), ObjectType("wall", ("k",), optional=True))
    schema = SceneSchema(types, (("ball", "ball"), ("wall", "wall")), targets=(Target("ball", "v"),))
    rng = np.random.default_rng(0)
    steps = []
    for n, (v, k, noise) in enumerate(rng.uniform(-3.0, 3.0, size=(400, 3))):
        wall = {"wall": [k]} if n % 10 < 6 else {}
        after = 0.5 * v + k if wall else v + 0.8 * np.sin(2.0 * v)
        steps.append(
            Transition(
                schema.scene({"ball": [v], **wall}), schema.scene({"ball": [after + 5e-4 * noise], **wall})
            )
        )
    (advice,) = learned(schema, steps).advice()
    assert advice.features == ("ball:trig",)
    assert advice.unexplained == 0.4


def test_a_linear_law_wins_where_it_is_enough() -> None:
    rng = np.random.default_rng(0)
    steps = transitions(
        SCHEMA,
        lambda s, u: [s[0] + 0.1 * s[1], 0.9 * s[1] + u[0]],
        rng.normal(size=(200, 2)),
        rng.normal(size=(200, 1)),
    )
    model = learned(SCHEMA, steps, features=("trig", "products"))
    assert formulas(model, "x") == ["x' = x + 0.1 v"]
    assert formulas(model, "v") == ["v' = 0.9 v + action.a"]


def test_what_no_library_explains_is_called_that() -> None:
    model = learned(SCHEMA, dice(200))
    (advice,) = model.advice()
    assert advice.features == ()
    assert "no library of features that was tried explains it" in str(advice)
    assert model.modes("self", "v") == ()


@pytest.mark.parametrize(("features", "tried"), [((), True), (LAST_RESORT, False)])
def test_what_is_switched_on_is_not_recommended(
    features: tuple[str, ...], tried: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    libraries = []
    monkeypatch.setattr("relgym.model.reports.advice._try", lambda *args: libraries.append(args[-1]))
    (advice,) = learned(SCHEMA, dice(150), features=features).advice()
    assert (LAST_RESORT in libraries) is tried
    assert advice.features == ()


def test_too_few_examples_are_no_reason_for_advice() -> None:
    assert learned(SCHEMA, hills(60)).advice() == ()


def drift(n: int) -> list[Transition]:
    """Nearly a line: a sine so small that it may be noise."""
    rng = np.random.default_rng(0)
    starts = np.column_stack([rng.normal(size=n), rng.normal(size=n)])
    return transitions(
        SCHEMA,
        lambda s, u: [s[0], s[1] + u[0] + 0.002 * np.sin(3.0 * s[1])],
        starts,
        rng.normal(size=(n, 1)),
    )


def test_a_small_curve_drawn_at_random_counts_as_noise_and_is_told() -> None:
    model = learned(SCHEMA, drift(400))
    clusterer = model.property_model("self", "v").clusterer
    assert clusterer.scale.sigma == pytest.approx(0.002 / 2**0.5, rel=0.3)
    assert "± 0.0014" in model.describe(details=True)
    (advice,) = model.advice()
    assert advice.features == ("trig",)
    assert "0.002 sin(3 v)" in advice.law


def test_a_model_without_history_keeps_its_advice(
    plain: WorldModel, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("models") / "hills.json"
    plain.save(path)
    again = WorldModel.load(path)
    assert again.advice() == plain.advice() != ()
    assert again.predict_one(hills(1, seed=5)[0].before)["self", "v"].outcome is Outcome.UNEXPLAINED


def trial(left: float, size: int, *, bare: bool = False) -> _Trial:
    return _Trial(("trig",), left, "", size, bare)


def test_a_law_that_needs_no_features_goes_first() -> None:
    small, plain, best = trial(0.0012, 9), trial(0.0013, 15, bare=True), trial(0.0011, 43)
    assert _choose([small, plain, best], 0.01) is plain
    assert _choose([small, best], 0.01) is small
    assert _choose([small, replace(plain, left=0.005), best], 0.01) is small  # not as good
    assert _choose([small, plain, best], 0.0014) is None  # hardly better than what there is


def test_no_features_are_recommended_that_the_law_does_not_use(monkeypatch: pytest.MonkeyPatch) -> None:
    model = learned(SCHEMA, drift(400))
    (advice,) = model.advice()
    assert advice.features == ("trig",)
    bare = lambda *args: _Trial(args[-1], 0.0001, "v' = v + action.a", 15, bare=True)  # noqa: E731
    monkeypatch.setattr("relgym.model.reports.advice._try", bare)
    assert learned(SCHEMA, drift(400)).advice() == ()


def test_what_is_tried_knows_whether_its_law_needs_features() -> None:
    rng = np.random.default_rng(0)
    straight = transitions(
        SCHEMA, lambda s, u: [s[0], 0.9 * s[1] + u[0]], rng.normal(size=(200, 2)), rng.normal(size=(200, 1))
    )
    found = []
    for steps in (straight, drift(200)):
        model = learned(SCHEMA, steps)
        part, table = model.property_model("self", "v"), model._parts.tables["self"]
        found.append(_try(part, table, np.arange(200), ("trig",)))
    assert [None if f is None else f.bare for f in found] == [True, False]


def test_most_left_over_is_unexplained_whatever_the_rest_leaves() -> None:
    told = {
        share: str(Advice("self.v", share, 0.066, ("trig",), "v' = sin(v)", 0.001)) for share in (0.2, 0.8)
    }
    assert told[0.2] == (
        "an approximation that leaves 6.6 % of the change; ModelConfig(features=('trig',)) explains it: v' = sin(v)"
    )
    assert told[0.8] == f"unexplained; {told[0.2]}"


def deck(steps: int, seed: int) -> list[Transition]:
    """Twenty cards of five values, of which some are drawn: how many are left of three of them."""
    rng, schema = np.random.default_rng(seed), schema_of(tuple("abc"), ("draws",))
    found = []
    for k in range(steps):
        if k % 6 == 0:
            left = np.full(5, 4)
        draws = int(rng.integers(2))
        before = {"self": left[:3], "action": (draws,)}
        if draws:
            card = int(rng.choice(5, p=left / left.sum()))
            left = left - np.eye(5, dtype=int)[card]
        found.append(Transition(schema.scene(before), schema.scene(before | {"self": left[:3]})))
    return found


@pytest.mark.parametrize("seed", range(3))
def test_of_what_is_drawn_no_library_tells_which(seed: int) -> None:
    """Of few values there is always a curve through most; one that tells which of two follows is another matter."""
    steps = deck(1_500, seed)
    model = WorldModel(steps[0].before.schema)
    for step in steps:
        compare_and_learn(model, step, model.predict_one(step.before))
    advice = model.advice()
    assert len(advice) == 3
    assert [each.target for each in advice if each.features] == []
