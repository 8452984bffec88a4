"""One pair's waterfall by hand: a clause with a tree, then what no clause covers, with another one (§3.4.4)."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_situations import BALL_VOCABULARY, ball_stream

from relgym.classification.binary import VOTE_UNIT, BinaryClassifier, Outcome, majority, tree_columns
from relgym.classification.examples import ExampleBatch
from relgym.classification.ranking import verdict
from relgym.classification.views import Scope, View
from relgym.config import ClassificationConfig
from relgym.logic.clause import Clause, Definition, Literal
from relgym.numeric.tree import DecisionTree

_SCOPE = Scope.of(BALL_VOCABULARY, ClassificationConfig())
_ITEM = next(ball_stream(1, rng=np.random.default_rng(0)))
_SLOW = Clause((Literal("vx", (), op="<=", threshold=0.1),))


def _stump(
    column: int, threshold: float, *, below: tuple[float, float], above: tuple[float, float]
) -> DecisionTree:
    """One test on vx (0) or vy (1), and how many positive and negative examples are on either side."""
    positive, negative = zip((below[0] + above[0], below[1] + above[1]), below, above, strict=True)
    return DecisionTree(
        ("vx", "vy"), (column, -1, -1), (threshold, 0.0, 0.0), (1, 1, 2), (2, 1, 2), positive, negative
    )


def _view(*velocities: tuple[float, float]) -> View:
    examples = [replace(_ITEM.example, own=np.array(v)) for v in velocities]
    return View.of_batch(ExampleBatch.stack(examples), (), np.empty((len(examples), 0)))


def _waterfall(*, negated: bool = False) -> BinaryClassifier:
    """Slow ones are mode 4 if they don't rise; of the others those that are very fast."""
    return BinaryClassifier(
        4,
        7,
        _SCOPE,
        "touching",
        Definition((_SLOW,), negated=negated),
        (_stump(1, 0.0, below=(9.0, 1.0), above=(2.0, 2.0)),),
        _stump(0, 0.5, below=(1.0, 6.0), above=(3.0, 0.0)),
    )


def test_ways_through_the_waterfall_by_hand() -> None:
    # A clause's tree only says yes, or leaves it to what follows (a tie is no); the last one says yes or no.
    found = _waterfall()
    assert found.outcomes == (Outcome(0, 1, True), Outcome(1, 1, False), Outcome(1, 2, True))
    assert found.for_i == (True, False, True)
    assert _waterfall(negated=True).for_i == (False, True, False)
    assert (found.positive, _waterfall(negated=True).positive) == (4, 7)
    assert found.outcome_of == {(0, 1): 0, (1, 1): 1, (1, 2): 2}
    assert found.tree_columns(0) == found.tree_columns(1) == ("vx", "vy")


def test_decisions_by_hand() -> None:
    view = _view((0.0, -1.0), (0.1, 0.0), (0.0, 1.0), (0.3, -1.0), (0.5, -1.0), (0.6, -1.0), (0.6, 9.0))
    found, rows = _waterfall(), np.arange(7)
    assert found.decide_batch(view, rows).tolist() == [0, 0, 1, 1, 1, 2, 2]
    assert found.says_i_batch(view, rows).tolist() == [True, True, False, False, False, True, True]
    assert found.decide_batch(view, np.array([6, 0])).tolist() == [2, 0]
    plain = BinaryClassifier(4, 7, _SCOPE, "touching", Definition((_SLOW,)))
    assert plain.outcomes == (Outcome(0, -1, True), Outcome(1, -1, False))
    assert plain.decide_batch(view, rows).tolist() == [0, 0, 0, 1, 1, 1, 1]
    everything = BinaryClassifier(4, 7, _SCOPE, "touching", Definition((_SLOW, Clause(()))))
    assert everything.decide_batch(view, rows).tolist() == [
        0,
        0,
        0,
        1,
        1,
        1,
        1,
    ]  # nobody is left for the third


