from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relgym.logic.clause import ANY, Clause, Literal
from relgym.logic.facts import Facts
from relgym.logic.pruning import Problem, center_thresholds, prune


def _problem(positive: list[bool], **arrays: NDArray[np.generic]) -> Problem:
    worlds, objects = len(positive), 2
    relations = {name: array for name, array in arrays.items() if array.dtype == np.bool_}
    numeric = {name: array for name, array in arrays.items() if array.dtype == np.float64}
    facts = Facts(relations, np.ones((worlds, objects), dtype=np.bool_), numeric, frozenset(numeric))
    tuples = np.stack([np.arange(worlds), np.zeros(worlds, dtype=np.int64)], axis=1)
    return Problem(facts, tuples, np.ones(worlds), np.array(positive))


def _slot_one(values: list[bool]) -> NDArray[np.bool_]:
    return np.stack([np.zeros(len(values), dtype=np.bool_), np.array(values)], axis=1)


def test_literals_that_keep_no_negative_out_are_dropped() -> None:
    problem = _problem(
        [True, True, False, False],
        ramp=_slot_one([True, True, False, True]),
        steep=_slot_one([True, True, True, False]),
        tall=_slot_one([True, False, False, False]),
    )
    clause = Clause(tuple(Literal(name, (1,)) for name in ("ramp", "steep", "tall")))
    # without `tall` one more positive is covered, and no negative; the other two need each other
    assert str(prune(clause, problem)) == "ramp(B) ∧ steep(B)"


def test_a_variable_left_in_a_negated_literal_becomes_a_star() -> None:
    near = np.zeros((3, 2, 2), dtype=np.bool_)
    near[2, 0, 1] = True
    problem = _problem([True, True, False], near=near, box=_slot_one([True, True, True]))
    clause = Clause((Literal("box", (1,)), Literal("near", (0, 1), True)))
    assert str(prune(clause, problem)) == "¬near(A, *)"


def test_the_last_literal_stays() -> None:
    problem = _problem([True, True], ramp=_slot_one([True, False]))
    assert str(prune(Clause((Literal("ramp", (1,)),)), problem)) == "ramp(B)"


def test_a_threshold_moves_to_the_middle_of_what_the_other_literals_leave() -> None:
    # the negative at 0.1 is no ramp: between 0 and 10 nothing matters
    problem = _problem(
        [True, False, False],
        ramp=_slot_one([True, False, True]),
        approach=np.array([[np.nan, 0.0], [np.nan, 0.1], [np.nan, 10.0]]),
    )
    clause = Clause((Literal("approach", (0, 1), op="<=", threshold=0.05), Literal("ramp", (1,))))
    assert center_thresholds(clause, problem).literals[0].threshold == 5.0


def test_a_universal_threshold_moves_too() -> None:
    problem = _problem([True, False], approach=np.array([[0.0, 1.0], [0.0, 9.0]]))
    clause = Clause((Literal("approach", (0, ANY), True, ">", 1.5),))
    assert center_thresholds(clause, problem).literals[0].threshold == 5.0


def test_a_threshold_with_nothing_on_its_other_side_stays() -> None:
    problem = _problem([True, True], approach=np.array([[0.0, 1.0], [0.0, 1.0]]))
    clause = Clause((Literal("approach", (0, 1), op="<=", threshold=3.0),))
    assert center_thresholds(clause, problem) == clause
