"""FOIL's inner loop: grow a clause literal by literal, with alternatives (Algorithm 2, lines 6-12)."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ALTERNATIVES, CALL, ROUNDED, SAME_DIGITS
from relgym.config.logic import FoilConfig
from relgym.logic.candidates import Block, blocks
from relgym.logic.clause import Coverage
from relgym.logic.description import DescriptionLength
from relgym.logic.growing import Counts, Growing, Score, Weights, extend
from relgym.logic.tables import Tables
from relgym.logic.thresholds import signs_differ
from relgym.scheduling.work import Steps, resumable

__all__ = ["Harvest", "grow"]


@dataclass(frozen=True, slots=True, eq=False)
class Harvest:
    """The clauses that a search came across, and what it cost in tuples x candidate literals."""

    clauses: tuple[Growing, ...]
    work: int


@resumable
def grow(tables: Tables, weights: Weights, config: FoilConfig, length: DescriptionLength) -> Steps[Harvest]:
    """Search for clauses that cover positives and few negatives.

    Parameters
    ----------
    tables
        The learning problem.
    weights
        What is left of it. Some positive must have a positive weight.
    config
        Beam, lookahead and limits.
    length
        Bits of clauses; what can't pay for itself any more isn't grown.

    Returns
    -------
    Every clause that was ever in the beam, shorter ones first; the caller chooses.

    Notes
    -----
    Deviation from the thesis: Algorithm 2 is greedy. A beam, and beside it the clauses whose last literal
    *connects* (it introduces a variable), find conjunctions whose first literal gains nothing by itself.
    Among equal scores relations precede numeric literals, positive literals negated ones, fewer new variables
    more, more positives fewer, how things stand what they are; then the alphabet decides.
    Cost: depth x (beam + lookahead) x tuples x candidates x K^v.
    """
    everything = np.ones(tables.size, dtype=np.bool_)
    positives, negatives = weights.total(everything)
    whole = Coverage(float(positives), float(negatives))
    score = Score(whole.positives, whole.negatives, config.choice)
    beam = [Growing((), everything, Counts.of(everything, weights))]
    pool: dict[bytes, Growing] = {}
    worth: list[float] = []
    work = 0
    for depth in range(1, config.max_literals + 1):
        found = _Candidates(tables, beam, weights, score, config, length)
        work += tables.size * found.size
        yield 2 * CALL * found.groups + tables.size * found.size  # a group is laid out, and counted
        lookahead = config.lookahead if depth < config.max_literals else 0
        new = _new(found.best(), config.beam, pool) + _new(found.connecting(), lookahead, pool)
        beam = _promising(new, pool.values())
        if config.mdl:
            beam = [each for each in beam if _may_pay(each, tables.arity, length, whole)]
            values = (_worth(each, tables.arity, length, whole, score) for each in new)
            worth.append(max((*worth[-1:], *values), default=0.0))
        # Two literals in a row that tell nothing apart better end it; one that connects pays only with the next.
        if not beam or (len(worth) > 2 and worth[-1] <= worth[-3]):
            break
    return Harvest(tuple(pool.values()), work)


def _new(children: Iterator[Growing], wanted: int, pool: dict[bytes, Growing]) -> list[Growing]:
    """Take the first `wanted` clauses with other bindings than those in the pool, and add them to it."""
    taken: list[Growing] = []
    for child in itertools.islice(children, ALTERNATIVES * wanted):
        if len(taken) == wanted:
            break
        key = child.bindings.tobytes()
        if key not in pool:  # otherwise the same literals came in another order, or say the same
            pool[key] = child
            taken.append(child)
    return taken


def _promising(beam: Sequence[Growing], pool: Iterable[Growing]) -> list[Growing]:
    """Leave out clauses that can't cover more positives without negatives than a clause already does."""
    reached = max(
        (float(each.left.positives) for each in pool if each.left.negatives <= ROUNDED), default=0.0
    )
    return [each for each in beam if each.left.negatives > ROUNDED and each.left.positives > reached]


def _may_pay(growing: Growing, arity: int, length: DescriptionLength, whole: Coverage) -> bool:
    """Whether the clause would save bits if it lost its negatives for nothing."""
    best = Coverage(float(growing.left.positives), 0.0)
    return length.saving(length.literals(growing.literals, arity), best, whole) > 0


