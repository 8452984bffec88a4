"""Counts of wrong predictions, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from relgym.errors import ConfigError
from relgym.model.predicting.prediction import Outcome, Prediction, ScenePrediction
from relgym.model.predicting.prequential import Outcomes, Prequential, compared
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


def outcomes(*rows: tuple[tuple[str, str], float, float, bool, float]) -> Outcomes:
    """Of (part, residual, change, claimed, spread)."""
    parts, off, moved, claimed, spreads = zip(*rows, strict=True)
    return Outcomes(parts, off, moved, claimed, spreads)


def counted(*steps: Outcomes, window: int = 10) -> Prequential:
    count = Prequential(window)
    for told in steps:
        count.count(told.parts, [], told)
    return count


def test_error_size_is_in_units_of_how_far_things_move() -> None:
    count = counted(
        outcomes((A, 0.3, 1.0, True, 0.1), (B, 0.0, 4.0, True, 0.1)),
        outcomes((A, 0.4, -2.0, True, 0.1), (B, 1.0, 3.0, True, 0.1)),
    )
    # A: (0.09 + 0.16) / (1 + 4) = 0.05; B: 1 / 25 = 0.04; root of their mean.
    assert count.nrmse == pytest.approx(math.sqrt(0.045))
    still = outcomes((A, 2.0, 2.0, False, math.nan), (B, -1.0, -1.0, False, math.nan))
    assert counted(still).nrmse == 1.0  # what "nothing changes" scores


def test_what_never_moves_is_right_or_wrong_as_a_whole() -> None:
    assert counted(outcomes((A, 0.0, 0.0, True, 0.0))).nrmse == 0.0
    assert counted(outcomes((A, 0.5, 0.0, True, 0.0))).nrmse == 1.0


def test_coverage_is_the_share_that_the_model_claims() -> None:
    count = counted(
        outcomes((A, 0.0, 1.0, True, 0.0), (B, 0.0, 1.0, False, 0.0)), outcomes((A, 0.0, 1.0, True, 0.0))
    )
    assert count.coverage == pytest.approx(2 / 3)


def test_calibration_is_the_share_within_two_stated_deviations() -> None:
    count = counted(
        outcomes((A, 0.19, 1.0, True, 0.1), (B, 0.21, 1.0, True, 0.1)),
        outcomes((A, 9.0, 1.0, False, 0.1), (B, 9.0, 1.0, True, math.nan)),  # neither claims a spread
        outcomes((A, 1e-10, 1.0, True, 0.0)),  # rounding, of a model that states none
    )
    assert count.calibration == pytest.approx(2 / 3)


def test_rightly_stated_spreads_are_calibrated() -> None:
    rng = np.random.default_rng(0)
    steps = [outcomes((A, float(rng.normal(0.0, 0.5)), 1.0, True, 0.5)) for _ in range(4000)]
    assert counted(*steps, window=4000).calibration == pytest.approx(0.954, abs=0.01)


def test_only_the_latest_steps_count_and_before_any_nothing_is_known() -> None:
    none = Prequential()
    assert math.isnan(none.nrmse) and math.isnan(none.coverage) and math.isnan(none.calibration)
    bad, good = outcomes((A, 1.0, 1.0, False, math.nan)), outcomes((A, 0.0, 1.0, True, 0.0))
    count = counted(bad, good, good, window=2)
    assert (count.nrmse, count.coverage, count.calibration) == (0.0, 1.0, 1.0)


def test_outcomes_are_read_from_a_prediction() -> None:
    wheel = ObjectType("wheel", ("turn",), angles=("turn",))
    schema = SceneSchema((wheel,), (("wheel", "wheel"),))
    before, after = schema.scene({"wheel": [3.0]}), schema.scene({"wheel": [-3.0]})
    said = ScenePrediction(before, (Prediction("wheel", "turn", 3.1, Outcome.PREDICTED, spread=0.2),))
    told = Outcomes.of(said, before, compared(said, after)[0])
    turned = 2 * math.pi - 6.0
    np.testing.assert_allclose(told.changes, [turned], atol=1e-12)
    np.testing.assert_allclose(told.residuals, [turned - 0.1], atol=1e-12)
    assert (told.parts, told.claimed, told.spreads) == ((("wheel", "turn"),), (True,), (0.2,))
