"""Counts of wrong predictions, by hand."""

from __future__ import annotations

import math

import pytest

from relgym.errors import ConfigError
from relgym.model.prediction import Outcome, Prediction, ScenePrediction
from relgym.model.prequential import Prequential, compared
from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema

A, B = ("ball", "vx"), ("ball", "vy")
BALL = ObjectType("ball", ("vx", "vy"), optional=True)
SCHEMA = SceneSchema((BALL,), (("ball", "ball"), ("other", "ball")))


def test_totals_and_the_latest_steps() -> None:
    count = Prequential(window=3)
    assert math.isnan(count.recent)
    for wrong in ([A, B], [A], [], [B], []):
        count.count([A, B], wrong)
    assert count.steps == 5
    assert count.predictions == {A: 5, B: 5}
    assert count.wrong == {A: 2, B: 2}
    assert count.recent_wrong == {A: 0, B: 1}
    assert count.recent == pytest.approx(1 / 3)
    assert "ball.vx            5      2              0" in str(count)


def test_a_window_has_at_least_one_step() -> None:
    with pytest.raises(ConfigError, match="window=0: expected a whole number"):
        Prequential(window=0)


@pytest.mark.parametrize(
    ("said", "outcome", "wrong"),
    [
        (1.0, Outcome.PREDICTED, False),
        (1.0 + 0.9e-9, Outcome.PREDICTED, False),
        (1.0 - 1.1e-9, Outcome.PREDICTED, True),
        (1.0, Outcome.OUTSIDE, True),  # right by luck
    ],
)
def test_wrong_is_beyond_the_tolerance_or_said_by_no_mode(said: float, outcome: Outcome, wrong: bool) -> None:
    after = SCHEMA.scene({"ball": [1.0, 0.0], "other": [0.0, 0.0]})
    prediction = ScenePrediction(after, (Prediction("ball", "vx", said, outcome),))
    residuals, found = compared(prediction, after)
    assert residuals == {A: 1.0 - said}
    assert found == ((A,) if wrong else ())


def test_objects_that_vanished_are_not_compared() -> None:
    before = SCHEMA.scene({"ball": [1.0, 0.0], "other": [2.0, 0.0]})
    after = SCHEMA.scene({"other": [3.0, 0.0]})  # what is left begins elsewhere in the vector
    parts = (
        Prediction("ball", "vx", 1.0, Outcome.PREDICTED),
        Prediction("other", "vx", 3.0, Outcome.PREDICTED),
    )
    assert compared(ScenePrediction(before, parts), after) == ({("other", "vx"): 0.0}, ())
    assert compared(None, after) == ({}, ())


def test_angles_are_compared_around_the_circle() -> None:
    wheel = ObjectType("wheel", ("turn",), angles=("turn",))
    schema = SceneSchema((wheel,), (("wheel", "wheel"),))
    said = Prediction("wheel", "turn", 3.1, Outcome.PREDICTED)
    scene = schema.scene({"wheel": [3.1]})
    residuals, wrong = compared(ScenePrediction(scene, (said,)), schema.scene({"wheel": [-3.1]}))
    assert residuals["wheel", "turn"] == pytest.approx(2 * math.pi - 6.2, abs=1e-12)
    assert wrong
    again = compared(ScenePrediction(scene, (said,)), schema.scene({"wheel": [3.1 - 2 * math.pi]}))
    assert again == ({("wheel", "turn"): pytest.approx(0.0, abs=1e-12)}, ())


def test_errors_below_the_precision_are_not_wrong() -> None:
    after = SCHEMA.scene({"ball": [100.0, 0.0]})
    prediction = ScenePrediction(after, (Prediction("ball", "vx", 100.00001, Outcome.PREDICTED),))
    assert compared(prediction, after)[1] == (A,)
    assert compared(prediction, after, 1e-6)[1] == ()
