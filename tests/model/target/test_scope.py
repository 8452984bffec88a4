"""How far modes go: where they are used, and the changes that an approximation may predict."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from points import learned, schema_of, transitions

from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.target.scope import EVERYWHERE, Scope
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Transition
from relgym.scene.schema import SceneSchema

SCHEMA = schema_of(("x", "v", "leg"), ("a",))
ROOM = schema_of(("x",), ("a",), ("terminated", "reward"))


def lander(n: int, seed: int = 0, *, steepest: float = 1.5) -> list[Transition]:
    """Flight is a smooth curve that no feature offered fits exactly; a leg that touches is thrown about.

    In what was thrown there is a law of its own, half of it noise.
    """
    rng = np.random.default_rng(seed)
    jolts = rng.normal(size=n).tolist()

    def moved(s: np.ndarray, u: np.ndarray) -> list[float]:
        if s[2]:
            return [s[0], 2.0 * s[0] + jolts.pop(), s[2]]
        return [s[0], s[1] + 0.5 * np.tanh(1.5 * s[0]) + 0.1 * u[0], s[2]]

    leg = (rng.random(n) < 0.095).astype(float)
    starts = np.column_stack([rng.uniform(-steepest, steepest, n), rng.normal(size=n), leg])
    return transitions(SCHEMA, moved, starts, rng.normal(size=(n, 1)))


def strolls() -> list[Transition]:
    """Ends on the right are paid 1, those on the left cost 1; the latter were seen nine times, too few for a mode."""
    rng = np.random.default_rng(0)

    def worth(s: np.ndarray, u: np.ndarray, y: np.ndarray) -> list[float]:
        return [float(abs(y[0]) > 1.0), -0.01 if abs(y[0]) <= 1.0 else np.sign(y[0])]

    starts = np.concatenate([rng.uniform(-0.8, 1.2, 391), rng.uniform(-1.3, -1.1, 9)])
    starts = rng.permutation(starts)[:, None]
    actions = rng.uniform(-1.0, 1.0, size=(400, 1))
    return transitions(ROOM, lambda s, u: [s[0] + 0.1 * u[0]], starts, actions, worth)


@pytest.fixture(scope="module")
def model() -> WorldModel:
    return learned(SCHEMA, lander(760), features=("trig(x)",))


def test_an_approximation_speaks_where_it_is_good(model: WorldModel) -> None:
    part = model.property_model("self", "v")
    assert part.clusterer.approximate
    assert part.fallback.scope.beyond() == ("leg > 0.5",)
    for step in lander(100, seed=1):
        said = model.predict_one(step.before)["self", "v"]
        if step.before["self"]["leg"]:
            assert (said.outcome, said.mode) == (Outcome.UNEXPLAINED, 0)
        else:
            assert said.ok
            assert said.value == pytest.approx(step.after["self"]["v"], abs=0.1)


def test_beyond_a_guess_of_what_happens_there_stands_in(model: WorldModel) -> None:
    part = model.property_model("self", "v")
    assert part.fallback.guess_beyond is not None
    steps = [t for t in lander(1000, seed=2) if t.before["self"]["leg"]]
    said = [model.predict_one(t.before)["self", "v"] for t in steps]
    off = [one.value - t.after["self"]["v"] for one, t in zip(said, steps, strict=True)]
    assert np.std(off) == pytest.approx(1.0, rel=0.3)  # what was thrown changes by 2.3
    assert {one.spread for one in said} == {part.fallback.guess_beyond.mode.sigma}


def test_where_an_approximation_is_nearly_right_it_speaks() -> None:
    """Touched by the leg the curve is off by a tenth of what changes: too much for the law, too little for a guess."""
    rng = np.random.default_rng(0)

    def moved(s: np.ndarray, u: np.ndarray) -> list[float]:
        return [s[0], s[1] + 0.5 * np.tanh(1.5 * s[0]) + 0.1 * u[0] + 0.05 * s[2] * rng.normal(), s[2]]

    leg = (rng.random(760) < 0.095).astype(float)
    starts = np.column_stack([rng.uniform(-1.5, 1.5, 760), rng.normal(size=760), leg])
    steps = transitions(SCHEMA, moved, starts, rng.normal(size=(760, 1)))
    part = learned(SCHEMA, steps, features=("trig(x)",)).property_model("self", "v")
    assert part.clusterer.approximate
    assert part.clusterer.noise_examples > 30
    assert part.fallback.scope.beyond() == ()


def test_far_off_nothing_changes_by_far_more_than_was_seen(model: WorldModel) -> None:
    part = model.property_model("self", "v")
    changes = [t.after["self"]["v"] - t.before["self"]["v"] for t in lander(760)]
    assert part.fallback.scope.most - part.fallback.scope.least == pytest.approx(
        2.0 * np.ptp(changes), rel=0.2
    )
    for step in lander(50, seed=3, steepest=100.0):
        change = model.predict_one(step.before)["self", "v"].value - step.before["self"]["v"]
        assert part.fallback.scope.least - 1e-9 <= change <= part.fallback.scope.most + 1e-9


def test_one_by_one_and_in_batches_with_the_same_bits(model: WorldModel) -> None:
    scenes = [t.before for t in lander(200, seed=4, steepest=20.0)]
    batch = model.predict_batch(scenes[0].layout, np.stack([s.vector for s in scenes]))
    for k, scene in enumerate(scenes):
        said = model.predict_one(scene)
        assert said.scene.vector.tobytes() == batch.vectors[k].tobytes()
        assert [OUTCOMES.index(part.outcome) for part in said.parts] == batch.outcomes[k].tolist()
        assert [part.mode for part in said.parts] == batch.modes[k].tolist()


def test_the_report_tells_where(model: WorldModel) -> None:
    text = str(model.describe(details=True))
    assert "where no mode speaks:\n    leg > 0.5\n" in text


def test_an_explanation_calls_a_guess_a_guess(model: WorldModel) -> None:
    scene = SCHEMA.scene({"self": [1.0, 0.0, 1.0], "action": [0.0]})
    text = model.explain(scene)
    value = model.predict_one(scene)["self", "v"].value
    assert f"self.v: 0 -> {value:.7g}, a guess\n  outcome   unexplained" in text
    assert "  because   leg > 0.5" in text


def test_a_law_has_no_bounds() -> None:
    rng = np.random.default_rng(0)
    starts = np.column_stack([rng.normal(size=(200, 2)), np.zeros(200)])
    steps = transitions(SCHEMA, lambda s, u: [s[0], s[1] + s[0], s[2]], starts, rng.normal(size=(200, 1)))
    model = learned(SCHEMA, steps)
    assert model.property_model("self", "v").fallback.scope is EVERYWHERE
    far = SCHEMA.scene({"self": [1e6, 1.0, 0.0], "action": [0.0]})
    assert model.predict_one(far)["self", "v"].value == pytest.approx(1e6 + 1.0)


def test_a_rare_end_is_not_predicted_as_the_others() -> None:
    model = learned(ROOM, strolls())
    assert len(model.modes("task", "reward")) == 1
    (beyond,) = model.property_model("task", "reward").fallback.scope.beyond()
    assert beyond.startswith("self.x") and " <= -" in beyond

    def predicted(x: float) -> tuple[Outcome, float]:
        scene = ROOM.scene({"self": [x], "action": [0.0], "task": [0.0, 0.0]})
        one = model.predict_one(scene)["task", "reward"]
        return one.outcome, round(one.value, 6)

    assert predicted(1.2) == (Outcome.PREDICTED, 1.0)
    assert predicted(0.0) == (Outcome.PREDICTED, -0.01)
    assert predicted(-1.2)[0] is Outcome.UNEXPLAINED
    text = model.explain(ROOM.scene({"self": [-1.2], "action": [0.0], "task": [0.0, 0.0]}))
    assert f"  because   {beyond[:-2]}" in text


def test_who_always_answers_has_no_scope() -> None:
    model = learned(ROOM, strolls(), abstain=False)
    scene = ROOM.scene({"self": [-1.2], "action": [0.0], "task": [0.0, 0.0]})
    one = model.predict_one(scene)["task", "reward"]
    assert one.ok and one.value == pytest.approx(1.0)  # as of the ends that are known


def test_what_lies_scattered_has_no_place() -> None:
    rng = np.random.default_rng(0)
    jolted = (rng.random(600) < 0.08).tolist()

    def moved(s: np.ndarray, u: np.ndarray) -> list[float]:
        jolt = 3.0 * rng.normal() if jolted.pop() else 0.0
        return [s[0], s[1] + 0.5 * np.tanh(1.5 * s[0]) + jolt, s[2]]

    starts = np.column_stack([rng.uniform(-1.5, 1.5, 600), rng.normal(size=600), rng.integers(2, size=600)])
    model = learned(
        SCHEMA, transitions(SCHEMA, moved, starts, rng.normal(size=(600, 1))), features=("trig(x)",)
    )
    part = model.property_model("self", "v")
    assert part.clusterer.approximate and part.clusterer.noise_examples > 25
    assert part.fallback.scope.tree is None


def test_a_loaded_model_speaks_where_it_did(model: WorldModel, tmp_path: Path) -> None:
    model.save(tmp_path / "lander.relgym")
    again = WorldModel.load(tmp_path / "lander.relgym")
    part, known = again.property_model("self", "v"), model.property_model("self", "v")
    assert part.fallback.scope == known.fallback.scope
    assert part.fallback.guesses.to_json() == known.fallback.guesses.to_json()
    for step in lander(50, seed=5, steepest=10.0):
        said, before = again.predict_one(step.before), model.predict_one(step.before)
        assert said.scene.vector.tobytes() == before.scene.vector.tobytes()


def test_scopes_of_older_files_are_everywhere() -> None:
    assert Scope.from_json({}) is EVERYWHERE
    assert Scope.from_json(EVERYWHERE.to_json()) == EVERYWHERE


def test_a_law_that_is_slightly_off_speaks_where_nobody_guesses() -> None:
    """Beyond x = 1 the step is a hundredth shorter than elsewhere, by some amount that nothing tells."""
    rng = np.random.default_rng(0)

    def moved(s: np.ndarray, u: np.ndarray) -> list[float]:
        return [s[0], s[1] + u[0] * (1.0 if s[0] < 1.0 else rng.uniform(0.97, 0.99)), s[2]]

    starts = np.column_stack([rng.uniform(-1.0, 1.1, 400), rng.normal(size=400), np.zeros(400)])
    model = learned(SCHEMA, transitions(SCHEMA, moved, starts, rng.normal(size=(400, 1))))
    part = model.property_model("self", "v")
    assert part.clusterer.noise_examples >= 10 and not part.fallback.inexact
    assert part.fallback.scope.tree is None
    one = model.predict_one(SCHEMA.scene({"self": [1.05, 0.0, 0.0], "action": [2.0]}))["self", "v"]
    assert one.value == pytest.approx(2.0)


def fanned(n: int) -> tuple[SceneSchema, WorldModel]:
    """A cart that slows down, and where a fan blows hard goes anywhere; fan and lamp come and go."""
    cart, fan, lamp = (
        ObjectType("cart", ("v",)),
        ObjectType("fan", ("s",), optional=True),
        ObjectType("lamp", ("b",)),
    )
    schema = SceneSchema(
        (cart, fan, replace(lamp, optional=True)), (("cart", "cart"), ("fan", "fan"), ("lamp", "lamp"))
    )
    rng, model = np.random.default_rng(0), WorldModel(schema)
    for _ in range(n):
        v, s = rng.uniform(-1.0, 1.0), rng.uniform(0.0, 1.0)
        after = v - 0.1 if s <= 0.7 else rng.normal()
        there = {"fan": [s]}
        model.learn_one(
            Transition(schema.scene({"cart": [v], **there}), schema.scene({"cart": [after], **there}))
        )
    return schema, model


def test_what_the_tree_looks_at_is_found_by_name() -> None:
    schema, model = fanned(600)
    scope = model.property_model("cart", "v").fallback.scope
    assert scope.tree is not None and scope.beyond() == tuple(t for t in scope.beyond() if "fan.s" in t)
    blown = model.predict_one(schema.scene({"cart": [-0.5], "fan": [0.9]}))
    assert blown.parts[0].outcome is Outcome.UNEXPLAINED
    for others in ({}, {"lamp": [0.99]}, {"fan": [0.2], "lamp": [0.99]}):
        found = schema.scene({"cart": [0.3], **others})
        one = model.predict_one(found)
        assert one.parts[0].outcome is Outcome.PREDICTED
        assert one.scene["cart"]["v"] == pytest.approx(0.2)
        many = model.predict_batch(found.layout, found.vector[None])
        np.testing.assert_array_equal(many.vectors[0], one.scene.vector)
        assert "because   leg > 0.5" not in model.explain(found)
    model.learn_one(Transition(schema.scene({"cart": [0.3]}), schema.scene({"cart": [0.2]})))
