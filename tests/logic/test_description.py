from __future__ import annotations

import math

import pytest

from relgym.logic.clause import Clause, Coverage, Literal
from relgym.logic.description import DescriptionLength

LENGTH = DescriptionLength(names=8, values=1023)


def test_a_literal_costs_its_name_its_sign_and_its_arguments() -> None:
    # 8 names, 2 signs, 2 arguments of: A, a new variable
    assert LENGTH.clause(Clause((Literal("near", (0, 1)),))) == pytest.approx(3 + 1 + 2)
    # 1024 thresholds
    assert LENGTH.clause(Clause((Literal("vx", (0,), op=">", threshold=0.5),))) == pytest.approx(
        3 + 1 + 1 + 10
    )
    assert DescriptionLength(8, 1023, evidence=3).threshold == pytest.approx(30)
    # zero is one more choice than to have a threshold at all
    assert LENGTH.clause(Clause((Literal("vx", (0,), op=">"),))) == pytest.approx(3 + 1 + 1 + 1)
    assert DescriptionLength(8, 1023, evidence=3).sign == pytest.approx(3)
    # the second one chooses from three, and the order of the two is free
    two = Clause((Literal("near", (0, 1)), Literal("above", (0, 1))))
    assert LENGTH.clause(two) == pytest.approx(6 + 4 + 2 * math.log2(3) - 1)


def test_what_a_thing_is_costs_as_much_as_how_two_stand() -> None:
    standing, being = Clause((Literal("near", (0, 1)),)), Clause((Literal("red", (1,)),))
    assert LENGTH.clause(being) == LENGTH.clause(standing)


def test_exceptions_cost_the_choice_of_a_subset() -> None:
    assert LENGTH.exceptions(4, 2) == pytest.approx(math.log2(5) + math.log2(6))
    assert LENGTH.exceptions(7, 0) == pytest.approx(3)
    assert LENGTH.exceptions(0, 0) == 0


def test_a_clause_saves_what_its_exceptions_cost_less() -> None:
    whole, covered = Coverage(50.0, 50.0), Coverage(50.0, 0.0)
    saved = LENGTH.exceptions(100, 50) - 2 * LENGTH.exceptions(50, 0)
    assert LENGTH.saving(6.0, covered, whole) == pytest.approx(saved - 6)
    assert LENGTH.saving(6.0, Coverage(1.0, 1.0), Coverage(2.0, 2.0)) < 0


def test_a_definition_costs_its_clauses_and_both_kinds_of_error() -> None:
    clause = Clause((Literal("near", (0, 1)),))
    bits = LENGTH.definition([clause], Coverage(3.0, 1.0), Coverage(2.0, 4.0))
    assert bits == pytest.approx(6 + LENGTH.exceptions(4, 1) + LENGTH.exceptions(6, 2))
