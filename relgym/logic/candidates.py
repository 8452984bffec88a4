"""Which literals may come next, and what each would leave of the positives and negatives (Quinlan 1990).

A clause under construction is the set of its *bindings*: for every tuple, the objects that its existential
variables may stand for. A candidate literal narrows or extends them. All candidates of one kind are counted
at once.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.logic import clause as logic
from relgym.logic.facts import Bool, Float, Int
from relgym.logic.tables import NumericStack, Tables, Template
from relgym.logic.thresholds import simplest_between

__all__ = ["EPS", "Block", "Counts", "Growing", "Score", "Weights", "blocks", "extend"]

_Tensor: TypeAlias = NDArray[np.float32]

EPS: Final = 1e-7
"""Weights below this are crumbs that sums of fractions leave where nothing is left."""

_CELLS: Final = 1 << 24
"""No new variable may make a clause's bindings larger than this."""


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """Weights of the tuples still to be told apart; 0 where an earlier clause decides.

    `first` and `second` belong to the first and the remaining tuples. The first ones are the positives,
    unless the classes are `swapped`.
    """

    first: Float
    second: Float
    swapped: bool = False

    def total(self, counts: NDArray[Any]) -> tuple[Float, Float]:
        """Sum counts of shape (…, n) over positives and over negatives."""
        split = len(self.first)
        # not by BLAS, whose sums may depend on its threads
        first = np.einsum("...n,n->...", counts[..., :split], self.first)
        return self.ordered(first, np.einsum("...n,n->...", counts[..., split:], self.second))

    def ordered(self, first: Float, second: Float) -> tuple[Float, Float]:
        """Put two results, of the first and of the second tuples, into the order positives, negatives."""
        return (second, first) if self.swapped else (first, second)


@dataclass(frozen=True, slots=True, eq=False)
class Counts:
    """What is left if a literal is added: weights of tuples, and of their bindings.

    Quinlan calls the bindings expanded tuples: `good` are those of positive tuples, `bad` those of negative
    ones.
    """

    positives: Float
    negatives: Float
    good: Float
    bad: Float

    @staticmethod
    def of(bindings: NDArray[Any], weights: Weights) -> Counts:
        """Count from the number of bindings left to each tuple, shape (…, n)."""
        return Counts(*weights.total(bindings > 0), *weights.total(bindings))

    def take(self, index: Any) -> Counts:
        """Return the counts at an index of all four arrays."""
        parts = (self.positives, self.negatives, self.good, self.bad)
        return Counts(*(np.asarray(part[index]) for part in parts))


@dataclass(frozen=True, slots=True)
class Score:
    """How good a literal is: FOIL's gain, or Algorithm 2's count of negatives filtered out.

    The gain is measured from the empty clause, so that clauses of different lengths compare:
    (weight of positives left) x (information of a positive before - after), over expanded tuples.
    """

    positives: float
    negatives: float
    choice: Literal["gain", "negatives"] = "gain"

    @property
    def information(self) -> float:
        """Bits that it takes to say of a tuple that it is positive, before any literal."""
        return float(np.log2((self.positives + self.negatives) / self.positives))

    def __call__(self, counts: Counts) -> Float:
        """Return the scores, rounded so that sums in another order rank the same."""
        some = counts.positives > EPS
        if self.choice == "negatives":
            return _rounded(np.where(some, self.negatives - counts.negatives, -np.inf))
        good = np.where(some, counts.good, 1.0)
        gain = counts.positives * (self.information - np.log2((good + np.maximum(counts.bad, 0.0)) / good))
        return _rounded(np.where(some, gain, -np.inf))


def _rounded(values: Float) -> Float:
    return np.round(values, 7)


