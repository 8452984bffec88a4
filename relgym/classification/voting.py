"""One-against-one voting (§3.4.3): the winner is the mode that most pairs, or the surest ones, vote for.

Votes are integers, so that single and batch evaluation agree bit for bit whatever the order of summation.

Deviation from the thesis
-------------------------
Two modes are told apart by what tells *their* examples apart; of any other situation their pair says something
arbitrary, and says it with confidence. In a run-off it is not heard: the mode with fewest votes drops out, and the
votes of the others' pairs are counted again, until one is left (Baldwin's method). A mode that wins all its pairs
always wins.

References
----------
J. M. Baldwin, "The technique of the Nanson preferential majority system of election", Proceedings of the Royal
Society of Victoria 39 (1926).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from relgym.classification.binary import VOTE_UNIT, BinaryClassifier
from relgym.classification.examples import Bools, Example, ExampleBatch, Floats, Vocabulary
from relgym.classification.familiarity import Familiarity
from relgym.classification.plans import Key, Planner
from relgym.classification.ranking import Ranking, RankingBatch, Verdict, verdict
from relgym.classification.views import View

__all__ = ["Voting", "run_off_batch"]


class Voting:
    """Counts the votes of a set of binary classifiers; holds only caches.

    Parameters
    ----------
    vocabulary
        Names of what examples hold.
    modes
        Mode ids in the order of the values that come with an example.
    """

    def __init__(self, vocabulary: Vocabulary, modes: tuple[int, ...]) -> None:
        self.modes = modes
        self._planner = Planner(vocabulary, modes)
        self.set_pairs(())

    def set_pairs(self, classifiers: Sequence[BinaryClassifier]) -> None:
        """Set the classifiers, in order."""
        self._classifiers = tuple(classifiers)
        self._places = [(self.modes.index(c.i), self.modes.index(c.j)) for c in classifiers]
        self._votes = [c.votes for c in classifiers]
        self._planner.set_pairs(self._classifiers)

    def recount(self, pair: int) -> None:
        """Read one classifier's counts again."""
        self._votes[pair] = self._classifiers[pair].votes

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
        cast = [votes[outcome] for votes, outcome in zip(self._votes, outcomes, strict=True)]
        for (a, b), (for_a, for_b) in zip(self._places, cast, strict=True):
            scores[a] += for_a
            scores[b] += for_b
        order, margin = self._run_off(cast, self._by_tie(counts))
        seen = known.is_seen(example, plan.key)
        return Ranking(
            modes=tuple([modes[m] for m in order]),
            scores=tuple([scores[m] / VOTE_UNIT for m in order]),
            margin=math.inf if margin is None else margin / VOTE_UNIT,
            familiar=seen or self._spoke(modes[order[0]], outcomes),
            seen=seen,
        )

    def rank_batch(
        self, batch: ExampleBatch, values: Floats, counts: Mapping[int, float], known: Familiarity
    ) -> RankingBatch:
        """Rank the modes for n examples; equal to `rank` of each."""
        n = len(batch)
        if not self.modes:
            none, no = np.empty((n, 0)), np.zeros(n, dtype=np.bool_)
            return RankingBatch(none.astype(np.int64), none, np.zeros(n), no, no)
        view = View.of_batch(batch, self.modes, np.asarray(values, dtype=np.float64))
        return self.rank_view(view, counts, known)

    def rank_view(self, view: View, counts: Mapping[int, float], known: Familiarity) -> RankingBatch:
        """Rank the modes, of which there is one at least, for all examples of a view."""
        n, m = len(view), len(self.modes)
        cast, spoken = self._cast(view)
        scores = cast.sum(axis=2)
        order, lead = run_off_batch(cast - cast.transpose(0, 2, 1), self._by_tie(counts))
        margin = lead.reshape(n) / VOTE_UNIT if m > 1 else np.full(n, math.inf)
        seen = known.is_seen_batch(view)
        familiar = seen | spoken[np.arange(n), order[:, 0]]
        ranked = np.take_along_axis(scores, order, axis=1) / VOTE_UNIT
        return RankingBatch(np.array(self.modes)[order], ranked, margin, familiar, seen)

    def verdicts(self, example: Example, values: Sequence[float], ranked: tuple[int, ...]) -> list[Verdict]:
        """How the first of some ranked modes fared against each of the others."""
        found = {}
        for classifier, outcome in zip(self._classifiers, self.outcomes(example, values), strict=True):
            if ranked[0] in (classifier.i, classifier.j):
                runner_up = classifier.j if ranked[0] == classifier.i else classifier.i
                found[runner_up] = verdict(classifier, outcome)
        return [found[mode] for mode in ranked[1:]]

    def _by_tie(self, counts: Mapping[int, float]) -> list[int]:
        """Places of the modes, those that win ties first."""
        return sorted(range(len(self.modes)), key=lambda k: (-counts[self.modes[k]], self.modes[k]))

    def _run_off(
        self, cast: Sequence[tuple[int, int]], by_tie: Sequence[int]
    ) -> tuple[list[int], int | None]:
        """Places of the modes, the winner first, and by how much it won the last count; see `run_off_batch`."""
        lead = [[0] * len(by_tie) for _ in by_tie]
        for (a, b), (for_a, for_b) in zip(self._places, cast, strict=True):
            lead[a][b], lead[b][a] = for_a - for_b, for_b - for_a
        totals, alive, out = [sum(row) for row in lead], list(by_tie), []
        margin = None
        while len(alive) > 1:
            least = min([totals[m] for m in alive])
            worst = next(m for m in reversed(alive) if totals[m] == least)
            alive.remove(worst)
            out.append(worst)
            margin = lead[alive[0]][worst]
            for m in alive:
                totals[m] -= lead[m][worst]
        return [*alive, *reversed(out)], margin

    def _cast(self, view: View) -> tuple[NDArray[np.int64], Bools]:
        """Votes that each mode gets from its pair with each other one, and whether a clause voted for it.

        Shapes ``(n, M, M)`` and ``(n, M)``.
        """
        rows = np.arange(len(view))
        cast = np.zeros((len(view), len(self.modes), len(self.modes)), dtype=np.int64)
        spoken = np.zeros(cast.shape[:2], dtype=np.bool_)
        for (a, b), votes, classifier in zip(self._places, self._votes, self._classifiers, strict=True):
            outcome = classifier.decide_batch(view, rows)
            gained = np.array(votes, dtype=np.int64)[outcome]
            cast[:, a, b] = gained[:, 0]
            cast[:, b, a] = gained[:, 1]
            last = len(classifier.definition.clauses)
            by_clause = np.array([o.stage < last for o in classifier.outcomes])
            spoken[:, a if classifier.positive == classifier.i else b] |= by_clause[outcome]
        return cast, spoken

    def _spoke(self, mode: int, outcomes: Sequence[int]) -> bool:
        """Whether a clause of some pair voted for a mode."""
        for classifier, outcome in zip(self._classifiers, outcomes, strict=True):
            if classifier.positive == mode:
                if classifier.outcomes[outcome].stage < len(classifier.definition.clauses):
                    return True
        return False


