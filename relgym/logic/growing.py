"""A clause under construction: its bindings, its counts and its score (Quinlan 1990).

The *bindings* of a clause are, for every tuple, the objects that its existential variables may stand for. A
literal narrows or extends them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ROUNDED, SAME_DIGITS
from relgym.logic import clause as logic
from relgym.logic.facts import Bool, Float
from relgym.logic.tables import Tables

__all__ = ["Counts", "Growing", "Score", "Tensor", "Weights", "extend"]

Tensor: TypeAlias = NDArray[np.float32]
"""Numbers of bindings; small integers, exact in float32."""


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

    @staticmethod
    def joined(parts: Sequence[Counts]) -> Counts:
        """Put the counts of several lists of literals behind each other."""
        return Counts(
            *(
                np.concatenate([getattr(part, name) for part in parts])
                for name in ("positives", "negatives", "good", "bad")
            )
        )

    def take(self, index: Any) -> Counts:
        """Return the counts at an index of all four arrays."""
        parts = (self.positives, self.negatives, self.good, self.bad)
        return Counts(*(np.asarray(part[index]) for part in parts))


class Score:
    """How good a literal is: FOIL's gain, or Algorithm 2's count of negatives filtered out.

    The gain is measured from the empty clause, so that clauses of different lengths compare:
    (weight of positives left) x (information of a positive before - after), over expanded tuples.

    Parameters
    ----------
    positives, negatives
        Weights of the tuples before any literal.
    choice
        What is maximised.

    Attributes
    ----------
    information : float
        Bits that it takes to say of a tuple that it is positive, before any literal.
    """

    def __init__(
        self, positives: float, negatives: float, choice: Literal["gain", "negatives"] = "gain"
    ) -> None:
        self._negatives, self._choice = negatives, choice
        self.information = float(np.log2((positives + negatives) / positives))

    def __call__(self, counts: Counts) -> Float:
        """Return the scores, rounded so that sums in another order rank the same."""
        some = counts.positives > ROUNDED
        if self._choice == "negatives":
            return _rounded(np.where(some, self._negatives - counts.negatives, -np.inf))
        good = np.where(some, counts.good, 1.0)
        gain = counts.positives * (self.information - np.log2((good + np.maximum(counts.bad, 0.0)) / good))
        return _rounded(np.where(some, gain, -np.inf))


def _rounded(values: Float) -> Float:
    return np.round(values, SAME_DIGITS)


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

    def marginal(self, variables: Sequence[int]) -> Tensor:
        """Return the number of bindings in which `variables` stand for given objects: shape (K, …, K, n)."""
        others = tuple(axis for axis in range(self.existentials) if axis not in variables)
        counts = self.bindings.sum(axis=others, dtype=np.float32) if others else self.bindings
        places = np.argsort(np.argsort(variables)).tolist()
        order = [places[place] for place in range(len(variables))]
        return np.ascontiguousarray(np.transpose(counts, (*order, len(variables))), dtype=np.float32)


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
