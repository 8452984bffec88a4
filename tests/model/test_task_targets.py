"""Reward and termination as properties of the bodiless object `task`: functions of what was, was done and followed."""

from __future__ import annotations

import numpy as np
import pytest
from points import formulas, learned, schema_of, transitions

from relgym.model.world_model import WorldModel
from relgym.scene.objects import TASK, Transition

SCHEMA = schema_of(("x", "v"), ("a",), task=("reward", "terminated"))


def walk(n: int, seed: int) -> list[Transition]:
    """Pay for effort; whoever gets beyond 1 is done and paid 100."""
    rng = np.random.default_rng(seed)

    def worth(s: np.ndarray, u: np.ndarray, after: np.ndarray) -> list[float]:
        done = after[0] > 1.0
        return [100.0 * done - 0.1 * u[0] ** 2 if not done else 100.0, float(done)]

    return transitions(
        SCHEMA,
        lambda s, u: [s[0] + 0.5 * (0.9 * s[1] + u[0]), 0.9 * s[1] + u[0]],
        rng.uniform(-1.0, 1.0, (n, 2)),
        rng.uniform(-1.0, 1.0, (n, 1)),
        worth,
    )


@pytest.fixture(scope="module")
def walker() -> WorldModel:
    return learned(SCHEMA, walk(500, 0), features=("squares",))


def test_the_task_comes_last_and_is_given_all_that_follows(walker: WorldModel) -> None:
    ended, paid = walker.targets[-2:]
    assert (ended.type, ended.property) == (TASK, "terminated")
    assert set(ended.given) == {("self", "x"), ("self", "v")}
    assert (paid.type, paid.property) == (TASK, "reward")
    assert set(paid.given) == {*ended.given, (TASK, "terminated")}


def test_what_the_end_is_paid_joins_the_law_of_all_other_steps() -> None:
    # A bonus on top of progress: apart, a handful of ends would need a law of their own.
    rng = np.random.default_rng(3)

    def worth(s: np.ndarray, u: np.ndarray, after: np.ndarray) -> list[float]:
        done = float(after[0] > 1.0)
        return [0.5 * after[0] - 0.1 + 5.0 * done, done]

    schema = schema_of(("x",), ("a",), task=("reward", "terminated"))
    starts = np.concatenate([rng.uniform(-1.0, 0.7, (200, 1)), rng.uniform(0.9, 1.0, (12, 1))])
    actions = rng.uniform(-0.3, 0.3, (212, 1))
    model = learned(schema, transitions(schema, lambda s, u: [s[0] + u[0]], starts, actions, worth))
    (law,) = model.modes(TASK, "reward")
    assert law.formula(4) == "reward' = 5 terminated' + 0.5 self.x' - 0.1"


def test_effort_is_a_square_and_the_end_a_threshold_on_what_follows(walker: WorldModel) -> None:
    modes = [mode.formula(4) for mode in walker.modes(TASK, "reward")]
    assert sorted(modes) == ["reward' = -0.1 action.a^2", "reward' = 100"]
    clauses = str([c.describe() for c in walker.property_model(TASK, "terminated").classifier.classifiers])
    assert "self.x'" in clauses


def test_reward_and_end_of_fresh_steps(walker: WorldModel) -> None:
    wrong = 0
    for t in walk(200, 1):
        predicted = walker.predict_one(t.before)
        assert predicted.ok
        wrong += predicted.scene[TASK].values != pytest.approx(t.after[TASK].values, abs=1e-9)
    assert wrong <= 2


def test_the_world_goes_on_whatever_it_is_worth(walker: WorldModel) -> None:
    assert not any("task" in text for prop in ("x", "v") for text in formulas(walker, prop))
