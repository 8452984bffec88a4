"""Decision lists say what they were given, in few words."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from relgym.numeric.decision_list import Rule, decision_list


def said(rules: tuple[Rule, ...], row: np.ndarray) -> int:
    return next(r.label for r in rules if all(row[k] == yes for k, yes in r.tests))


def test_one_condition_is_enough() -> None:
    truth = np.array([[True, False], [False, True], [False, False], [True, True]])
    allowed = np.eye(2, dtype=bool)[[1, 0, 0, 1]]
    rules = decision_list(truth, allowed, np.array([1.0, 5.0, 5.0, 1.0]))
    assert rules == (Rule(((0, True),), 1, 2.0), Rule((), 0, 10.0))


def test_order_saves_tests() -> None:
    # a -> 1, else b -> 2, else 0: without an order the second rule would need "not a" as well.
    truth = np.array([[a, b] for a in (True, False) for b in (True, False)])
    labels = [1 if a else 2 if b else 0 for a, b in truth]
    rules = decision_list(truth, np.eye(3, dtype=bool)[labels], np.ones(4))
    assert [len(r.tests) for r in rules] == [1, 1, 0]
    assert [said(rules, row) for row in truth] == labels


def test_where_several_labels_will_do_the_shorter_list_wins() -> None:
    truth = np.array([[True], [False]])
    rules = decision_list(truth, np.array([[True, True], [False, True]]), np.ones(2))
    assert rules == (Rule((), 1, 2.0),)


def test_what_is_doubtful_may_be_left_out_within_a_budget() -> None:
    truth = np.array([[True], [False]])
    allowed, weights = np.eye(2, dtype=bool), np.array([1.0, 999.0])
    doubtful = np.array([True, False])
    assert len(decision_list(truth, allowed, weights, doubtful=doubtful, budget=0.01)) == 1
    assert len(decision_list(truth, allowed, weights, doubtful=doubtful, budget=1e-4)) == 2
    assert len(decision_list(truth, allowed, weights, doubtful=~doubtful, budget=0.01)) == 2


def test_rows_that_nothing_tells_apart_get_the_weightier_label() -> None:
    truth = np.zeros((3, 0), dtype=bool)
    allowed = np.eye(2, dtype=bool)[[0, 1, 1]]
    assert decision_list(truth, allowed, np.array([5.0, 1.0, 1.0])) == (Rule((), 0, 7.0),)


@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(2, 4))
def test_every_row_gets_a_label_that_it_may_have(seed: int, conditions: int, labels: int) -> None:
    rng = np.random.default_rng(seed)
    truth = rng.random((40, conditions)) < 0.5
    key = truth @ (1 << np.arange(conditions))
    right = rng.integers(labels, size=2**conditions)[key]
    rules = decision_list(truth, np.eye(labels, dtype=bool)[right], np.ones(40))
    assert [said(rules, row) for row in truth] == right.tolist()
    assert rules[-1].tests == () and sum(r.weight for r in rules) == 40.0
    assert rules == decision_list(truth, np.eye(labels, dtype=bool)[right], np.ones(40))
