from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from logic_worlds import random_clause

from relgym.errors import ConfigError
from relgym.logic.clause import ANY, Clause, Coverage, Definition, Literal


def test_literals_print_as_in_the_thesis() -> None:
    assert str(Literal("intersect", (0, ANY), negated=True)) == "¬intersect(A, *)"
    assert str(Literal("approach", (0, 1), op="<=", threshold=-1.5e-9)) == "approach(A, B) <= -1.5e-09"
    assert str(Literal("approach", (0, ANY), True, ">", 2.0)) == "¬(approach(A, *) > 2)"
    assert str(Literal("raining")) == "raining"
    assert str(Literal("floor", (27,))) == "floor(V27)"


def test_clauses_print_as_in_table_3_2() -> None:
    clause = Clause((Literal("y-greater-than", (1, 0)), Literal("on-top", (2, 1))))
    assert str(clause) == "y-greater-than(B, A) ∧ on-top(C, B)"
    assert str(Clause(())) == "true"


def test_definitions_print_their_disjuncts_and_their_polarity() -> None:
    ramp = Clause((Literal("x-aligned", (0, 1)), Literal("ramp", (1,))))
    free = Clause((Literal("intersect", (0, ANY), True),))
    assert str(Definition((free, ramp))) == "¬intersect(A, *) ∨ (x-aligned(A, B) ∧ ramp(B))"
    assert str(Definition((ramp,), negated=True)) == "¬[(x-aligned(A, B) ∧ ramp(B))]"
    assert str(Definition(())) == "false"


def test_normal_form_renumbers_and_quantifies() -> None:
    literals = [Literal("near", (0, 3)), Literal("red", (3,)), Literal("above", (3, 2), True)]
    assert str(Clause.of(literals)) == "near(A, B) ∧ red(B) ∧ ¬above(B, *)"


def test_dropping_the_literal_that_binds_a_variable_leaves_a_star() -> None:
    clause = Clause.of([Literal("near", (0, 1)), Literal("above", (0, 1), True)])
    assert str(clause.without(0)) == "¬above(A, *)"


def test_reading_order_follows_shared_variables() -> None:
    literals = [
        Literal("ramp", (1,)),
        Literal("above", (1, 2), True),
        Literal("near", (0, 1)),
        Literal("red", (2,)),
    ]
    assert str(Clause.of(literals).connected()) == "near(A, B) ∧ ramp(B) ∧ red(C) ∧ ¬above(B, C)"


@pytest.mark.parametrize(
    ("literal", "message"),
    [
        ({"relation": "near", "args": (0, 0)}, "distinct variables"),
        ({"relation": "near", "args": (0, ANY)}, "universal"),
        ({"relation": "near", "args": (0, -2)}, "distinct variables"),
        ({"relation": "gap", "op": "<"}, "operator"),
        ({"relation": "gap", "op": ">", "threshold": float("nan")}, "finite threshold"),
    ],
)
def test_malformed_literals_are_refused(literal: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Literal(**literal)  # type: ignore[arg-type]


def test_a_variable_in_negated_literals_only_is_refused() -> None:
    with pytest.raises(ConfigError, match="B occurs in negated literals only"):
        Clause((Literal("near", (0, 1), True),))


def test_definitions_refuse_counts_and_arities_that_do_not_fit() -> None:
    with pytest.raises(ConfigError, match="one count per clause"):
        Definition((Clause(()),), coverage=(Coverage(), Coverage()))
    with pytest.raises(ConfigError, match="arity 2"):
        Definition((Clause(()),), arity=2)


def test_errors_are_false_positives_and_uncovered_positives() -> None:
    definition = Definition((Clause(()),), coverage=(Coverage(8.0, 1.0),), uncovered=Coverage(2.0, 9.0))
    assert definition.errors == 3.0
    assert definition.performance == pytest.approx(0.85)
    assert definition.coverage[0].precision == pytest.approx(8 / 9)
    assert Coverage().precision == 0.0


@given(seed=st.integers(0, 10_000), sizes=st.lists(st.integers(0, 4), max_size=3), negated=st.booleans())
def test_definitions_survive_json(seed: int, sizes: list[int], negated: bool) -> None:
    rng = np.random.default_rng(seed)
    clauses = tuple(random_clause(rng, size) for size in sizes)
    coverage = tuple(Coverage(float(rng.normal()), 0.1) for _ in clauses)
    definition = Definition(clauses, 1, negated, coverage, Coverage(1.0, 2.5), 12.75, work=7)
    assert Definition.from_dict(json.loads(json.dumps(definition.to_dict()))) == definition
