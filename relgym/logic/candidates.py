"""Which literals may come next, and what each would leave of the positives and negatives (Quinlan 1990).

All candidates of one kind are counted at once.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import MOST_BYTES
from relgym.config.logic import FoilConfig
from relgym.logic.clause import ANY, Literal
from relgym.logic.cuts import Cuts, best_cuts
from relgym.logic.facts import Float, Int
from relgym.logic.growing import Counts, Growing, Score, Weights
from relgym.logic.tables import NumericStack, Tables
from relgym.logic.templates import Template
from relgym.logic.thresholds import simplest_between

__all__ = ["Block", "blocks"]


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Candidate literals of one kind: the same variables, sign and operator, but other relations."""

    templates: Sequence[Template]
    variables: tuple[int, ...]
    fresh: int
    counts: Counts
    negated: bool = False
    op: str | None = None
    gaps: tuple[Float, Float] | None = None

    def literal(self, row: int) -> Literal:
        """Return a candidate's literal."""
        threshold = 0.0
        if self.gaps is not None:
            threshold = simplest_between(float(self.gaps[0][row]), float(self.gaps[1][row]))
        return self.templates[row].literal(self.variables, self.fresh, self.negated, self.op, threshold)

    def introduced(self) -> Int:
        """Return how many new variables each candidate introduces, shape (C,)."""
        if self.negated:
            return np.zeros(len(self.templates), dtype=np.int64)
        free = sum(variable >= self.fresh for variable in self.variables)
        return np.array([free + template.fresh for template in self.templates], dtype=np.int64)

    def of_one(self) -> NDArray[np.bool_]:
        """Return which candidates say what a single object is, rather than how two stand, shape (C,)."""
        return np.array([self.op is None and len(template.slots) <= 1 for template in self.templates])

    @property
    def names(self) -> NDArray[np.str_]:
        """The candidates' relations or functions, shape (C,)."""
        return np.array([template.name for template in self.templates], dtype=np.str_)


def blocks(
    tables: Tables, growing: Growing, weights: Weights, score: Score, config: FoilConfig
) -> Iterator[Block]:
    """Yield every literal that may be added to a clause, with its counts.

    Parameters
    ----------
    tables, weights
        The learning problem.
    growing
        The clause so far.
    score
        Chooses the thresholds.
    config
        Tells how many existential variables the clause may have, and whether thresholds are among the literals.
    """
    room = config.max_new_variables - growing.existentials
    if growing.bindings.size * tables.facts.objects > MOST_BYTES:
        room = 0
    for width in tables.widths:
        for variables in itertools.permutations(range(growing.existentials), width):
            yield from _relational(tables, growing, weights, variables, room)
    for width in tables.numeric_widths if config.numeric else ():
        stack = tables.numeric_stack(width)
        for variables in itertools.permutations(range(growing.existentials), width):
            yield from _bound_numeric(stack, growing, weights, score, variables, tables.arity)
        if width == 1 and room > 0:
            yield from _free_numeric(stack, growing, weights, score, tables)


def _relational(
    tables: Tables, growing: Growing, weights: Weights, variables: tuple[int, ...], room: int
) -> Iterator[Block]:
    stack = tables.stack(len(variables))
    if not stack.templates:
        return
    marginal = growing.marginal(variables).reshape(-1, tables.size)
    left = np.einsum("kn,fkn->fn", marginal, stack.truth.reshape(len(stack.templates), -1, tables.size))
    numbers = tuple(tables.arity + variable for variable in variables)
    fresh = tables.arity + growing.existentials
    none = Counts.of(marginal.sum(axis=0) - left, weights)
    yield Block(stack.templates, numbers, fresh, none, negated=True)
    if stack.fresh.size:
        counts = stack.counts.reshape(stack.fresh.size, -1, tables.size)
        left[stack.fresh] = np.einsum("kn,fkn->fn", marginal, counts)
    some = Counts.of(left, weights)
    fits = [row for row, template in enumerate(stack.templates) if template.fresh <= max(room, 0)]
    yield Block([stack.templates[row] for row in fits], numbers, fresh, some.take(fits))


def _bound_numeric(
    stack: NumericStack,
    growing: Growing,
    weights: Weights,
    score: Score,
    variables: tuple[int, ...],
    arity: int,
) -> Iterator[Block]:
    """Thresholds on functions of objects that the clause already mentions."""
    cuts = Cuts(stack, growing.marginal(variables), weights)
    numbers = tuple(arity + variable for variable in variables)
    for op, counts in cuts.some():
        yield _thresholds(stack, score, counts, numbers, arity + growing.existentials, op)


def _free_numeric(
    stack: NumericStack, growing: Growing, weights: Weights, score: Score, tables: Tables
) -> Iterator[Block]:
    """Thresholds on functions of some object not mentioned yet, or of all objects."""
    total = growing.marginal(())
    fresh = tables.arity + growing.existentials
    cuts = Cuts(stack, total * tables.exists.astype(np.float32), weights)
    for op, counts in cuts.some():
        yield _thresholds(stack, score, counts, (fresh,), fresh, op)
    for op, counts in cuts.none(total):
        yield _thresholds(stack, score, counts, (ANY,), fresh, op)


def _thresholds(
    stack: NumericStack, score: Score, counts: Counts, variables: tuple[int, ...], fresh: int, op: str
) -> Block:
    rows, cut = best_cuts(stack.bins, score, counts)
    templates = [stack.templates[row] for row in rows]
    gaps = (stack.bins.high[rows, cut], stack.bins.low[rows, cut + 1])
    return Block(templates, variables, fresh, counts.take((rows, cut)), ANY in variables, op, gaps)
