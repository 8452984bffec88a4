"""Noise that depends on the action: measured, reported, and part of predictions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from points import learned, schema_of, transitions

from relgym.model.reports.spread_text import labels, spread_text
from relgym.model.target.spread import FEW_VALUES, Spread, Spreads, _by_action
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, ObjectType, Scene, Transition
from relgym.scene.schema import SceneSchema

SCHEMA = schema_of(("v",), ("a",))


@pytest.fixture(scope="module")
def engine() -> WorldModel:
    """An engine that fires (a = 1) pushes with ten times the scatter of one that rests."""
    rng = np.random.default_rng(0)
    noise = iter(rng.normal(size=800))
    starts, actions = rng.normal(size=(800, 1)), rng.integers(0, 2, (800, 1)).astype(float)
    steps = transitions(
        SCHEMA, lambda s, u: [0.9 * s[0] + u[0] + (0.01 if u[0] else 0.001) * next(noise)], starts, actions
    )
    return learned(SCHEMA, steps)


def at(engine: WorldModel, action: float) -> Scene:
    return engine.schema.scene({"self": [0.5], "action": [action]})


def test_the_spread_of_a_prediction_is_that_of_its_action(engine: WorldModel) -> None:
    quiet, loud = (engine.predict_one(at(engine, a))["self", "v"].spread for a in (0.0, 1.0))
    assert loud == pytest.approx(0.01, rel=0.25)
    assert quiet == pytest.approx(0.001, rel=0.25)


def test_an_action_never_seen_has_the_spread_of_the_mode(engine: WorldModel) -> None:
    whole = engine.predict_one(at(engine, 0.5))["self", "v"].spread
    assert 0.001 < whole < 0.01


def test_the_report_tells_them_apart(engine: WorldModel) -> None:
    text = engine.describe(details=True)
    assert "after 0" in text
    assert "after 1" in text


def test_spreads_survive_being_written_down() -> None:
    spreads = Spreads(
        {1: Spread(0.1, {(0.0,): 0.01, (1.0,): 0.2}), 2: Spread(0.5), 4: Spread(0.3, pooled=True)}
    )
    again = Spreads.from_json(spreads.to_json())
    assert again.by_mode == spreads.by_mode
    assert again.of(1, (1.0,)) == 0.2
    assert again.of(2, (1.0,)) == 0.5
    assert math.isnan(again.of(3, ()))


# ---------------------------------------------------------------------- many choices, other layouts
def choices(count: int, noisy: int, n: int) -> WorldModel:
    """One of so many choices scatters fifty times as much as the others; the choice is a number."""
    rng = np.random.default_rng(0)
    noise = iter(rng.normal(size=n))
    starts, actions = rng.normal(size=(n, 1)), rng.integers(0, count, (n, 1)).astype(float)
    return learned(
        SCHEMA,
        transitions(
            SCHEMA,
            lambda s, u: [0.9 * s[0] + 0.1 * u[0] + (0.05 if u[0] == noisy else 0.001) * next(noise)],
            starts,
            actions,
        ),
    )


def test_nine_choices_are_told_apart() -> None:
    # Most of what follows the noisy one is beyond the tolerance that suits the others, and no mode's example.
    model = choices(9, 1, 900)
    (mode,) = model.modes("self", "v")
    known = model.property_model("self", "v").spreads.by_mode[mode.id].by_action
    assert sorted(known) == [(float(k),) for k in range(9)]
    assert known[1.0,] == pytest.approx(0.05, rel=0.3)
    assert max(s for a, s in known.items() if a != (1.0,)) < 0.003
    text = model.describe(details=True)
    assert "after 1; ± 0.00" in text
    assert "after any other" in text


def test_what_is_too_much_to_be_told_apart_is_called_so() -> None:
    error = np.random.default_rng(0).normal(size=650)
    many = np.repeat(np.arange(FEW_VALUES + 1.0), 10)[:, None]
    few = many % FEW_VALUES
    assert _by_action(error[: len(many)], many) == ({}, True)
    found, pooled = _by_action(error[: len(few)], few)
    assert list(found) == [(0.0,)]  # of the others there are fewer than `ENOUGH`
    assert found[0.0,] == pytest.approx(np.sqrt(np.square(error[: len(few)][few[:, 0] == 0.0]).mean()))
    assert not pooled
    assert _by_action(error, error[:, None]) == ({}, False)  # a number, no choice


def test_objects_that_come_and_go_do_no_harm() -> None:
    kind = ObjectType("self", ("v",))
    guest = ObjectType("guest", ("w",), optional=True)
    action = ObjectType(ACTION, ("a",))
    types = (kind, guest, action)
    schema = SceneSchema(types, tuple((t.name, t.name) for t in types))
    rng = np.random.default_rng(0)
    model = WorldModel(schema)
    for k in range(600):
        v, a = float(rng.normal()), float(rng.integers(0, 2))
        rest = {"guest": [1.0]} if k % 2 else {}
        after = 0.9 * v + a + (0.01 if a else 0.001) * rng.normal()
        scenes = ({"self": [x], **rest, ACTION: [a]} for x in (v, after))
        model.learn_one(Transition(*map(schema.scene, scenes)))
    for rest in ({}, {"guest": [1.0]}):
        quiet, loud = (
            model.predict_one(schema.scene({"self": [0.5], **rest, ACTION: [a]}))["self", "v"].spread
            for a in (0.0, 1.0)
        )
        assert loud == pytest.approx(0.01, rel=0.25)
        assert quiet == pytest.approx(0.001, rel=0.25)


# ---------------------------------------------------------------------- in words
def one_hot(count: int) -> list[tuple[float, ...]]:
    return [(float(k), *(float(k == j) for j in range(count))) for k in range(count)]


def test_choices_are_told_by_number_or_name() -> None:
    first, second, third = one_hot(3)
    spread = Spread(0.3, {first: 0.1, second: 0.5, third: 0.1})
    numbered = spread_text(spread, ("a", "a_is_0", "a_is_1", "a_is_2"))
    assert numbered == "± 0.1 after 0; ± 0.5 after 1; ± 0.1 after 2"
    assert spread_text(spread, ("a", "left", "none", "right")) == (
        "± 0.1 after left; ± 0.5 after none; ± 0.1 after right"
    )


def test_two_choices_at_once_are_both_told() -> None:
    names = ("a0", "a1", "a0_is_0", "a0_is_1", "a0_is_2")
    assert labels([(2.0, 1.0, 0.0, 0.0, 1.0)], names) == {(2.0, 1.0, 0.0, 0.0, 1.0): "2, 1"}


def test_switches_are_no_choices() -> None:
    every = [(a, b, c) for a in (0.0, 1.0) for b in (0.0, 1.0) for c in (0.0, 1.0)]
    assert labels(every, ("a0", "a1", "a2"))[0.0, 1.0, 0.0] == "0, 1, 0"


def test_of_many_actions_those_alike_are_told_together() -> None:
    spreads = {(float(k),): 0.05 if k in (1, 7) else 0.001 for k in range(9)}
    assert spread_text(Spread(0.02, spreads), ("a",)) == "± 0.05 after 1 or 7; ± 0.001 after any other"


def test_one_spread_for_all() -> None:
    assert spread_text(Spread(0.5), ()) == "± 0.5"
    assert spread_text(Spread(0.5, {(0.0,): 0.4, (1.0,): 0.6}), ("a",)) == "± 0.5"
    assert spread_text(Spread(0.5, pooled=True), ("a",)) == "± 0.5 over all actions: more than are told apart"
