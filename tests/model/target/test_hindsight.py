"""Modes that cover all examples explain nothing if nobody can tell which of them holds when."""

from __future__ import annotations

import copy
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from points import learned, schema_of, transitions

from relgym.config.constants import FIRST, MEMORY, NEARLY_ALL, RECENT
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.predicting.calibration import OWN
from relgym.model.predicting.prediction import OUTCOMES, Outcome, Prediction, ScenePrediction
from relgym.model.target.hindsight import Hindsight, Standing
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, Transition

SCHEMA = schema_of(("x",), ("a",))
STEPS = st.lists(st.integers(0, 5).flatmap(lambda n: st.tuples(st.just(n), st.integers(0, n))), max_size=300)


def draws(n: int, seed: int = 0) -> list[Transition]:
    """What follows is 0, 3 or 7, whatever was and whatever is done."""
    rng = np.random.default_rng(seed)
    following = rng.choice([0.0, 3.0, 7.0], n).tolist()
    return transitions(
        SCHEMA, lambda s, u: [following.pop()], rng.normal(size=(n, 1)), rng.normal(size=(n, 1))
    )


def pushes(n: int, seed: int = 0) -> list[Transition]:
    """A law that anybody finds."""
    rng = np.random.default_rng(seed)
    return transitions(SCHEMA, lambda s, u: [s[0] + u[0]], rng.normal(size=(n, 1)), rng.normal(size=(n, 1)))


def watched(model: WorldModel, steps: list[Transition]) -> WorldModel:
    """The model, after it was asked about each step, told how that came out, and taught."""
    for step in steps:
        said = model.predict_one(step.before)
        residuals = {(p.object, p.property): step.after[p.object][p.property] - p.value for p in said.parts}
        model.look_back(said, residuals)
        model.learn_one(step)
    return model


@pytest.fixture(scope="module")
def lottery() -> WorldModel:
    return watched(WorldModel(SCHEMA), draws(300))


def hindsight(model: WorldModel, prop: str = "x") -> Hindsight:
    return model.property_model("self", prop).hindsight


# ---------------------------------------------------------------------- counting
def test_the_latest_steps_count() -> None:
    known = Hindsight([(3, 2)])
    for _ in range(RECENT - 1):
        known.add(2, 0)
    assert (len(known), known.spoken, known.wrong) == (RECENT, 2 * RECENT + 1, 2)
    known.add(2, 1)
    assert (len(known), known.spoken, known.wrong) == (RECENT, 2 * RECENT, 1)


def test_undecided_is_more_than_a_share_of_enough() -> None:
    most = int((1.0 - NEARLY_ALL) * 100)
    assert not Hindsight([(1, 1)] * (FIRST - 1)).undecided
    assert Hindsight([(1, 1)] * FIRST).undecided
    assert not Hindsight([(1, 1)] * most + [(1, 0)] * (100 - most)).undecided
    assert Hindsight([(1, 1)] * (most + 1) + [(1, 0)] * (99 - most)).undecided


def test_it_ends_at_half_the_share() -> None:
    known = Hindsight([(1, 1)] * 40 + [(1, 0)] * 160)
    back = int(0.5 * (1.0 - NEARLY_ALL) * RECENT)
    for _ in range(40 - back - 1):
        known.add(1, 0)
    assert (known.wrong, known.undecided) == (back + 1, True)
    known.add(1, 0)
    assert (known.wrong, known.undecided) == (back, False)
    known.add(1, 1)  # as many as before, but now they were right in between
    assert (known.wrong, known.undecided) == (back, False)


@given(STEPS, STEPS)
def test_counts_are_those_of_the_steps_kept(
    first: list[tuple[int, int]], rest: list[tuple[int, int]]
) -> None:
    known = Hindsight(first)
    for step in rest:
        known.add(*step)
    again = Hindsight.from_json(json.loads(json.dumps(known.to_json())))
    assert again.to_json() == known.to_json()
    kept = (first + rest)[-RECENT:]
    assert known.to_json()["steps"] == list(map(list, kept))
    assert (known.spoken, known.wrong) == (sum(n for n, _ in kept), sum(k for _, k in kept))


