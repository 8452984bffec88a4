"""One-against-one voting (§3.4.3): the winner is the mode that most pairs, or the surest ones, vote for.

Votes are integers, so that single and batch evaluation agree bit for bit whatever the order of summation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from relgym.classification.binary import VOTE_UNIT, BinaryClassifier
from relgym.classification.examples import Bools, Example, ExampleBatch, Floats, Vocabulary
from relgym.classification.familiarity import Familiarity
from relgym.classification.plans import Key, Planner
from relgym.classification.ranking import Ranking, RankingBatch, Verdict, verdict
from relgym.classification.views import View

__all__ = ["Voting"]


class Voting:
    """Counts the votes of a set of binary classifiers; holds only caches.

    Parameters
    ----------
    vocabulary
        Names of what examples hold.
    modes
        Mode ids in the order of the values that come with an example.
    how
        Soft or hard votes.
    """

    def __init__(self, vocabulary: Vocabulary, modes: tuple[int, ...], how: Literal["soft", "hard"]) -> None:
        self.modes = modes
        self.how: Literal["soft", "hard"] = how
        self._planner = Planner(vocabulary, modes)
        self.set_pairs(())

    def set_pairs(self, classifiers: Sequence[BinaryClassifier]) -> None:
        """Set the classifiers, in order."""
        self._classifiers = tuple(classifiers)
        self._places = [(self.modes.index(c.i), self.modes.index(c.j)) for c in classifiers]
        self._votes = [c.votes(self.how) for c in classifiers]
        self._planner.set_pairs(self._classifiers)

    def recount(self, pair: int) -> None:
        """Read one classifier's counts again."""
        self._votes[pair] = self._classifiers[pair].votes(self.how)

    def outcomes(self, example: Example, values: Sequence[float]) -> list[int]:
        """Number of the outcome of every pair."""
        return self._planner.outcomes(example, values)

    def key(self, example: Example) -> Key:
        """Identifies what the classifiers can see of an example's relations."""
        return self._planner.plan(example).key

    def rank(
        self, example: Example, values: Sequence[float], counts: Mapping[int, float], known: Familiarity
    ) -> Ranking:
        """Rank the modes for one example; ties go to the mode with more examples, then to the lower id."""
        if not self.modes:
            return Ranking((), (), 0.0, False, False)
        plan = self._planner.plan(example)
        outcomes = self._planner.run(plan, example, values)
        modes, scores = self.modes, [0] * len(self.modes)
        for (a, b), votes, outcome in zip(self._places, self._votes, outcomes, strict=True):
            for_a, for_b = votes[outcome]
            scores[a] += for_a
            scores[b] += for_b
        order = sorted(range(len(modes)), key=lambda m: (-scores[m], -counts[modes[m]], modes[m]))
        seen = known.is_seen(example, plan.key)
        return Ranking(
            modes=tuple([modes[m] for m in order]),
            scores=tuple([scores[m] / VOTE_UNIT for m in order]),
            margin=(scores[order[0]] - scores[order[1]]) / VOTE_UNIT if len(order) > 1 else math.inf,
            familiar=seen or self._spoke(modes[order[0]], outcomes),
            seen=seen,
        )

    def rank_batch(
        self, batch: ExampleBatch, values: Floats, counts: Mapping[int, float], known: Familiarity
    ) -> RankingBatch:
        """Rank the modes for n examples; equal to `rank` of each."""
        n, m = len(batch), len(self.modes)
        if not m:
            none, no = np.empty((n, 0)), np.zeros(n, dtype=np.bool_)
            return RankingBatch(none.astype(np.int64), none, np.zeros(n), no, no)
        view = View.of_batch(batch, self.modes, np.asarray(values, dtype=np.float64))
        scores, spoken = self._scores(view)
        by_tie = sorted(range(m), key=lambda k: (-counts[self.modes[k]], self.modes[k]))
        order = np.array(by_tie)[np.argsort(-scores[:, by_tie], axis=1, kind="stable")]
        ranked = np.take_along_axis(scores, order, axis=1)
        margin = (ranked[:, 0] - ranked[:, 1]) / VOTE_UNIT if m > 1 else np.full(n, math.inf)
        seen = known.is_seen_batch(view)
        familiar = seen | spoken[np.arange(n), order[:, 0]]
        return RankingBatch(np.array(self.modes)[order], ranked / VOTE_UNIT, margin, familiar, seen)

    def verdicts(self, example: Example, values: Sequence[float], ranked: tuple[int, ...]) -> list[Verdict]:
        """How the first of some ranked modes fared against each of the others."""
        found = {}
        for classifier, outcome in zip(self._classifiers, self.outcomes(example, values), strict=True):
            if ranked[0] in (classifier.i, classifier.j):
                rival = classifier.j if ranked[0] == classifier.i else classifier.i
                found[rival] = verdict(classifier, outcome)
        return [found[mode] for mode in ranked[1:]]

    def _scores(self, view: View) -> tuple[NDArray[np.int64], Bools]:
        """Votes of every mode, and whether a clause spoke for it, both of shape ``(n, M)``."""
        rows = np.arange(len(view))
        scores = np.zeros((len(view), len(self.modes)), dtype=np.int64)
        spoken = np.zeros(scores.shape, dtype=np.bool_)
        for (a, b), votes, classifier in zip(self._places, self._votes, self._classifiers, strict=True):
            outcome = classifier.decide_batch(view, rows)
            gained = np.array(votes, dtype=np.int64)[outcome]
            scores[:, a] += gained[:, 0]
            scores[:, b] += gained[:, 1]
            last = len(classifier.definition.clauses)
            by_clause = np.array([o.stage < last for o in classifier.outcomes])
            spoken[:, a if classifier.positive == classifier.i else b] |= by_clause[outcome]
        return scores, spoken

    def _spoke(self, mode: int, outcomes: Sequence[int]) -> bool:
        """Whether a clause of some pair spoke for a mode."""
        for classifier, outcome in zip(self._classifiers, outcomes, strict=True):
            if classifier.positive == mode:
                if classifier.outcomes[outcome].stage < len(classifier.definition.clauses):
                    return True
        return False
