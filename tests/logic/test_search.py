from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from logic_worlds import random_facts
from numpy.typing import NDArray

from relgym.config.logic import FoilConfig
from relgym.logic.batch import matches
from relgym.logic.candidates import blocks
from relgym.logic.clause import Clause, Literal
from relgym.logic.description import DescriptionLength
from relgym.logic.facts import Facts
from relgym.logic.growing import Score, Weights
from relgym.logic.search import grow
from relgym.logic.tables import Tables

LENGTH = DescriptionLength(8, 8)
CONFIG = FoilConfig(max_literals=3, mdl=False)


def _problem(seed: int, swapped: bool = False) -> tuple[Facts, Tables, Weights]:
    rng = np.random.default_rng(seed)
    facts = random_facts(rng)
    truth = rng.permutation(np.arange(facts.worlds) < facts.worlds // 2)
    tuples = np.array([[world, 0] for world in range(facts.worlds)])
    tables = Tables(facts, tuples[truth], tuples[~truth], 2, numeric=True)
    weights = np.linspace(1.0, 2.0, facts.worlds)
    return facts, tables, Weights(weights[: tables.split], weights[tables.split :], swapped)


def _coverage(
    facts: Facts, tables: Tables, weights: Weights, literals: Sequence[Literal]
) -> NDArray[np.float64]:
    return np.array(weights.total(matches(Clause(tuple(literals)), facts, tables.tuples)))


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), swapped=st.booleans())
def test_counts_of_candidates_are_those_of_the_clauses_they_make(seed: int, swapped: bool) -> None:
    facts, tables, weights = _problem(seed, swapped)
    for growing in grow(tables, weights, CONFIG, LENGTH).clauses[:4]:
        for block in blocks(tables, growing, weights, Score(6.0, 6.0), FoilConfig()):
            for row in range(0, len(block.templates), 3):
                literals = (*growing.literals, block.literal(row))
                found = [block.counts.positives[row], block.counts.negatives[row]]
                expected = _coverage(facts, tables, weights, literals)
                assert found == pytest.approx(expected, abs=1e-6), str(Clause(literals))


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000))
def test_harvested_clauses_carry_their_counts(seed: int) -> None:
    facts, tables, weights = _problem(seed)
    harvest = grow(tables, weights, CONFIG, LENGTH)
    assert harvest.clauses
    for growing in harvest.clauses:
        found = [float(growing.left.positives), float(growing.left.negatives)]
        assert found == pytest.approx(_coverage(facts, tables, weights, growing.literals), abs=1e-6)
        assert len(growing.literals) <= CONFIG.max_literals


def test_a_beam_keeps_what_greed_loses() -> None:
    # B decides by two relations that tell nothing one by one: every world has some p and some q
    worlds = 40
    positive = np.arange(worlds) < worlds // 2
    p, q = np.zeros((2, worlds, 3), dtype=np.bool_)
    p[:, 1] = True
    q[positive, 1] = True
    q[~positive, 2] = True
    facts = Facts({"p": p, "q": q}, np.ones((worlds, 3), dtype=np.bool_))
    tuples = np.stack([np.arange(worlds), np.zeros(worlds, dtype=np.int64)], axis=1)
    tables = Tables(facts, tuples[positive], tuples[~positive], 1, numeric=False)
    weights = Weights(np.ones(worlds // 2), np.ones(worlds // 2))
    harvest = grow(tables, weights, FoilConfig(max_literals=2), LENGTH)
    perfect = [growing for growing in harvest.clauses if growing.left.negatives == 0]
    assert {str(Clause(growing.literals)) for growing in perfect} == {"p(B) ∧ q(B)"}
    assert float(perfect[0].left.positives) == worlds // 2
    alone = grow(tables, weights, FoilConfig(max_literals=1), LENGTH)
    assert all(growing.left.negatives == worlds // 2 for growing in alone.clauses)
    assert harvest.work > alone.work > 0
