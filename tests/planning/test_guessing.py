"""Guesses where a model abstains, by hand: a law whose roles nobody plays, without the terms of other bodies."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
from numpy.typing import NDArray

from relgym.clustering.mode import Mode, Role
from relgym.model.predicting.prediction import OUTCOMES, BatchPrediction, Outcome
from relgym.model.target.limits import Limits
from relgym.planning.guessing import Guessing
from relgym.scene.objects import SceneLayout, Target

PUSHED = (
    Role("truck", (("vx", 1.0),)),
    Role("action", (("force", 0.025),)),
    Role("box", (("friction", -5.0),)),  # of the box beneath: nobody
)
PARTS = (("truck", "vx"), ("goal", "ahead"))


class Abstainer:
    """Says nothing of the truck's speed, which therefore stays as it is; the goal comes nearer by it.

    Attributes
    ----------
    outcome
        Of the speed.
    known_above
        Speeds from which on it does say something: that the truck stops.
    """

    def __init__(self, outcome: Outcome = Outcome.NO_ROLES, known_above: float = np.inf) -> None:
        self.outcome, self.known_above, self.asked = outcome, known_above, 0
        self.modes: dict[str, tuple[Mode, ...]] = {
            "vx": (
                Mode(1, Target("truck", "vx"), PUSHED[:1], 7.0, examples=10),
                Mode(2, Target("truck", "vx"), PUSHED, 1.0, examples=50),
                Mode(3, Target("truck", "vx"), (Role("truck", ()),), 0.0, examples=99),
            ),
            "ahead": (
                Mode(1, Target("goal", "ahead"), (Role("goal", (("ahead", 1.0),)),), 0.0, examples=60),
            ),
        }

    def property_model(self, type_name: str, prop: str) -> Any:
        limits = Limits(low=3, least=0.0) if prop == "vx" else Limits()
        return SimpleNamespace(modes=self.modes[prop], limits=limits)

    def predict_batch(self, layout: SceneLayout, vectors: NDArray[np.float64]) -> BatchPrediction:
        self.asked += 1
        after = vectors.copy()
        speed, ahead = (layout.column(layout.index(name), prop) for name, prop in PARTS)
        outcomes = np.full((len(vectors), 2), OUTCOMES.index(Outcome.DEPENDS), dtype=np.int8)
        outcomes[:, 0] = OUTCOMES.index(self.outcome)
        fast = vectors[:, speed] >= self.known_above
        outcomes[fast, 0], after[fast, speed] = OUTCOMES.index(Outcome.PREDICTED), 0.0
        after[:, ahead] -= after[:, speed]
        count = len(vectors)
        return BatchPrediction(
            layout, after, PARTS, np.zeros((count, 2), dtype=np.int64), outcomes, np.zeros((count, 2))
        )


@pytest.fixture(scope="module")
def layout() -> SceneLayout:
    schema = gym.make("relgym/TruckPush-v0", n_boxes=1).get_wrapper_attr("schema")
    return cast(SceneLayout, schema.layout([name for name, _ in schema.objects]))


def scenes(layout: SceneLayout, *rows: tuple[float, float, float]) -> NDArray[np.float64]:
    """Scenes of (speed, way to the goal, force), everything else 0."""
    found = np.zeros((len(rows), layout.width))
    for k, column in enumerate(columns(layout)):
        found[:, column] = [row[k] for row in rows]
    return found


def columns(layout: SceneLayout) -> list[int]:
    return [layout.column(layout.index(name), prop) for name, prop in (*PARTS, ("action", "force"))]


def told(model: Abstainer, layout: SceneLayout, *rows: tuple[float, float, float]) -> list[list[float]]:
    found = Guessing(cast(Any, model)).predict_batch(layout, scenes(layout, *rows))
    assert (found.outcomes[:, 1] == OUTCOMES.index(Outcome.DEPENDS)).all()  # a guess is no claim
    values: list[list[float]] = found.vectors[:, columns(layout)[:2]].tolist()
    return values


@pytest.mark.parametrize("outcome", [Outcome.NO_ROLES, Outcome.OUTSIDE])
def test_the_law_that_most_follow_holds_without_other_bodies(outcome: Outcome, layout: SceneLayout) -> None:
    # v' = v + 0.025 F, neither with the other law's 7 nor with this one's 1, which belongs to the rest.
    assert told(Abstainer(outcome), layout, (2.0, 20.0, 40.0), (0.0, 9.0, 80.0)) == [[3.0, 17.0], [2.0, 7.0]]


def test_a_guess_ends_at_the_limits(layout: SceneLayout) -> None:
    assert told(Abstainer(), layout, (1.0, 20.0, -80.0)) == [[0.0, 20.0]]


def test_what_was_wrong_too_often_stays_as_it_is(layout: SceneLayout) -> None:
    model = Abstainer(Outcome.UNSURE)
    assert told(model, layout, (2.0, 20.0, 40.0)) == [[2.0, 18.0]]
    assert model.asked == 1


def test_where_the_next_value_is_known_to_change_it_was_no_next_value(layout: SceneLayout) -> None:
    model = Abstainer(known_above=3.0)
    assert told(model, layout, (2.0, 20.0, 40.0), (2.0, 20.0, 20.0)) == [[2.0, 18.0], [2.5, 17.5]]
    assert model.asked == 2


def test_a_law_that_nothing_changes_is_no_guess(layout: SceneLayout) -> None:
    model = Abstainer()
    model.modes["vx"] = (Mode(1, Target("truck", "vx"), (PUSHED[0], PUSHED[2]), 0.0, examples=9),)
    assert told(model, layout, (2.0, 20.0, 40.0)) == [[2.0, 18.0]]
    assert model.asked == 1