@dataclass(frozen=True, slots=True, eq=False)
class Growing:
    """A clause under construction.

    Parameters
    ----------
    literals
        Its literals; existential variables are numbered from the target's arity, in the order of
        introduction.
    bindings
        Shape (K, …, K, n), one axis per existential variable.
    left
        Its counts, four numbers.
    """

    literals: tuple[logic.Literal, ...]
    bindings: Bool
    left: Counts

    @property
    def existentials(self) -> int:
        """Number of existential variables."""
        return self.bindings.ndim - 1

    def marginal(self, variables: Sequence[int]) -> _Tensor:
        """Return the number of bindings in which `variables` stand for given objects: shape (K, …, K, n)."""
        others = tuple(axis for axis in range(self.existentials) if axis not in variables)
        counts = self.bindings.sum(axis=others, dtype=np.float32) if others else self.bindings
        places = np.argsort(np.argsort(variables)).tolist()
        order = [places[place] for place in range(len(variables))]
        return np.ascontiguousarray(np.transpose(counts, (*order, len(variables))), dtype=np.float32)


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

    def literal(self, row: int) -> logic.Literal:
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

    @property
    def names(self) -> NDArray[np.str_]:
        """The candidates' relations or functions, shape (C,)."""
        return np.array([template.name for template in self.templates], dtype=np.str_)


def blocks(tables: Tables, growing: Growing, weights: Weights, score: Score, max_new: int) -> Iterator[Block]:
    """Yield every literal that may be added to a clause, with its counts.

    Parameters
    ----------
    tables, weights
        The learning problem.
    growing
        The clause so far.
    score
        Chooses the thresholds.
    max_new
        Most existential variables that the clause may have.
    """
    room = max_new - growing.existentials
    if growing.bindings.size * tables.facts.objects > _CELLS:
        room = 0
    for width in tables.widths:
        for variables in itertools.permutations(range(growing.existentials), width):
            yield from _relational(tables, growing, weights, variables, room)
    for width in tables.numeric_widths:
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
    """Thresholds on functions of objects that the clause already speaks of."""
    marginal = growing.marginal(variables)
    numbers = tuple(arity + variable for variable in variables)
    for op, counts in _Cuts(stack, marginal, weights).some():
        yield _best_cuts(stack, score, counts, numbers, arity + growing.existentials, op, negated=False)


def _free_numeric(
    stack: NumericStack, growing: Growing, weights: Weights, score: Score, tables: Tables
) -> Iterator[Block]:
    """Thresholds on functions of some object not spoken of yet, or of all objects."""
    total = growing.marginal(())
    fresh = tables.arity + growing.existentials
    cuts = _Cuts(stack, total * tables.exists.astype(np.float32), weights)
    for op, counts in cuts.some():
        yield _best_cuts(stack, score, counts, (fresh,), fresh, op, negated=False)
    for op, counts in cuts.none(total):
        yield _best_cuts(stack, score, counts, (logic.ANY,), fresh, op, negated=True)


def _best_cuts(
    stack: NumericStack,
    score: Score,
    counts: Counts,
    variables: tuple[int, ...],
    fresh: int,
    op: str,
    negated: bool,
) -> Block:
    """Choose each function's best threshold; among equally good ones, that in the widest gap."""
    gaps = stack.bins.gaps
    if not gaps.size:
        return Block((), variables, fresh, counts, negated, op)
    scores = np.where(np.isnan(gaps), -np.inf, score(counts))
    widest = np.where(scores >= scores.max(axis=1, keepdims=True), gaps, -np.inf)
    rows = np.arange(len(gaps))
    cut = np.argmax(np.where(np.isnan(gaps), -np.inf, widest), axis=1)
    ends = (stack.bins.high[rows, cut], stack.bins.low[rows, cut + 1])
    usable = np.flatnonzero(np.isfinite(ends[1]) & np.isfinite(scores[rows, cut]))
    chosen = counts.take((rows[usable], cut[usable]))
    templates = [stack.templates[row] for row in usable]
    return Block(templates, variables, fresh, chosen, negated, op, (ends[0][usable], ends[1][usable]))


