"""Why dreams are cut short: of several causes the first one in a fixed order, singly and in batches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.envs.dreams.ends import CAUSES, Cause, causes, explained, horizon_reached, parts_of_row
from relgym.model.predicting.prediction import OUTCOMES, BatchPrediction, Outcome
from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema

LAYOUT = SceneSchema((ObjectType("cart", ("x", "v")),), (("cart", "cart"),)).layout()
PARTS = (("cart", "v"), ("cart", "x"))


def prediction(outcomes: list[list[Outcome]], margins: list[list[float]]) -> BatchPrediction:
    n = len(outcomes)
    numbers = np.array([[OUTCOMES.index(o) for o in row] for row in outcomes], dtype=np.int8)
    modes = np.ones((n, 2), dtype=np.int64)
    return BatchPrediction(LAYOUT, np.zeros((n, 2)), PARTS, modes, numbers, np.array(margins), ("world",) * 2)


OK, OUT, NONE = Outcome.PREDICTED, Outcome.OUTSIDE, Outcome.NO_MODE


@pytest.mark.parametrize(
    ("outcomes", "margins", "inside", "cause"),
    [
        ([OK, OK], [9.0, 9.0], True, None),
        ([OK, OK], [9.0, 9.0], False, Cause.LEFT),
        ([OK, OK], [0.9, 9.0], True, Cause.LOW_MARGIN),
        ([OK, OK], [1.0, 9.0], True, None),  # at least 1
        ([OK, OK], [0.9, 9.0], False, Cause.LOW_MARGIN),  # comes before leaving
        ([OK, OUT], [0.9, 0.0], False, Cause.OUTSIDE),  # and what isn't predicted before both
        ([NONE, OUT], [9.0, 9.0], True, Cause.NO_MODE),  # the first one in causal order
        ([OUT, NONE], [9.0, 9.0], True, Cause.OUTSIDE),
        ([OK, Outcome.UNSURE], [9.0, 9.0], True, Cause.UNSURE),
        ([OK, Outcome.DEPENDS], [9.0, 9.0], True, Cause.DEPENDS),
        ([Outcome.UNEXPLAINED, OK], [9.0, 9.0], True, Cause.UNEXPLAINED),
        ([Outcome.NO_ROLES, OK], [9.0, 9.0], True, Cause.NO_ROLES),
    ],
)
def test_causes_by_hand(
    outcomes: list[Outcome], margins: list[float], inside: bool, cause: Cause | None
) -> None:
    found = causes(prediction([outcomes], [margins]), np.array([inside]), 1.0)
    assert found.tolist() == [-1 if cause is None else CAUSES.index(cause)]


def test_what_is_overruled_does_not_matter() -> None:
    some = prediction([[OUT, OK], [OK, OK]], [[0.0, 5.0], [0.0, 5.0]])
    inside = np.ones(2, dtype=bool)
    assert causes(some, inside, 1.0, {("cart", "v")}).tolist() == [-1, -1]
    assert causes(some, inside, 1.0, {("cart", "x")}).tolist() == [
        CAUSES.index(Cause.OUTSIDE),
        CAUSES.index(Cause.LOW_MARGIN),
    ]
    assert causes(some, ~inside, 1.0, set(PARTS)).tolist() == [CAUSES.index(Cause.LEFT)] * 2


def test_sentences_name_what_and_why() -> None:
    parts = [("cart", "v", OUT, 0.0), ("cart", "x", NONE, 0.0)]
    found = explained(parts, 0.0)
    assert found is not None and found[0] is Cause.OUTSIDE
    assert found[1] == f"cart.v: {OUT.value}; cart.x: {NONE.value}"
    found = explained([("cart", "v", OK, 0.25), ("cart", "x", OK, 3.0)], 0.5)
    assert found == (Cause.LOW_MARGIN, f"cart.v: {Cause.LOW_MARGIN.value} (0.25, expected at least 0.5)")
    assert explained([("cart", "v", OK, 0.5)], 0.5) is None
    assert explained(parts, 0.0, set(PARTS)) is None
    assert horizon_reached(12) == "the horizon of 12 steps is reached"


ROW = st.tuples(*(st.sampled_from(list(OUTCOMES)) for _ in range(2)))
MARGINS = st.tuples(*(st.sampled_from((0.0, 0.5, 1.0, float("inf"))) for _ in range(2)))


@given(
    st.lists(st.tuples(ROW, MARGINS), min_size=1, max_size=5),
    st.sampled_from((0.0, 0.75)),
    st.sets(st.sampled_from(PARTS)),
)
def test_a_row_of_a_batch_ends_as_it_would_alone(
    rows: list[tuple[tuple[Outcome, ...], tuple[float, ...]]], least: float, overruled: set[tuple[str, str]]
) -> None:
    many = prediction([list(o) for o, _ in rows], [list(m) for _, m in rows])
    found = causes(many, np.ones(len(rows), dtype=bool), least, overruled).tolist()
    for k, number in enumerate(found):
        one = explained(parts_of_row(many, k), least, overruled)
        assert (None if number < 0 else CAUSES[number]) is (None if one is None else one[0])
