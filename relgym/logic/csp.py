"""Whether a clause holds: backtracking for one world, arrays for many (thesis §3.4.3).

Testing a clause on a relational state is a constraint satisfaction problem: find objects for the existential
variables such that every literal is true. In one world a variable's domain is a bit mask of objects, so that
one literal narrows it by one `&`. Many worlds at once are evaluated with boolean tensors, one axis per
variable. Both give the same answers (a property test holds them to it).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing, whole
from relgym.errors import ConfigError
from relgym.logic.batch import decide, matches
from relgym.logic.clause import ANY, Clause, Definition, Literal
from relgym.logic.facts import Bool, Facts, Float, compare

__all__ = ["World", "decide", "holds", "matches", "satisfiable", "solutions", "world_of"]

_Masks: TypeAlias = Any
"""Nested lists of bit masks, one level per fixed argument: Python has no type for "nested n times"."""


class World:
    """One relational state, laid out for `solutions`.

    Parameters
    ----------
    relations, numeric, relative
        As in `Facts`, without the axis of worlds.
    exists
        Shape (K,): which object slots are taken.

    Notes
    -----
    Masks are built when a literal first asks for them and kept: a handful of clauses touches few of the
    relations.
    """

    __slots__ = ("_exists", "_masks", "_numeric", "_powers", "_relations", "_relative", "objects", "slots")

    def __init__(
        self,
        relations: Mapping[str, Bool],
        exists: Bool,
        numeric: Mapping[str, Float] | None = None,
        relative: frozenset[str] = frozenset(),
    ) -> None:
        self._relations = relations
        self._exists = exists
        self._numeric = numeric or {}
        self._relative = relative
        self._powers: NDArray[Any] = _powers(len(exists))
        self._masks: dict[tuple[object, ...], _Masks] = {}
        self.objects = int(exists @ self._powers)
        """Bit mask of the objects that exist."""
        self.slots = len(exists)
        """Number of object slots, K."""

    def masks(self, literal: Literal, position: int) -> _Masks:
        """Return for which objects at a position a literal's test is true.

        `position` counts the literal's variables, so `ANY` arguments are left out. The result is a bit mask
        in as many nested lists as there are other variables, to be indexed by their objects; without any
        variable, 0 or 1. Negation is left aside.
        """
        key = (literal.relation, literal.args, literal.op, literal.threshold, position)
        found = self._masks.get(key)
        if found is None:
            found = self._masks[key] = self._build(literal, position)
        return found

    def _build(self, literal: Literal, position: int) -> _Masks:
        truth = self._truth(literal)
        if truth.ndim == 0:
            return int(truth)
        return (np.moveaxis(truth, position, -1) @ self._powers).tolist()

    def _truth(self, literal: Literal) -> Bool:
        known = self._relations if literal.op is None else self._numeric
        if literal.relation not in known:
            raise ConfigError(f"{literal}: expected one of {sorted(known)}.")
        if literal.op is None:
            truth = self._relations[literal.relation]
        else:
            truth = compare(self._numeric[literal.relation], literal)
        size = len(self._exists)
        for axis in range(truth.ndim):
            truth = truth & self._exists.reshape(
                [size if axis == other else 1 for other in range(truth.ndim)]
            )
        if literal.relation in self._relative:
            truth = np.broadcast_to(truth, (size, *truth.shape))
        quantified = tuple(axis for axis, arg in enumerate(literal.args) if arg == ANY)
        return np.asarray(truth.any(axis=quantified) if quantified else truth)


def _powers(size: int) -> NDArray[Any]:
    # of so many objects a mask outgrows int64, and Python's integers take over
    large = size >= np.iinfo(np.int64).bits - 1
    return np.array([1 << slot for slot in range(size)], dtype=object if large else np.int64)


@refusing(ConfigError)
def world_of(facts: Facts, index: int) -> World:
    """Return one of the worlds of `facts`."""
    whole("index", index, 0, facts.worlds, ConfigError)
    relations = {name: array[index] for name, array in facts.relations.items()}
    numeric = {name: np.asarray(array[index]) for name, array in facts.numeric.items()}
    return World(relations, facts.exists[index], numeric, facts.relative)


def solutions(clause: Clause, world: World, bound: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Yield every assignment of objects to the clause's variables that makes it true (§3.4.3).

    Parameters
    ----------
    clause
        What must hold.
    world
        The relational state.
    bound
        Objects of the target's arguments.

    Yields
    ------
    One object per variable, the target's arguments first. In order of the search, which is deterministic.

    Notes
    -----
    Backtracking with forward checking; the variable with the fewest remaining objects is bound first
    (*minimum remaining values*, ties to the lower number). Distinct variables may stand for the same object.
    """
    if len(bound) != clause.arity or not all(0 <= each < world.slots for each in bound):
        raise ConfigError(f"bound={bound!r}: expected {clause.arity} numbers of objects, below {world.slots}")
    fresh = clause.variables - clause.arity
    yield from _extend(clause.literals, world, [*bound, *[-1] * fresh], [world.objects] * clause.variables)


@refusing(ConfigError)
def satisfiable(clause: Clause, world: World, bound: Sequence[int]) -> bool:
    """Return whether some assignment makes the clause true, see `solutions`; a few µs for short clauses."""
    return next(solutions(clause, world, bound), None) is not None


@refusing(ConfigError)
def holds(definition: Definition, world: World, bound: Sequence[int]) -> bool:
    """Return whether a definition is true of the objects `bound`, its polarity taken into account."""
    return any(satisfiable(clause, world, bound) for clause in definition.clauses) != definition.negated


def _extend(
    literals: Sequence[Literal], world: World, values: list[int], domains: list[int]
) -> Iterator[tuple[int, ...]]:
    """Filter domains with the literals that have one open variable, then branch on the tightest."""
    waiting = []
    for literal in literals:
        variables = literal.variables
        unbound = [place for place, variable in enumerate(variables) if values[variable] < 0]
        if len(unbound) > 1:
            waiting.append(literal)
            continue
        position = unbound[0] if unbound else max(len(variables) - 1, 0)
        masks = world.masks(literal, position)
        for place, variable in enumerate(variables):
            if place != position:
                masks = masks[values[variable]]
        if unbound:
            domains[variables[position]] &= ~masks if literal.negated else masks
        elif bool(masks >> values[variables[position]] & 1 if variables else masks) == literal.negated:
            return
    free = [variable for variable, value in enumerate(values) if value < 0]
    if not free:
        yield tuple(values)
        return
    tightest = min(free, key=lambda variable: (domains[variable].bit_count(), variable))
    for slot in _bits(domains[tightest]):
        longer = values.copy()
        longer[tightest] = slot
        yield from _extend(waiting, world, longer, domains.copy())


def _bits(mask: int) -> Iterator[int]:
    while mask:
        lowest = mask & -mask
        yield lowest.bit_length() - 1
        mask ^= lowest
