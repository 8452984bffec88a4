"""Small worlds for the tests of relgym.logic."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from relgym.logic.clause import ANY, Clause, Literal
from relgym.logic.facts import Facts

Rows = Iterable[tuple[int, tuple[Hashable, ...]]]


def tuples_of(rows: Rows, numbers: Sequence[Mapping[Hashable, int]], arity: int) -> NDArray[np.int64]:
    """(world, symbols) pairs as an array of integers."""
    found = [[world, *[numbers[world][symbol] for symbol in symbols]] for world, symbols in rows]
    return np.array(found, dtype=np.int64).reshape(-1, arity + 1)


def random_facts(rng: np.random.Generator, worlds: int = 12, objects: int = 4) -> Facts:
    """Relations of arity 0 to 3 and numeric functions, some slots free; object 0 exists everywhere."""
    shape = (worlds, objects)
    exists = rng.random(shape) < 0.8
    exists[:, 0] = True
    relations = {
        "calm": rng.random(worlds) < 0.5,
        "red": rng.random(shape) < 0.5,
        "near": rng.random((*shape, objects)) < 0.4,
        "above": rng.random((*shape, objects)) < 0.3,
        "between": rng.random((*shape, objects, objects)) < 0.2,
    }
    weight = rng.normal(size=shape)
    weight[rng.random(shape) < 0.3] = np.nan
    numeric = {"load": rng.normal(size=worlds), "weight": weight, "gap": rng.normal(size=(*shape, objects))}
    return Facts(relations, exists, numeric, frozenset({"weight"}))


_ARITIES = {"calm": 0, "red": 1, "near": 2, "above": 2, "between": 3, "load": 0, "weight": 2, "gap": 2}


def random_clause(rng: np.random.Generator, literals: int, variables: int = 4) -> Clause:
    """A clause in normal form over the vocabulary of `random_facts`, with one target argument."""
    return Clause.of([_random_literal(rng, variables) for _ in range(literals)])


def _random_literal(rng: np.random.Generator, variables: int) -> Literal:
    name = str(rng.choice(sorted(_ARITIES)))
    args = [int(variable) for variable in rng.permutation(variables)[: _ARITIES[name]]]
    if name == "weight":
        args = [0, int(rng.integers(1, variables))]
    negated = bool(rng.random() < 0.4)
    if negated and args and rng.random() < 0.5:
        args[-1] = ANY
    op = str(rng.choice(["<=", ">"])) if name in ("load", "weight", "gap") else None
    return Literal(name, tuple(args), negated, op, float(rng.normal()) if op else 0.0)