class _Cuts:
    """Counts on either side of every threshold of every function in a stack, by histogram.

    Parameters
    ----------
    stack
        F functions in at most B bins.
    marginal
        Shape (K, …, K, n): number of bindings per choice of the functions' existential arguments.
    weights
        Weights of the tuples.
    """

    def __init__(self, stack: NumericStack, marginal: _Tensor, weights: Weights) -> None:
        self._count = stack.bins.count
        self._weights = weights
        size = marginal.shape[-1]
        index = stack.bins.index.reshape(len(stack.templates), -1, size)
        flat = marginal.reshape(-1, size)
        self._bindings = self._cumulative(index, np.broadcast_to(flat, index.shape))
        active = flat > 0
        self._lowest = np.where(active, index, self._count).min(axis=1)
        highest = np.where(active & (index < self._count), index, -1).max(axis=1)
        self._highest = np.where(highest < 0, self._count, highest)

    def some(self) -> Iterator[tuple[str, Counts]]:
        """Yield for each operator what is left if some binding must lie on that side."""
        good, bad = self._bindings
        low = self._cumulative(self._lowest, np.ones(self._lowest.shape))
        high = self._cumulative(self._highest, np.ones(self._highest.shape))
        yield "<=", Counts(low[0][:, :-1], low[1][:, :-1], good[:, :-1], bad[:, :-1])
        yield ">", Counts(_above(high[0]), _above(high[1]), _above(good), _above(bad))

    def none(self, total: _Tensor) -> Iterator[tuple[str, Counts]]:
        """Yield for each operator what is left if no object may lie on that side."""
        everything = Counts.of(total, self._weights)
        ones = np.ones(self._lowest.shape)
        expanded = np.broadcast_to(total, self._lowest.shape)
        for op, extreme in (("<=", self._lowest), (">", self._highest)):
            side = [
                part[:, :-1] if op == "<=" else _above(part)
                for counts in ((total > 0) * ones, expanded)
                for part in self._cumulative(extreme, counts)
            ]
            wholes = (everything.positives, everything.negatives, everything.good, everything.bad)
            yield op, Counts(*(whole - part for whole, part in zip(wholes, side, strict=True)))

    def _cumulative(self, index: NDArray[np.int32], counts: NDArray[Any]) -> tuple[Float, Float]:
        """Return, for positives and negatives, the weight in the bins up to each: shape (F, B)."""
        split = len(self._weights.first)
        first = self._histogram(index[..., :split], counts[..., :split] * self._weights.first)
        second = self._histogram(index[..., split:], counts[..., split:] * self._weights.second)
        return self._weights.ordered(first, second)

    def _histogram(self, index: NDArray[np.int32], weights: Float) -> Float:
        rows, bins = len(index), self._count + 1
        offset = (np.arange(rows) * bins).reshape(-1, *[1] * (index.ndim - 1))
        found = np.bincount((index + offset).ravel(), weights.ravel(), rows * bins)
        return np.cumsum(found.reshape(rows, bins)[:, :-1], axis=1)


def _above(cumulative: Float) -> Float:
    return cumulative[:, -1:] - cumulative[:, :-1]


def extend(tables: Tables, growing: Growing, literal: logic.Literal, counts: Counts) -> Growing:
    """Add a literal to a clause; `counts` are those of the candidate, four numbers."""
    truth = tables.truth(literal)
    axes = [variable - tables.arity for variable in literal.variables if variable >= tables.arity]
    width = max([growing.existentials, *[axis + 1 for axis in axes]])
    order = np.argsort(axes).tolist() if axes else []
    shape = [tables.facts.objects if axis in axes else 1 for axis in range(width)]
    truth = truth.transpose(*order, len(axes)).reshape(*shape, tables.size)
    bindings = growing.bindings
    bindings = bindings.reshape(*bindings.shape[:-1], *[1] * (width - growing.existentials), tables.size)
    literals = (*growing.literals, literal)
    return Growing(literals, bindings & truth, counts)
