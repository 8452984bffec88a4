"""The classifier of one pair of modes: a waterfall of clauses and decision trees (§3.4.4, Fig. 3.6)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import Bools, Floats
from relgym.classification.views import Context, Scope, View, bound_features
from relgym.config.constants import RESOLUTION
from relgym.logic.clause import Definition
from relgym.logic.csp import matches
from relgym.numeric.tree import DecisionTree

__all__ = ["VOTE_UNIT", "BinaryClassifier", "Outcome"]

VOTE_UNIT: Final = RESOLUTION
"""Votes are counted in integer multiples of one over this: their sums are exact, whatever the order of summation."""

_Rows = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Outcome:
    """A way to get through the waterfall.

    Parameters
    ----------
    stage
        Number of the clause that fired; the number of clauses for the fall-through.
    leaf
        Leaf of the stage's decision tree; -1 if it has none.
    positive
        Whether the class that the clauses describe is chosen.
    """

    stage: int
    leaf: int
    positive: bool


@dataclass(eq=False)
class BinaryClassifier:
    """Tells mode `i` from mode `j`.

    Parameters
    ----------
    i, j
        Mode ids.
    scope
        Names it may use.
    context
        Which objects its clauses mention.
    definition
        Clauses for mode `i`, or for mode `j` if it is negated (§3.4.5).
    clause_trees
        Decision tree of each clause, where one was needed (§3.4.4).
    fall_through_tree
        Decision tree of the examples that no clause covers, if needed.
    counts
        Examples of `i` and `j` that took each outcome, shape ``(outcomes, 2)``; empty: none yet.
    work
        Work spent in learning, in FOIL's units.
    """

    i: int
    j: int
    scope: Scope
    context: Context
    definition: Definition
    clause_trees: tuple[DecisionTree | None, ...] = ()
    fall_through_tree: DecisionTree | None = None
    counts: list[list[float]] = field(default_factory=list)
    work: int = 0

    def __post_init__(self) -> None:
        self.clause_trees = self.clause_trees or (None,) * len(self.definition.clauses)
        self.counts = self.counts or [[0.0, 0.0] for _ in self.outcomes]

    @property
    def positive(self) -> int:
        """Mode that the clauses describe."""
        return self.j if self.definition.negated else self.i

    @cached_property
    def outcomes(self) -> tuple[Outcome, ...]:
        """All ways through the waterfall; their positions number them."""
        found = []
        for stage, tree in enumerate(self.clause_trees):
            leaves = (-1,) if tree is None else tuple(leaf for leaf in tree.leaves if tree.says_yes(leaf))
            found += [Outcome(stage, leaf, True) for leaf in leaves]
        last, tree = len(self.clause_trees), self.fall_through_tree
        if tree is None:
            return (*found, Outcome(last, -1, False))
        return (*found, *(Outcome(last, leaf, tree.says_yes(leaf)) for leaf in tree.leaves))

    @cached_property
    def outcome_of(self) -> dict[tuple[int, int], int]:
        """Number of the outcome of a (stage, leaf)."""
        return {(outcome.stage, outcome.leaf): number for number, outcome in enumerate(self.outcomes)}

    @cached_property
    def for_i(self) -> tuple[bool, ...]:
        """Whether each outcome decides for mode `i`."""
        if not self.definition.clauses and self.fall_through_tree is None:
            # No clause at all: whoever has more examples, `i` if nothing is known.
            return (self.counts[0][0] >= self.counts[0][1],)
        return tuple(outcome.positive != self.definition.negated for outcome in self.outcomes)

    def tree_columns(self, stage: int) -> tuple[str, ...]:
        """Features of a stage's tree: the scalars, then the pair features of the objects its clause binds."""
        if stage == len(self.definition.clauses):
            return self.scope.scalars
        return tree_columns(self.scope, self.definition.clauses[stage].variables)

    def decide_batch(self, view: View, rows: _Rows) -> NDArray[np.int64]:
        """Outcome number of each of some rows of a view, shape ``(len(rows),)``."""
        result = np.full(len(rows), -1, dtype=np.int64)
        facts = view.facts(self.context, self.scope)
        undecided = np.arange(len(rows))
        for stage, clause in enumerate(self.definition.clauses):
            if not len(undecided):
                break
            here = undecided[matches(clause, facts, view.tuples(rows[undecided]))]
            result[here] = self._leaves(stage, view, rows[here])
            undecided = undecided[result[undecided] < 0]
        result[undecided] = self._leaves(len(self.definition.clauses), view, rows[undecided])
        return result

    def _leaves(self, stage: int, view: View, rows: _Rows) -> NDArray[np.int64]:
        """Outcomes of rows that reached a stage; -1 where its tree says no and the waterfall goes on."""
        clauses = self.definition.clauses
        tree = self.clause_trees[stage] if stage < len(clauses) else self.fall_through_tree
        if tree is None:
            return np.full(len(rows), self.outcome_of[stage, -1], dtype=np.int64)
        clause = clauses[stage] if stage < len(clauses) else None
        features = tree_features(view, self.scope, self.context, clause, rows)
        numbers = [self.outcome_of.get((stage, node), -1) for node in range(len(tree.column))]
        return np.array(numbers, dtype=np.int64)[tree.leaf_batch(features)]

    def says_i_batch(self, view: View, rows: _Rows) -> Bools:
        """Whether each row is taken for mode `i`."""
        return np.array(self.for_i)[self.decide_batch(view, rows)]

    def count(self, outcome: int, is_i: bool, weight: float = 1.0) -> None:
        """Count one more example that took an outcome, and stands for so many."""
        self.counts[outcome][not is_i] += weight
        if not self.definition.clauses:
            self.__dict__.pop("for_i", None)  # a majority may have changed sides

    def recount(self, view: View, rows: _Rows, is_i: Bools, weights: Floats) -> float:
        """Count outcomes anew; the weight of the rows that are decided wrongly."""
        outcome = self.decide_batch(view, rows)
        for_i, for_j = np.where(is_i, weights, 0.0), np.where(is_i, 0.0, weights)
        columns = [np.bincount(outcome, w, minlength=len(self.outcomes)) for w in (for_i, for_j)]
        self.counts = np.column_stack(columns).tolist()
        self.__dict__.pop("for_i", None)
        return float(weights[np.array(self.for_i)[outcome] != is_i].sum())

    @property
    def votes(self) -> list[tuple[int, int]]:
        """What each outcome gives to mode `i` and to mode `j`, in `VOTE_UNIT` (§3.4.3).

        The logarithms of Laplace's (n_i + 1) / (n_i + n_j + 2) and of its complement, so that one unsure pair decides
        nothing; the thesis gave one vote each.
        """
        return [_log_votes(n_i, n_j) for n_i, n_j in self.counts]

    def describe(self) -> list[tuple[str, float, float, bool]]:
        """Rows of the thesis' tables 3.2 and 4.3: (clause, correct, incorrect, has a numeric classifier).

        The last row, "Negative", counts the examples that no clause covers.
        """
        trees = (*self.clause_trees, self.fall_through_tree)
        names = [*map(str, self.definition.clauses), "Negative"]
        rows = []
        for stage, (name, tree) in enumerate(zip(names, trees, strict=True)):
            right, wrong = 0.0, 0.0
            for outcome, counts, yes in zip(self.outcomes, self.counts, self.for_i, strict=True):
                if outcome.stage == stage:
                    right, wrong = right + counts[1 - yes], wrong + counts[yes]
            rows.append((name, right, wrong, tree is not None))
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON-able dictionary; the scope follows from vocabulary and config and isn't stored."""
        trees = [tree and tree.to_dict() for tree in (*self.clause_trees, self.fall_through_tree)]
        definition = self.definition.to_dict()
        pair = {"i": self.i, "j": self.j, "context": self.context}
        return pair | {"definition": definition, "trees": trees, "counts": self.counts}

    @classmethod
    def from_dict(cls, data: dict[str, Any], scope: Scope) -> BinaryClassifier:
        """Inverse of `to_dict`."""
        *clauses, last = [tree and DecisionTree.from_dict(tree) for tree in data["trees"]]
        definition = Definition.from_dict(data["definition"])
        counts = [[float(n) for n in row] for row in data["counts"]]
        i, j, context = int(data["i"]), int(data["j"]), data["context"]
        return cls(i, j, scope, context, definition, tuple(clauses), last, counts)


