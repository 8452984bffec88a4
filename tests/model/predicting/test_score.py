"""Scores by hand, and beside scikit-learn's."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relgym.model.predicting.prediction import Outcome, Prediction, ScenePrediction
from relgym.model.predicting.score import Score, TargetScore
from relgym.scene.objects import ObjectType, Transition
from relgym.scene.schema import SceneSchema

BALL = ObjectType("ball", ("v", "turn", "hue"), optional=True, angles=("turn",), exogenous=("hue",))
SCHEMA = SceneSchema((BALL,), (("a", "ball"), ("b", "ball")))


def step(
    was: dict[str, list[float]], came: dict[str, list[float]], said: dict[str, tuple[str, float, bool]]
) -> tuple[ScenePrediction, Transition]:
    before = SCHEMA.scene(was)
    parts = tuple(
        Prediction(name, prop, value, Outcome.PREDICTED if ok else Outcome.UNEXPLAINED)
        for name, (prop, value, ok) in said.items()
    )
    scene = before.replace({(p.object, p.property): p.value for p in parts})
    return ScenePrediction(scene, parts), Transition(before, SCHEMA.scene(came))


def test_by_hand() -> None:
    score = Score()
    score.add(*step({"a": [1.0, 0, 0]}, {"a": [2.0, 0, 0]}, {"a": ("v", 2.0, True)}))
    score.add(*step({"a": [2.0, 0, 0]}, {"a": [4.0, 0, 0]}, {"a": ("v", 3.0, True)}))
    score.add(*step({"a": [4.0, 0, 0]}, {"a": [6.0, 0, 0]}, {"a": ("v", 6.0, False)}))
    target = score.targets["ball.v"]
    assert (score.transitions, score.exact, target.count) == (3, 1, 3)
    assert (target.right, target.abstained) == (1 / 3, 1 / 3)  # what is not claimed is not right
    assert target.rmse == pytest.approx(math.sqrt(1 / 3))
    assert target.r2 == pytest.approx(1 - 1 / 8)
    assert target.skill == pytest.approx(1 - 1 / 9)
    assert (score.right, score.abstained, score.r2) == (1 / 3, 1 / 3, target.r2)


def test_objects_that_vanish_are_not_compared() -> None:
    score = Score()
    said = {"a": ("v", 1.0, True), "b": ("v", 7.0, True)}
    score.add(*step({"a": [1.0, 0, 0], "b": [2.0, 0, 0]}, {"a": [1.0, 0, 0]}, said))
    assert (score.targets["ball.v"].count, score.exact) == (1, 1)


def test_angles_go_the_short_way_round() -> None:
    score = Score()
    score.add(*step({"a": [0, 3.0, 0]}, {"a": [0, -3.0, 0]}, {"a": ("turn", math.pi, True)}))
    target = score.targets["ball.turn"]
    assert target.rmse == pytest.approx(math.pi - 3.0)
    assert target.skill == pytest.approx(0.75)


def test_what_changed_although_no_target_is_told() -> None:
    score = Score()
    score.add(*step({"a": [1.0, 0.5, 1]}, {"a": [1.0, 0.7, 9]}, {"a": ("v", 1.0, True)}))
    assert score.missed == {"ball.turn": 1}  # hue is exogenous
    assert "ball.turn changed 1 times" in str(score)


def test_rounding_counts_as_right() -> None:
    given = step({"a": [1000.0, 0, 0]}, {"a": [2000.0, 0, 0]}, {"a": ("v", 2000.0005, True)})
    for precision, right in ((0.0, 0.0), (5e-7, 1.0)):
        score = Score()
        score.add(*given, precision)
        assert score.right == right


def test_nothing_is_nan() -> None:
    score = Score()
    assert all(
        math.isnan(x) for x in (score.right, score.abstained, score.r2, TargetScore().rmse, TargetScore().r2)
    )
    assert "0 of 0 steps" in str(score)


@settings(max_examples=50, deadline=None)
@given(st.integers(2, 40), st.integers(0, 10_000), st.sampled_from([0.0, 1e6]), st.integers(1, 39))
def test_as_scikit_learn_and_however_it_is_cut(count: int, seed: int, shift: float, cut: int) -> None:
    metrics: Any = pytest.importorskip("sklearn.metrics")
    rng = np.random.default_rng(seed)
    was, came, said = rng.normal(size=(3, count)) + shift
    claimed, right = rng.random((2, count)) < 0.7
    whole, parts = TargetScore(), TargetScore()
    whole.add(was, came, said, claimed, right, angle=False)
    for piece in (slice(None, cut), slice(cut, None)):
        parts.add(*(x[piece] for x in (was, came, said, claimed, right)), angle=False)
    assert whole.r2 == pytest.approx(metrics.r2_score(came, said), rel=1e-6)
    assert whole.rmse == pytest.approx(metrics.root_mean_squared_error(came, said), rel=1e-9)
    for name in ("count", "right", "abstained", "rmse", "r2", "skill"):
        assert getattr(parts, name) == pytest.approx(getattr(whole, name), rel=1e-6)


def test_a_constant_is_explained_if_it_is_hit() -> None:
    ones = np.ones(3)
    for said, r2 in ((ones, 1.0), (2 * ones, 0.0)):
        target = TargetScore()
        target.add(ones, ones, said, ones > 0, said == ones, angle=False)
        assert (target.r2, target.skill) == (r2, r2)
