"""Results of voting: which mode holds, by what margin, and which clause decided (§3.4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import Bools, Floats
from relgym.logic.clause import Clause

__all__ = ["Ranking", "RankingBatch", "Verdict", "verdict"]


@dataclass(frozen=True, slots=True)
class Verdict:
    """How one pair of modes was decided.

    Parameters
    ----------
    winner, runner_up
        Mode ids.
    clause
        The clause that fired; none: no clause did.
    tree
        The tests of the decision tree that had the last word, if one had.
    correct, incorrect
        Training examples that went the same way, of the winner and of the runner-up.
    """

    winner: int
    runner_up: int
    clause: Clause | None
    tree: str
    correct: float
    incorrect: float

    @property
    def probability(self) -> float:
        """Laplace's estimate that the winner is right."""
        return (self.correct + 1.0) / (self.correct + self.incorrect + 2.0)


def verdict(classifier: BinaryClassifier, outcome: int) -> Verdict:
    """How a classifier's decision with this outcome number came about."""
    taken, for_i = classifier.outcomes[outcome], classifier.for_i[outcome]
    clauses = classifier.definition.clauses
    clause = clauses[taken.stage] if taken.stage < len(clauses) else None
    tree = (*classifier.clause_trees, classifier.fall_through_tree)[taken.stage]
    text = "" if tree is None else tree.path(taken.leaf)
    winner, runner_up = (classifier.i, classifier.j) if for_i else (classifier.j, classifier.i)
    counts = classifier.counts[outcome]
    return Verdict(winner, runner_up, clause, text, counts[1 - for_i], counts[for_i])


@dataclass(frozen=True, slots=True)
class Ranking:
    """Modes ranked by votes.

    Parameters
    ----------
    modes
        Mode ids, the winner first; empty while there is no mode.
    scores
        Their votes in the first count: log-probabilities, or numbers of votes if votes are hard.
    margin
        Votes between winner and runner-up in the last count; infinite if there is one mode only.
    familiar
        False if no clause voted for the winner and nothing like the example was seen in training: the winner
        is a guess.
    """

    modes: tuple[int, ...]
    scores: tuple[float, ...]
    margin: float
    familiar: bool
    seen: bool


@dataclass(frozen=True, slots=True)
class RankingBatch:
    """`Ranking` of n examples; `modes` and `scores` have shape ``(n, M)``, the others ``(n,)``."""

    modes: NDArray[np.int64]
    scores: Floats
    margin: Floats
    familiar: Bools
    seen: Bools

    def __len__(self) -> int:
        return len(self.margin)

    def __getitem__(self, index: int) -> Ranking:
        modes, scores = tuple(self.modes[index].tolist()), tuple(self.scores[index].tolist())
        familiar, seen = bool(self.familiar[index]), bool(self.seen[index])
        return Ranking(modes, scores, float(self.margin[index]), familiar, seen)
