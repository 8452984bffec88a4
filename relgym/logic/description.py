"""Description length: what a clause costs to write down, and what its exceptions cost.

A definition is worth having if telling it and then the tuples that it gets wrong takes fewer bits than
telling all labels one by one. Rare positives are dear to list, so they earn a clause early; a flipped label
is cheaper to list than any clause that would single it out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from relgym.logic.clause import Clause, Coverage, Literal

__all__ = ["DescriptionLength"]


class DescriptionLength:
    """Bits of clauses and exceptions, for one vocabulary.

    Parameters
    ----------
    names
        How many relations and numeric functions a literal chooses from.
    values
        How many thresholds a numeric literal chooses from.
    evidence
        Weight of a typical tuple, >= 1. A tuple that stands for twenty is evidence of its relations twenty
        times, of its numbers but once: the other nineteen had others. So thresholds cost this much more.
    """

    def __init__(self, names: int, values: int, evidence: float = 1.0) -> None:
        self._name = math.log2(max(names, 1))
        self.threshold = math.log2(max(values, 1) + 1.0) * evidence
        """Bits of one threshold."""
        self.sign = evidence
        """Bits of the threshold zero: there is nothing to choose but to take it."""

    def clause(self, clause: Clause) -> float:
        """Return a clause's bits, see `literals`."""
        return self.literals(clause.literals, clause.arity)

    def literals(self, literals: Sequence[Literal], arity: int) -> float:
        """Return a conjunction's bits: names, signs, arguments and thresholds; the order is free.

        What a single thing is costs as much as how two stand. By its arguments alone it would be cheaper, and a
        clause that mentions kinds says nothing of other kinds that stand the same way.
        """
        bits, variables = 0.0, arity
        for literal in literals:
            arguments = len(literal.args) if literal.op is not None else max(len(literal.args), 2)
            # one argument is any variable so far, a new one or *
            bits += 1.0 + self._name + arguments * math.log2(variables + 1.0)
            bits += self.number(literal)
            variables = max(variables, max(literal.variables, default=-1) + 1)
        return bits - math.lgamma(len(literals) + 1.0) / math.log(2.0)

    def number(self, literal: Literal) -> float:
        """Return the bits of a literal's threshold, 0 if it has none."""
        if literal.op is None:
            return 0.0
        return self.sign if literal.threshold == 0.0 else self.threshold

    def clauses(self, clauses: Iterable[Clause]) -> float:
        """Return the bits of several clauses, whose order is free too."""
        costs = [self.clause(clause) for clause in clauses]
        return max(sum(costs) - math.lgamma(len(costs) + 1.0) / math.log(2.0), 0.0)

    @staticmethod
    def exceptions(total: float, wrong: float) -> float:
        """Return the bits to say which `wrong` of `total` tuples are exceptions; weights may be fractions."""
        total, wrong = max(total, 0.0), min(max(wrong, 0.0), total)
        subsets = math.lgamma(total + 1.0) - math.lgamma(wrong + 1.0) - math.lgamma(total - wrong + 1.0)
        return math.log2(total + 1.0) + max(subsets, 0.0) / math.log(2.0)

    def saving(self, bits: float, covered: Coverage, whole: Coverage) -> float:
        """Return what a clause of so many bits saves: what is listed without it, less it and what is left."""
        rest = Coverage(whole.positives - covered.positives, whole.negatives - covered.negatives)
        after = self.exceptions(covered.total, covered.negatives) + self.exceptions(
            rest.total, rest.positives
        )
        return self.exceptions(whole.total, whole.positives) - after - bits

    def definition(self, clauses: Iterable[Clause], covered: Coverage, uncovered: Coverage) -> float:
        """Return the bits of a definition together with its false positives and false negatives."""
        wrong = self.exceptions(covered.total, covered.negatives)
        return self.clauses(clauses) + wrong + self.exceptions(uncovered.total, uncovered.positives)
