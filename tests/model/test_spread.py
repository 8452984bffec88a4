"""Noise that depends on the action: measured, reported, and part of predictions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from points import learned, schema_of, transitions

from relgym.model.spread import Spread, Spreads
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene

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
    text = engine.describe()
    assert "after 0" in text
    assert "after 1" in text


def test_spreads_survive_being_written_down() -> None:
    spreads = Spreads({1: Spread(0.1, {(0.0,): 0.01, (1.0,): 0.2}), 2: Spread(0.5)})
    again = Spreads.from_json(spreads.to_json())
    assert again.by_mode == spreads.by_mode
    assert again.of(1, (1.0,)) == 0.2
    assert again.of(2, (1.0,)) == 0.5
    assert math.isnan(again.of(3, ()))