def test_counts_of_outcomes_and_the_weight_of_errors() -> None:
    view = _view((0.0, -1.0), (0.0, -1.0), (0.3, 0.0), (0.6, 0.0), (0.6, 0.0))
    found = _waterfall()
    is_i, weights = np.array([True, False, True, True, False]), np.array([2.0, 0.5, 4.0, 1.0, 8.0])
    assert found.recount(view, np.arange(5), is_i, weights) == 0.5 + 4.0 + 8.0
    assert found.counts == [[2.0, 0.5], [4.0, 0.0], [1.0, 8.0]]
    found.count(1, False)
    found.count(1, True)
    assert found.counts[1] == [5.0, 1.0]
    # The same examples the other way round: the clause describes mode 7.
    assert _waterfall(negated=True).recount(view, np.arange(5), is_i, weights) == 2.0 + 1.0
    assert found.describe() == [("vx <= 0.1", 2.0, 0.5, True), ("Negative", 1.0 + 1.0, 8.0 + 5.0, True)]


def test_votes_are_laplaces_log_probabilities() -> None:
    found = _waterfall()
    found.counts = [[98.0, 0.0], [0.0, 0.0], [3.0, 5.0]]
    shares = [(99 / 100, 1 / 100), (1 / 2, 1 / 2), (4 / 10, 6 / 10)]
    assert found.votes == [tuple(round(math.log(s) * VOTE_UNIT) for s in each) for each in shares]


def test_how_a_decision_is_told() -> None:
    found = _waterfall()
    found.counts = [[9.0, 1.0], [2.0, 6.0], [3.0, 0.0]]
    first, second, third = (verdict(found, outcome) for outcome in range(3))
    assert (first.winner, first.runner_up, first.clause, first.tree) == (4, 7, _SLOW, "vy <= 0")
    assert (first.correct, first.incorrect, first.probability) == (9.0, 1.0, 10 / 12)
    assert (second.winner, second.runner_up, second.clause, second.tree) == (7, 4, None, "vx <= 0.5")
    assert (second.correct, second.incorrect) == (6.0, 2.0)
    assert (third.winner, third.clause, third.tree, third.correct) == (4, None, "vx > 0.5", 3.0)


def test_without_a_clause_the_majority_wins_and_may_change_sides() -> None:
    view = _view((0.0, 0.0), (0.9, 0.0))
    found = majority(4, 7, _SCOPE, [2.0, 2.0])
    assert found.counts == [[2.0, 2.0]]
    assert found.says_i_batch(view, np.arange(2)).all()  # of equals the first
    found.count(0, False)
    assert found.for_i == (False,)
    found.count(0, True)
    assert found.for_i == (True,)
    is_i = np.array([False, False])
    assert found.recount(view, np.arange(2), is_i, np.ones(2)) == 0.0
    assert found.for_i == (False,)


def test_trees_see_the_objects_that_a_clause_binds() -> None:
    names = ("approach", "distance", "normal-x", "normal-y")
    assert tree_columns(_SCOPE, 1) == ("vx", "vy")
    assert tree_columns(_SCOPE, 3) == (
        "vx",
        "vy",
        *(f"{name}(A, B)" for name in names),
        *(f"{name}(A, C)" for name in names),
    )


@given(st.booleans(), st.lists(st.tuples(st.integers(0, 99), st.integers(0, 99)), min_size=3, max_size=3))
def test_what_is_read_decides_as_what_was_saved(negated: bool, counts: list[tuple[int, int]]) -> None:
    found = _waterfall(negated=negated)
    found.counts = [[float(a), float(b)] for a, b in counts]
    again = BinaryClassifier.from_dict(json.loads(json.dumps(found.to_dict())), _SCOPE)
    assert again.to_dict() == found.to_dict()
    assert (again.outcomes, again.for_i, again.votes) == (found.outcomes, found.for_i, found.votes)
    view = _view(*((x, y) for x in (0.0, 0.3, 0.6) for y in (-1.0, 1.0)))
    np.testing.assert_array_equal(
        again.decide_batch(view, np.arange(6)), found.decide_batch(view, np.arange(6))
    )


@pytest.mark.parametrize("bad", [0, 1])
def test_an_undefined_number_goes_above(bad: int) -> None:
    own = [0.0, -1.0]
    own[bad] = math.nan
    expected = (
        2 if bad == 0 else 1
    )  # no clause holds of it, and it is above 0.5; slow, and above 0, hence not yes
    assert _waterfall().decide_batch(_view((own[0], own[1])), np.arange(1)).tolist() == [expected]