def tree_columns(scope: Scope, variables: int) -> tuple[str, ...]:
    """Names of a tree's features for a clause with this many variables, the target included."""
    bound = [f"{name}(A, {chr(ord('A') + v)})" for v in range(1, variables) for name, _ in scope.pair]
    return (*scope.scalars, *bound)


def tree_features(view: View, scope: Scope, context: Context, clause: Any, rows: _Rows) -> Floats:
    """Features of a tree, shape ``(len(rows), columns)``; `clause` is none for the fall-through."""
    scalars = view.scalars(scope)[rows]
    if clause is None:
        return scalars
    bound = bound_features(clause, view, view.facts(context, scope), scope, rows)
    return np.concatenate([scalars, bound], axis=1)


def _log_votes(n_i: float, n_j: float) -> tuple[int, int]:
    total = n_i + n_j + 2.0
    first, second = math.log((n_i + 1.0) / total), math.log((n_j + 1.0) / total)
    return round(first * VOTE_UNIT), round(second * VOTE_UNIT)


def majority(i: int, j: int, scope: Scope, counts: Sequence[float]) -> BinaryClassifier:
    """A pair without any clause: it votes for the mode with more examples, all that is known of it."""
    return BinaryClassifier(i, j, scope, "touching", Definition(()), counts=[list(counts)])