def _saving(growing: Growing, arity: int, length: DescriptionLength, whole: Coverage) -> float:
    """Bits that the clause saves as it is."""
    left = Coverage(float(growing.left.positives), float(growing.left.negatives))
    return length.saving(length.literals(growing.literals, arity), left, whole)


def _worth(growing: Growing, arity: int, length: DescriptionLength, whole: Coverage, score: Score) -> float:
    """Bits that the clause saves, or that its bindings do: they are told apart before the tuples are."""
    bits = length.literals(growing.literals, arity)
    return max(_saving(growing, arity, length, whole), float(score(growing.left)) - bits)


class _Candidates:
    """All literals that may be added to any clause of the beam, as parallel arrays."""

    def __init__(
        self,
        tables: Tables,
        beam: Sequence[Growing],
        weights: Weights,
        score: Score,
        config: FoilConfig,
        length: DescriptionLength,
    ) -> None:
        self._tables = tables
        self._length = length if config.mdl else None
        every = [
            (growing, block) for growing in beam for block in blocks(tables, growing, weights, score, config)
        ]
        self._blocks = [(growing, block) for growing, block in every if block.templates]
        self.groups = len(every)
        sizes = [len(block.templates) for _, block in self._blocks]
        self._ends = np.cumsum(sizes, dtype=np.int64)
        self.size = int(self._ends[-1]) if self._blocks else 0
        if self.size:
            counts = Counts.joined([block.counts for _, block in self._blocks])
            negated, numeric = (
                np.repeat([flag(block) for _, block in self._blocks], sizes)
                for flag in (lambda block: block.negated, lambda block: block.op is not None)
            )
            bindings = np.repeat([float(g.left.good + g.left.bad) for g, _ in self._blocks], sizes)
            self._introduced = self._join(Block.introduced)
            self._score = score(counts) - self._prices(sizes)
            self._positives = np.round(counts.positives, SAME_DIGITS)
            self._negatives = np.round(counts.negatives, SAME_DIGITS)
            # useful is what introduces a variable or leaves fewer bindings than there were
            fewer = bindings - counts.good - counts.bad > ROUNDED
            self._useful = (self._positives > ROUNDED) & ((self._introduced > 0) | fewer)
            names, of_one = self._join(lambda block: block.names), self._join(Block.of_one)
            self._ties = (names, of_one, -self._positives, self._introduced, negated, numeric)

    def _prices(self, sizes: Sequence[int]) -> NDArray[np.float64]:
        """Bits of the thresholds: a gain must pay for them, or numbers would stand in for plain relations."""
        if self._length is None:
            return np.zeros(self.size)
        paid = {id(g): sum(self._length.number(each) for each in g.literals) for g, _ in self._blocks}
        prices = np.repeat([float(paid[id(growing)]) for growing, _ in self._blocks], sizes)
        for (_, block), end, size in zip(self._blocks, self._ends, sizes, strict=True):
            if block.gaps is not None:
                signs = signs_differ(*block.gaps)
                prices[end - size : end] += np.where(signs, self._length.sign, self._length.threshold)
        return prices

    def _join(self, part: Callable[[Block], NDArray[Any]]) -> NDArray[Any]:
        return np.concatenate([part(block) for _, block in self._blocks])

    def best(self) -> Iterator[Growing]:
        """Yield the clauses extended by one literal, best score first."""
        return self._children(self._useful, (-self._score,)) if self.size else iter(())

    def connecting(self) -> Iterator[Growing]:
        """Yield the clauses extended by a relation with a new variable, those that lose least first."""
        if not self.size:
            return iter(())
        return self._children(
            self._useful & (self._introduced > 0) & ~self._ties[-1],
            (-self._score, self._negatives, -self._positives),
        )

    def _children(self, mask: NDArray[np.bool_], keys: Sequence[NDArray[Any]]) -> Iterator[Growing]:
        rows = np.flatnonzero(mask)
        order = np.lexsort([key[rows] for key in (*self._ties, *keys)])
        return (self._child(int(index)) for index in rows[order])

    def _child(self, index: int) -> Growing:
        place = int(np.searchsorted(self._ends, index, side="right"))
        growing, block = self._blocks[place]
        row = index - int(self._ends[place]) + len(block.templates)
        return extend(self._tables, growing, block.literal(row), block.counts.take(row))