def run_off_batch(
    lead: NDArray[np.int64], by_tie: Sequence[int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Drop the mode that leads least over the ones still in, until one is left.

    Parameters
    ----------
    lead
        By how many votes each mode leads over each other one, shape ``(n, M, M)``.
    by_tie
        All modes' places; of equals the last one drops out.

    Returns
    -------
    Places of the modes in the order in which they would win, shape ``(n, M)``, and the winner's lead over the last
    one to drop out, shape ``(n,)`` (zeros if there is a single mode).
    """
    n, m = lead.shape[:2]
    backwards, rows = np.array(by_tie[::-1]), np.arange(n)
    lead = lead[:, backwards][:, :, backwards]
    totals = lead.sum(axis=2)
    order = np.zeros((n, m), dtype=np.int64)
    out = np.zeros((n, m), dtype=np.bool_)
    margin = np.zeros(n, dtype=np.int64)
    for place in range(m - 1, 0, -1):
        worst = np.argmin(np.where(out, np.iinfo(np.int64).max, totals), axis=1)
        out[rows, worst] = True
        order[:, place] = worst
        totals -= lead[rows, :, worst]
    order[:, 0] = np.argmin(out, axis=1)
    if m > 1:
        margin = lead[rows, order[:, 0], order[:, 1]]
    return backwards[order], margin
