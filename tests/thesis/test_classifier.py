"""Waterfalls and votes of the thesis' classifiers, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from thesis_scenes import FLYING, ON_FLOOR, ON_RAMP, facts

from relgym.numeric.tree import DecisionTree
from relgym.thesis.classifier import Pair, Sample, Stage, learn_pair, ranking
from relgym.thesis.foil import Clause, Literal
from relgym.thesis.settings import ThesisSettings

THESIS = ThesisSettings.thesis()
SEEN = facts(FLYING, ON_FLOOR, ON_RAMP)
TOUCHES = Clause((Literal("intersect", (0, 1), True),))
ON_A_RAMP = Clause((Literal("intersect", (0, 1), True), Literal("ramp", (1,), True)))
FAST = DecisionTree(
    ("v",), (0, -1, -1), (1.0, 0.0, 0.0), (1, 1, 2), (2, 1, 2), (0.0, 0.0, 2.0), (2.0, 2.0, 0.0)
)
"""Yes where v > 1."""


def sample(states: list[int], numbers: list[float]) -> Sample:
    return Sample(SEEN, np.array(states), np.array(numbers)[:, None], ("v",))


def test_a_waterfall_by_hand() -> None:
    """On a ramp: yes. Touching anything else: yes where v > 1. Else: no."""
    stages = (Stage(ON_A_RAMP, None, 0, 0), Stage(TOUCHES, FAST, 0, 0), Stage(None, None, 0, 0))
    pair = Pair(1, 2, stages, 1.0)
    some = sample([2, 2, 1, 1, 0, 0], [0.0, 5.0, 0.0, 5.0, 0.0, 5.0])
    assert pair.says_positive(some).tolist() == [True, True, False, True, False, False]


def test_the_fall_through_may_have_a_tree() -> None:
    pair = Pair(1, 2, (Stage(None, FAST, 0, 0),), 1.0)
    assert pair.says_positive(sample([0, 1], [2.0, 0.5])).tolist() == [True, False]


def test_performance_counts_all_stages() -> None:
    assert Pair(1, 2, (Stage(TOUCHES, None, 3, 1), Stage(None, None, 5, 1)), 1.0).performance == 0.8
    assert Pair(1, 2, (Stage(None, None, 0, 0),), 1.0).performance == 1.0


def pair(positive: int, negative: int, yes: bool) -> Pair:
    """One that always says the same."""
    always = DecisionTree(("v",), (-1,), (0.0,), (0,), (0,), (1.0 if yes else 0.0,), (0.5,))
    return Pair(positive, negative, (Stage(None, always, 0, 0),), 1.0)


@pytest.mark.parametrize(
    ("winners", "order"),
    [
        ({(1, 2): 1, (1, 3): 1, (2, 3): 2}, [1, 2, 3]),
        ({(1, 2): 2, (1, 3): 3, (2, 3): 3}, [3, 2, 1]),
        ({(1, 2): 1, (1, 3): 3, (2, 3): 2}, [3, 2, 1]),  # a vote each: the younger ones first
        ({(1, 2): 2, (1, 3): 1, (2, 3): 3}, [3, 2, 1]),
    ],
)
def test_votes_by_hand(winners: dict[tuple[int, int], int], order: list[int]) -> None:
    pairs = [pair(i, j, winner == i) for (i, j), winner in winners.items()]
    assert ranking(pairs, (1, 2, 3), sample([0], [0.0])).tolist() == [order]
    turned = [pair(j, i, winner == j) for (i, j), winner in winners.items()]  # whatever the polarity
    assert ranking(turned, (1, 2, 3), sample([0], [0.0])).tolist() == [order]


def test_each_example_has_its_own_votes() -> None:
    touching = Pair(1, 2, (Stage(TOUCHES, None, 0, 0), Stage(None, None, 0, 0)), 1.0)
    assert ranking([touching], (1, 2), sample([0, 1], [0.0, 0.0])).tolist() == [[2, 1], [1, 2]]


def test_a_pair_that_clauses_tell_apart() -> None:
    """80 flights (mode 1), 60 on the floor (mode 2)."""
    some = sample([0] * 80 + [1] * 60, [0.0] * 140)
    labels = np.repeat([1, 2], [80, 60])
    learned = learn_pair((1, 2), some, labels, THESIS, np.random.default_rng(0))
    assert (learned.positive, learned.negative, learned.success, learned.performance) == (1, 2, 1.0, 1.0)
    assert [str(s.clause) for s in learned.stages] == ["¬intersect(A, *)", "None"]
    assert [(s.right, s.wrong) for s in learned.stages] == [(80, 0), (60, 0)]


def test_a_pair_that_numbers_tell_apart() -> None:
    """All fly; mode 1 where v > 1. No clause holds for more of mode 1 than of mode 2, and a tree decides."""
    speed = np.linspace(0.0, 2.0, 41)
    labels = np.where(speed > 1.0, 1, 2)  # 20 and 21
    learned = learn_pair((1, 2), sample([0] * 41, speed.tolist()), labels, THESIS, np.random.default_rng(0))
    (last,) = learned.stages
    assert last.clause is None and last.tree is not None
    assert (last.right, last.wrong, learned.performance) == (41, 0, 1.0)
    assert learned.says_positive(sample([0, 0], [1.03, 1.02])).tolist() == [True, False]


def test_no_tree_where_clauses_are_right_often_enough() -> None:
    """76 of 100 are right without one: above 0.75; 74 aren't."""
    for wrong, has in ((24, False), (26, True)):
        numbers = [5.0] * wrong + [0.0] * (100 - wrong)
        labels = np.array([1] * wrong + [2] * (100 - wrong))
        one_way = ThesisSettings.thesis(polarities=False)
        learned = learn_pair((1, 2), sample([0] * 100, numbers), labels, one_way, np.random.default_rng(0))
        assert (learned.stages[-1].tree is not None) is has


@pytest.mark.parametrize(("rare", "has"), [(59, False), (60, True), (93, True)])
def test_thirty_examples_of_each_class_grow_a_tree_and_thirty_test_it(rare: int, has: bool) -> None:
    """The program has a tree for 93 halts, and for 72 flights, of which three tenths would be too few to test it."""
    numbers = [5.0] * rare + [0.0] * 1000
    labels = np.array([1] * rare + [2] * 1000)
    program = ThesisSettings.original(
        polarities=False, tree_success=1.0
    )  # whatever errs gets a tree, if it may
    some = sample([0] * len(labels), numbers)
    learned = learn_pair((1, 2), some, labels, program, np.random.default_rng(0))
    assert (learned.stages[-1].tree is not None) is has


def test_the_polarity_that_errs_less_is_kept() -> None:
    """Mode 1 flies or is on the floor; mode 2 is on the ramp, or, in 10 of 90 cases, flies, too."""
    states = [0] * 40 + [1] * 40 + [2] * 80 + [0] * 10
    labels = np.array([1] * 80 + [2] * 90)
    some = sample(states, [0.0] * len(states))
    one_way = learn_pair(
        (1, 2), some, labels, ThesisSettings.thesis(polarities=False), np.random.default_rng(0)
    )
    both = learn_pair((1, 2), some, labels, THESIS, np.random.default_rng(0))
    assert one_way.positive == 1
    assert both.success >= one_way.success
    assert both.performance == pytest.approx(160 / 170)
