from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from logic_worlds import random_clause, random_facts

from relgym.errors import ConfigError
from relgym.logic.clause import ANY, Clause, Definition, Literal
from relgym.logic.csp import World, decide, holds, matches, satisfiable, solutions, world_of
from relgym.logic.facts import facts_from_tuples

STACK, [NUMBER] = facts_from_tuples(
    [{"on-top": [("c", "b"), ("b", "truck")], "above": [("b", "truck"), ("c", "truck"), ("d", "truck")]}],
    [["truck", "b", "c", "d"]],
)


def test_table_3_2s_first_clause_binds_one_object_throughout() -> None:
    clause = Clause((Literal("above", (1, 0)), Literal("on-top", (2, 1))))
    truck, b, c = (NUMBER[name] for name in ("truck", "b", "c"))
    assert list(solutions(clause, world_of(STACK, 0), [truck])) == [(truck, b, c)]
    assert not satisfiable(clause, world_of(STACK, 0), [c])


def test_star_is_universal() -> None:
    clause = Clause((Literal("on-top", (ANY, 0), True),))
    world = world_of(STACK, 0)
    assert [name for name, slot in NUMBER.items() if satisfiable(clause, world, [slot])] == ["c", "d"]


def test_variables_may_stand_for_the_same_object() -> None:
    clause = Clause((Literal("above", (1, 0)), Literal("above", (2, 0))))
    assert len(list(solutions(clause, world_of(STACK, 0), [NUMBER["truck"]]))) == 9


def test_the_empty_clause_has_one_solution() -> None:
    assert list(solutions(Clause(()), world_of(STACK, 0), [2])) == [(2,)]


def test_more_than_sixty_objects_fit() -> None:
    size = 70
    chain = np.eye(size, k=1, dtype=np.bool_)
    world = World({"next": chain}, np.ones(size, dtype=np.bool_))
    clause = Clause((Literal("next", (0, 1)), Literal("next", (1, 2))))
    assert list(solutions(clause, world, [66])) == [(66, 67, 68)]


def test_unknown_relations_and_wrong_tuples_are_refused() -> None:
    clause = Clause((Literal("purple", (0,)),))
    with pytest.raises(ConfigError, match=r"purple\(A\): expected one of"):
        satisfiable(clause, world_of(STACK, 0), [0])
    with pytest.raises(ConfigError, match=r"purple\(A\): expected one of"):
        matches(clause, STACK, np.zeros((1, 2), dtype=np.int64))
    with pytest.raises(ConfigError, match=r"shape \(n, 2\)"):
        matches(Clause(()), STACK, np.zeros((1, 3), dtype=np.int64))


@given(seed=st.integers(0, 100_000), literals=st.integers(0, 5))
def test_single_batched_and_brute_force_evaluation_agree(seed: int, literals: int) -> None:
    rng = np.random.default_rng(seed)
    facts, clause = random_facts(rng), random_clause(rng, literals)
    tuples = np.array([[world, 0] for world in range(facts.worlds)])
    batch = matches(clause, facts, tuples)
    for world in range(facts.worlds):
        expected = sorted(
            binding
            for binding in itertools.product(
                np.flatnonzero(facts.exists[world]).tolist(), repeat=clause.variables
            )
            if binding[0] == 0 and all(_true(literal, facts, world, binding) for literal in clause)
        )
        assert sorted(solutions(clause, world_of(facts, world), [0])) == expected
        assert batch[world] == bool(expected)


def _true(literal: Literal, facts, world: int, binding: tuple[int, ...]) -> bool:  # type: ignore[no-untyped-def]
    truth = facts.truth(literal)[world]
    args = [binding[variable] for variable in literal.variables]
    if literal.relation in facts.relative:
        args[0] = 0
    return bool(truth[tuple(args)]) != literal.negated


@given(seed=st.integers(0, 100_000), negated=st.booleans())
def test_definitions_decide_alike_single_and_batched(seed: int, negated: bool) -> None:
    rng = np.random.default_rng(seed)
    facts = random_facts(rng)
    definition = Definition((random_clause(rng, 2), random_clause(rng, 3)), negated=negated)
    tuples = np.array([[world, 0] for world in range(facts.worlds)])
    single = [holds(definition, world_of(facts, world), [0]) for world in range(facts.worlds)]
    assert decide(definition, facts, tuples).tolist() == single
