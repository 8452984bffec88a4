"""One-step errors in any env: worked by hand."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from relgym.experiments.scores import score
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Target, Transition
from relgym.scene.schema import SceneSchema

BALL = ObjectType("ball", ("v",), optional=True)
SCHEMA = SceneSchema((BALL,), (("a", "ball"), ("b", "ball")), targets=(Target("ball", "v"),))
DIAL = SceneSchema(
    (ObjectType("dial", ("th",), angles=("th",)),), (("d", "dial"),), targets=(Target("dial", "th"),)
)


def step(now: float, then: float, name: str = "a") -> Transition:
    return Transition(SCHEMA.scene({name: [now]}), SCHEMA.scene({name: [then]}))


@pytest.fixture(scope="module")
def halving() -> WorldModel:
    """It has seen v' = 0.5 v, and nothing else."""
    model = WorldModel(SCHEMA)
    for k in range(15):
        model.learn_one(step(8.0 * 0.7**k, 4.0 * 0.7**k))
    return model


def test_rmse_r2_and_the_number_of_wrong_ones(halving: WorldModel) -> None:
    found = score(halving, [step(4.0, 2.0), step(4.0, 3.0)])
    assert (found.steps, found.right) == (2, 1)
    target = found["ball.v"]
    assert (target.predictions, target.wrong, target.missing) == (2, 1, 0)
    assert target.rmse == pytest.approx(math.sqrt(0.5))
    assert target.largest == pytest.approx(1.0)
    # The changes are -2 and -1: squares about their mean sum to a half, those of the errors to 1.
    assert target.r2 == pytest.approx(-1.0)
    assert "Right on 1 of 2 fresh steps." in str(found)


def test_what_rounding_explains_is_not_wrong(halving: WorldModel) -> None:
    assert score(halving, [step(4.0, 2.0 + 1e-6)])["ball.v"].wrong == 1
    assert score(halving, [step(4.0, 2.0 + 1e-6)], precision=1e-6)["ball.v"].wrong == 0


def test_objects_count_one_by_one_and_those_that_are_gone_not_at_all(halving: WorldModel) -> None:
    both = SCHEMA.scene({"a": [4.0], "b": [6.0]})
    found = score(
        halving,
        [
            Transition(both, SCHEMA.scene({"a": [2.0], "b": [3.0]})),
            Transition(both, SCHEMA.scene({"a": [2.0]})),
            step(2.0, 1.0, "b"),
        ],
    )
    assert (found.steps, found.right) == (3, 3)
    assert (found["ball.v"].predictions, found["ball.v"].wrong) == (4, 0)


def test_a_step_is_right_if_all_of_it_is(halving: WorldModel) -> None:
    both, after = SCHEMA.scene({"a": [4.0], "b": [6.0]}), SCHEMA.scene({"a": [2.0], "b": [9.0]})
    found = score(halving, [Transition(both, after)])
    assert (found.right, found["ball.v"].wrong) == (0, 1)


def test_what_was_not_predicted_is_wrong_and_has_no_error() -> None:
    found = score(WorldModel(SCHEMA), [step(4.0, 2.0), step(2.0, 1.0)])
    target = found["ball.v"]
    assert (target.wrong, target.missing, found.right) == (2, 2, 0)
    assert math.isnan(target.rmse) and math.isnan(target.r2) and math.isnan(target.largest)


def test_what_never_changes_has_no_r2(halving: WorldModel) -> None:
    assert math.isnan(score(halving, [step(0.0, 0.0), step(0.0, 0.0)])["ball.v"].r2)


def test_angles_go_round() -> None:
    model = WorldModel(DIAL)
    angles = np.remainder(np.arange(0.0, 60.0) * 0.3 + np.pi, 2.0 * np.pi) - np.pi
    steps = [
        Transition(DIAL.scene({"d": [now]}), DIAL.scene({"d": [then]}))
        for now, then in pairwise(angles.tolist())
    ]
    for transition in steps:
        model.learn_one(transition)
    found = score(model, steps)["dial.th"]
    assert found.wrong == 0 and found.rmse < 1e-12


def test_nothing_to_predict_is_said() -> None:
    plain = SceneSchema((BALL,), (("a", "ball"),))
    scene = plain.scene({"a": [1.0]})
    assert "nothing has been learned yet" in str(score(WorldModel(plain), [Transition(scene, scene)]))
