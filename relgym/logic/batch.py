"""Whether a clause holds, for many worlds at once: boolean tensors with one axis per existential variable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from relgym.arguments import refusing
from relgym.config.constants import MOST_BYTES
from relgym.errors import ConfigError
from relgym.logic.clause import ANY, Clause, Definition, Literal
from relgym.logic.facts import Bool, Facts, Float, Int

__all__ = ["decide", "extremes", "matches"]


@refusing(ConfigError)
def matches(clause: Clause, facts: Facts, tuples: Int) -> Bool:
    """Return for each tuple whether the clause holds.

    Parameters
    ----------
    clause
        What must hold.
    facts
        The worlds.
    tuples
        Integers of shape (n, 1 + arity): a world, then the objects of the target's arguments.

    Returns
    -------
    Booleans of shape (n,).

    Raises
    ------
    ConfigError
        If the tuples have another width, or the facts don't know a literal's relation.

    Notes
    -----
    Existential variables that share no literal are independent and never multiply. Cost: n x K^v per literal,
    v the size of the largest set of connected existential variables.
    """
    _check(clause, tuples)
    truths = [(literal, facts.truth(literal)) for literal in clause.literals]
    result = np.ones(len(tuples), dtype=np.bool_)
    for variables, members in _components(clause.literals, clause.arity):
        tests = [truths[index] for index in members]
        for piece in _pieces(facts, len(tuples), len(variables)):
            axes = _Axes(facts, tuples[piece], variables)
            result[piece] &= axes.bindings(tests).reshape(len(result[piece]), -1).any(axis=1)
    return result


@refusing(ConfigError)
def decide(definition: Definition, facts: Facts, tuples: Int) -> Bool:
    """Return for each tuple whether the definition is true of it, its polarity taken into account."""
    result = np.zeros(len(tuples), dtype=np.bool_)
    for clause in definition.clauses:
        result |= matches(clause, facts, tuples)
    return result ^ definition.negated


def extremes(clause: Clause, index: int, facts: Facts, tuples: Int) -> Float:
    """Return the value on which a numeric literal of a clause decides.

    Parameters
    ----------
    clause, facts, tuples
        As in `matches`.
    index
        Number of the numeric literal in the clause.

    Returns
    -------
    Shape (n,): over all objects that satisfy the other literals, the least value of the function if the
    operator is ``<=``, else the greatest; +inf or -inf if there is none; NaN where the other literals fail
    anyway.
    """
    _check(clause, tuples)
    asked = _opened(clause.literals[index], clause.variables)
    literals = (*clause.literals[:index], asked, *clause.literals[index + 1 :])
    parts = _components(literals, clause.arity)
    [(variables, members)] = [part for part in parts if index in part[1]]
    truths = [(literals[member], facts.truth(literals[member])) for member in members if member != index]
    values = facts.numeric[asked.relation]
    values = values[:, np.newaxis] if asked.relation in facts.relative else values
    least = asked.op == "<="
    empty = np.inf if least else -np.inf
    result = np.full(len(tuples), empty)
    for piece in _pieces(facts, len(tuples), len(variables)):
        axes = _Axes(facts, tuples[piece], variables)
        found = np.where(axes.bindings(truths), axes.pick(asked, values), np.nan)
        found = np.where(np.isnan(found), empty, found).reshape(len(result[piece]), -1)
        result[piece] = found.min(axis=1) if least else found.max(axis=1)
    others = [literals[member] for part in parts if index not in part[1] for member in part[1]]
    return np.where(matches(Clause(tuple(others), clause.arity), facts, tuples), result, np.nan)


def _check(clause: Clause, tuples: Int) -> None:
    if not isinstance(tuples, np.ndarray):
        raise ConfigError(f"tuples: expected an array, got {type(tuples).__name__}.")
    if tuples.ndim != 2 or tuples.shape[1] != clause.arity + 1:
        raise ConfigError(f"Expected tuples of shape (n, {clause.arity + 1}), got {tuples.shape}.")


def _opened(literal: Literal, first: int) -> Literal:
    """Replace `ANY` by variables, numbered from `first`."""
    args = tuple(first + place if arg == ANY else arg for place, arg in enumerate(literal.args))
    return Literal(literal.relation, args, False, literal.op, literal.threshold)


def _components(literals: Sequence[Literal], arity: int) -> list[tuple[list[int], list[int]]]:
    """Group literals connected by existential variables: pairs of (variables, indices of literals)."""
    parts: list[tuple[set[int], list[int]]] = []
    for index, literal in enumerate(literals):
        variables = {variable for variable in literal.variables if variable >= arity}
        members = [index]
        for part in [part for part in parts if part[0] & variables]:
            parts.remove(part)
            variables |= part[0]
            members += part[1]
        parts.append((variables, members))
    return [(sorted(variables), sorted(members)) for variables, members in parts]


def _pieces(facts: Facts, size: int, width: int) -> Iterator[slice]:
    step = max(1, MOST_BYTES // max(facts.objects, 1) ** width)
    return (slice(start, start + step) for start in range(0, size, step))


class _Axes:
    """Index arrays that put every variable of a connected part of a clause on an axis of its own."""

    def __init__(self, facts: Facts, tuples: Int, variables: Sequence[int]) -> None:
        self._facts = facts
        self._rank = 1 + len(variables)
        self._exists = facts.exists[tuples[:, 0]]
        ones = [1] * len(variables)
        self._worlds = tuples[:, 0].reshape(-1, *ones)
        arity = tuples.shape[1] - 1
        self._columns = {place: tuples[:, 1 + place].reshape(-1, *ones) for place in range(arity)}
        for axis, variable in enumerate(variables, start=1):
            self._columns[variable] = np.arange(facts.objects).reshape(self._shape(1, axis))

    def bindings(self, tests: Sequence[tuple[Literal, Bool]]) -> Bool:
        """Return which existing objects satisfy all `tests`: shape (n, K, …, K)."""
        size, objects = self._exists.shape
        found = np.ones((size, *[objects] * (self._rank - 1)), dtype=np.bool_)
        for axis in range(1, self._rank):
            found &= self._exists.reshape(self._shape(size, axis))
        for literal, truth in tests:
            found &= truth[self._index(literal)] != literal.negated
        return found

    def pick(self, literal: Literal, values: Float) -> Float:
        """Return a function's values, with axes of length 1 for variables that it doesn't take."""
        return np.asarray(values[self._index(literal)])

    def _index(self, literal: Literal) -> tuple[Int, ...]:
        index = [self._columns[variable] for variable in literal.variables]
        if literal.relation in self._facts.relative:
            index[0] = np.zeros_like(self._worlds)  # the target's own axis has length 1
        return (self._worlds, *index)

    def _shape(self, length: int, axis: int) -> list[int]:
        return [length, *[self._facts.objects if axis == place else 1 for place in range(1, self._rank)]]
