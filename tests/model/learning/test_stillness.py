"""What stood still before it first changed is remembered as that."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from points import schema_of, transitions

from relgym.model.learning.fitting import compare_and_learn
from relgym.model.learning.stillness import RECALLED
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition

SCHEMA = schema_of(("v", "flag"), ("u",))
STILL = 1_500


def steps(seed: int, flags: Iterator[float] | list[float], count: int) -> list[Transition]:
    """A pushed point, and a flag that is told."""
    rng, told = np.random.default_rng(seed), iter(flags)
    acts = rng.uniform(-1.0, 1.0, (count, 1))
    state, rows = np.array([1.0, next(told)]), []
    for u in acts[:, 0].tolist():
        rows.append(state)
        state = np.array([0.9 * state[0] + u, next(told)])
    after = iter([*rows[1:], state])
    return transitions(SCHEMA, lambda s, a: next(after), np.array(rows), acts)


def taught(course: list[Transition]) -> WorldModel:
    model = WorldModel(SCHEMA)
    for step in course:
        compare_and_learn(model, step, model.predict_one(step.before))
    return model


def test_a_flag_that_was_always_down_is_no_flag_that_is_always_up() -> None:
    rare = [0.0] * (STILL + 1) + [1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    model = taught(steps(0, rare, len(rare) - 1))
    modes = {mode.formula(): mode.examples for mode in model.modes("self", "flag")}
    assert modes["flag' = flag"] > RECALLED
    record = model.property_model("self", "flag").calibration
    assert record.trials > 100  # that nothing changes was right
    fresh = steps(1, [0.0] * 101, 100)
    assert np.mean([model.predict_one(step.before)["self", "flag"].value for step in fresh]) < 0.5


@pytest.mark.parametrize(("still", "recalled"), [(500, 0), (1_500, RECALLED)])
def test_what_was_still_for_long_is_recalled(still: int, recalled: int) -> None:
    more = 40
    model = taught(steps(2, [0.5] * (still + 1) + [2.0] * more, still + more))
    part = model.property_model("self", "flag")
    assert len(part.clusterer.labels) == recalled + more
    assert sum(part.clusterer.y == 0.5) == recalled


def test_nothing_is_recalled_where_nobody_remembers() -> None:
    schema = schema_of(("flag",), ("u",))
    rows = np.array([[0.0]] * 50 + [[1.0]] * 10)
    after = iter(np.concatenate([rows[1:], [[1.0]]]))
    course = transitions(schema, lambda s, a: next(after), rows, np.zeros((60, 1)))
    model = WorldModel(schema)
    for step in course:
        model.learn_one(step)
    assert model.property_model("self", "flag").clusterer.seen == 11  # from its first change on


def test_what_is_remembered_is_what_was_seen() -> None:
    model = taught(steps(3, [0.0] * 101, 100))
    part = model.property_model("self", "v")
    table = model._parts.tables["self"]
    for slot in range(len(part.classifier.exemplars)):
        example, row = part.remembered(slot)
        assert example.own[:2].tolist() == table.x[row, :2].tolist()