def test_two_models_latest_steps_are_taken_in_turns() -> None:
    one, other = Hindsight([(1, 0), (2, 0), (3, 0)]), Hindsight([(5, 5)])
    assert one.united(other).to_json()["steps"] == [[1, 0], [2, 0], [5, 5], [3, 0]]
    assert Hindsight().united(other).to_json() == other.to_json()
    both = Hindsight([(1, 0)] * RECENT).united(Hindsight([(1, 1)] * RECENT))
    assert (len(both), both.wrong, both.undecided) == (RECENT, RECENT // 2, True)


# ---------------------------------------------------------------------- what follows
def test_modes_that_nobody_can_choose_between_explain_nothing(lottery: WorldModel) -> None:
    part = lottery.property_model("self", "x")
    assert sorted(mode.formula(3) for mode in part.modes) == ["x' = 0", "x' = 3", "x' = 7"]
    assert part.clusterer.noise_examples < 30  # they cover nearly all examples
    assert part.unexplained
    assert part.hindsight.wrong > 0.4 * part.hindsight.spoken


def test_their_value_stays_and_is_no_claim(lottery: WorldModel) -> None:
    scene = draws(1, seed=5)[0].before
    taught = learned(SCHEMA, draws(300))  # the same model, but nobody looked back
    said, plain = lottery.predict_one(scene)["self", "x"], taught.predict_one(scene)["self", "x"]
    assert (said.outcome, plain.outcome) == (Outcome.UNEXPLAINED, Outcome.PREDICTED)
    assert said.value in (0.0, 3.0, 7.0)
    assert said.mode and not said.ok and said.informed


def test_many_at_once_are_told_the_same(lottery: WorldModel) -> None:
    scenes = [step.before for step in draws(20, seed=6)]
    batch = lottery.predict_batch(scenes[0].layout, np.array([s.vector for s in scenes]))
    single = [lottery.predict_one(s) for s in scenes]
    assert batch.vectors.tolist() == [s.scene.vector.tolist() for s in single]
    assert batch.modes[:, 0].tolist() == [s.parts[0].mode for s in single]
    assert [OUTCOMES[k] for k in batch.outcomes[:, 0]] == [s.parts[0].outcome for s in single]
    assert set(batch.outcomes[:, 0].tolist()) == {OUTCOMES.index(Outcome.UNEXPLAINED)}


def test_the_report_says_so_in_a_sentence(lottery: WorldModel) -> None:
    known = hindsight(lottery)
    doubt = (
        "unexplained; its modes cover the examples, but nothing tells which of them holds when: "
        f"{known.wrong} of the latest {known.spoken} predictions were wrong"
    )
    (advice,) = lottery.advice()
    assert str(advice) == f"{doubt}; no library of features that was tried explains it"
    assert (advice.wrong, advice.spoken) == (known.wrong, known.spoken)
    assert f"advice: {doubt}" in lottery.describe(details=True)
    assert f"outcome   {Outcome.UNEXPLAINED.value}" in lottery.explain(draws(1)[0].before)


def test_whoever_is_only_taught_is_not_evaluated(tmp_path: Path) -> None:
    model = learned(SCHEMA, draws(300))
    assert not model.property_model("self", "x").unexplained
    assert model.advice() == ()
    model.save(tmp_path / "taught.json")
    assert "hindsight" not in json.loads((tmp_path / "taught.json").read_bytes())["body"]


def test_what_was_learned_is_the_same_whether_evaluated_or_not() -> None:
    steps = draws(120)
    assert watched(WorldModel(SCHEMA), steps).to_json(history=True) == _asked(steps).to_json(history=True)


def _asked(steps: list[Transition]) -> WorldModel:
    model = WorldModel(SCHEMA)
    for step in steps:
        model.predict_one(step.before)
        model.learn_one(step)
    return model


def test_right_predictions_make_up_for_wrong_ones(lottery: WorldModel) -> None:
    model = copy.deepcopy(lottery)
    law = pushes(1, seed=3)[0]
    said = model.predict_one(law.before)
    (part,) = said.parts
    right = part.audit.values[OWN] - part.value  # what the mode that won says, whoever gives the value
    for _ in range(RECENT):
        model.look_back(said, {("self", "x"): right})
    assert not model.property_model("self", "x").unexplained
    assert model.predict_one(law.before)["self", "x"].outcome is Outcome.PREDICTED
    assert model.advice() == ()


def either(n: int, seed: int, *, told: bool) -> list[Transition]:
    """Two laws; which of them holds the state tells, or nothing."""
    rng = np.random.default_rng(seed)
    toss = iter(rng.random(n).tolist())
    return transitions(
        SCHEMA,
        lambda s, u: [0.5 * s[0] + u[0] if (s[0] > 0.0 if told else next(toss) > 0.5) else s[0] - 1.0],
        rng.normal(size=(n, 1)),
        rng.normal(size=(n, 1)),
    )


def test_what_tells_laws_apart_is_found_however_long_nothing_did() -> None:
    """Though half of what a record remembers came, and regressions are asked: laws may be told apart yet."""
    model = WorldModel(SCHEMA)
    for step in either(700, 0, told=False):
        compare_and_learn(model, step, model.predict_one(step.before))
    known = model.property_model("self", "x")
    assert known.undecided and 2 * known.calibration.trials >= MEMORY
    assert known.standing is Standing.OPEN
    for step in either(900, 1, told=True):
        compare_and_learn(model, step, model.predict_one(step.before))
    fresh = either(200, 2, told=True)
    right = [abs(model.predict_one(s.before).scene["self"]["x"] - s.after["self"]["x"]) < 1e-9 for s in fresh]
    assert np.mean(right) >= 0.95


def test_what_came_true_teaches_little_while_something_is_looked_for() -> None:
    """Of many properties some wait for their turn at any time: all of them would be learned from in every step."""
    model = WorldModel(SCHEMA)
    for step in either(300, 1, told=True):
        compare_and_learn(model, step, model.predict_one(step.before))
    known = model.property_model("self", "x")
    assert not known.waits and known.standing is Standing.SETTLED
    for pair in known.classifier._pairs.values():
        pair.stale = True
    assert known.waits and known.standing is Standing.SETTLED


def test_with_one_mode_there_is_no_choice() -> None:
    model = learned(SCHEMA, pushes(60))
    said = model.predict_one(pushes(1)[0].before)
    for _ in range(RECENT):
        model.look_back(said, {("self", "x"): 1.0})
    assert hindsight(model).undecided
    assert not model.property_model("self", "x").unexplained
    # Its value is doubted all the same.
    assert model.predict_one(pushes(1)[0].before)["self", "x"].outcome is Outcome.UNSURE


# ---------------------------------------------------------------------- what counts as wrong
def test_a_law_is_right() -> None:
    model = watched(WorldModel(SCHEMA), pushes(200))
    assert hindsight(model).spoken > 150
    assert hindsight(model).wrong == 0
    assert not model.property_model("self", "x").unexplained


def test_noise_is_not_wrong() -> None:
    rng = np.random.default_rng(0)
    noise = (0.05 * rng.normal(size=600)).tolist()
    steps = transitions(
        SCHEMA,
        lambda s, u: [0.9 * s[0] + u[0] + noise.pop()],
        rng.normal(size=(600, 1)),
        rng.normal(size=(600, 1)),
    )
    model = watched(WorldModel(SCHEMA), steps)
    assert hindsight(model).spoken > 150
    assert hindsight(model).wrong <= 0.02 * hindsight(model).spoken


def test_rounding_is_not_wrong() -> None:
    model = learned(SCHEMA, pushes(60))
    said = model.predict_one(pushes(1)[0].before)
    for residual in (0.9e-6, 1.1e-6):
        model.look_back(said, {("self", "x"): residual}, 1e-6)
    assert hindsight(model).to_json()["steps"] == [[1, 0], [1, 1]]


def test_fallback_values_and_what_vanished_are_not_evaluated() -> None:
    model = learned(SCHEMA, pushes(60))
    scene = model.predict_one(pushes(1)[0].before).scene
    model.look_back(_saying(scene, Prediction("self", "x", 1.0, Outcome.OUTSIDE)), {("self", "x"): 5.0})
    model.look_back(_saying(scene, Prediction("self", "x", 1.0, Outcome.PREDICTED, 1)), {})
    assert len(hindsight(model)) == 0


def _saying(scene: Scene, part: Prediction) -> ScenePrediction:
    return ScenePrediction(scene, (part,))


def test_who_rests_on_a_wrong_value_is_not_to_blame() -> None:
    schema = schema_of(("x", "v"), ("a",))
    rng = np.random.default_rng(0)
    steps, at = [], np.array([0.0, 0.0])
    for push in rng.normal(size=(200, 1)):
        step = transitions(schema, lambda s, u: [s[0] + s[1] + u[0], s[1] + u[0]], at[None], push[None])
        steps += step
        at = step[0].after["self"].values
    model = learned(schema, steps)
    assert model.property_model("self", "x").needs == {("self", "v")}
    said = model.predict_one(steps[0].before)
    model.look_back(said, {("self", "v"): 0.5, ("self", "x"): 0.5})
    model.look_back(said, {("self", "v"): 0.0, ("self", "x"): 0.5})
    assert hindsight(model, "v").to_json()["steps"] == [[1, 1], [1, 0]]
    assert hindsight(model, "x").to_json()["steps"] == [[1, 1]]


# ---------------------------------------------------------------------- files, merging
@pytest.mark.parametrize("history", [False, True])
def test_a_file_knows_it(lottery: WorldModel, tmp_path: Path, history: bool) -> None:
    lottery.save(tmp_path / "a", history=history)
    again = WorldModel.load(tmp_path / "a")
    again.save(tmp_path / "b", history=history)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert hindsight(again).to_json() == hindsight(lottery).to_json()
    assert again.property_model("self", "x").unexplained
    assert "its modes cover the examples" in again.describe(details=True)
    assert again.predict_one(draws(1)[0].before)["self", "x"].outcome is Outcome.UNEXPLAINED


def test_merged_models_know_what_either_knew(lottery: WorldModel) -> None:
    model = watched(WorldModel(SCHEMA), draws(150, seed=2))
    expected = hindsight(model).united(hindsight(lottery))
    model.merge(lottery)
    assert hindsight(model).to_json() == expected.to_json()
