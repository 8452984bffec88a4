"""One pair of modes over time: its classifier, and whether that has become stale."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.classification.binary import BinaryClassifier, majority
from relgym.classification.examples import NOISE
from relgym.classification.learning import Lesson, learn_pair
from relgym.classification.repair import mend
from relgym.classification.views import Scope
from relgym.config import ClassificationConfig
from relgym.config.constants import CALL, NEARLY_ALL, SHORT
from relgym.scheduling.work import Steps, Task, resumable

__all__ = ["PairState", "covered_by", "pair_labels"]


@dataclass(slots=True)
class PairState:
    """The classifier of modes `i` < `j`, and what happened since it was learned.

    Parameters
    ----------
    classifier
        The current classifier.
    seen
        Examples of either mode that taught the pair so far.
    learned
        `seen` when the classifier was learned.
    errors
        Weight of examples that it got wrong when it was learned or mended.
    contradictions
        Examples that contradicted it since.
    mended
        Whether it was mended since it was learned.
    stale
        Whether it waits to be learned anew.
    draft
        The classifier that is being mended or learned anew, if that was begun; files don't keep it.
    """

    classifier: BinaryClassifier
    seen: list[float] = field(default_factory=lambda: [0.0, 0.0])
    learned: tuple[float, float] = (0.0, 0.0)
    errors: float = 0.0
    contradictions: float = 0.0
    mended: bool = False
    stale: bool = False
    draft: Task[tuple[BinaryClassifier, bool]] | None = None
    _taught: tuple[float, float] = (0.0, 0.0)  # what it is taught by

    @classmethod
    def new(cls, i: int, j: int, scope: Scope, lesson: Lesson) -> PairState:
        """A pair that hasn't been learned yet; it votes for the mode with more examples."""
        seen = list(lesson.counts)
        return cls(majority(i, j, scope, seen), seen, errors=min(seen), stale=min(seen) > 0)

    @property
    def modes(self) -> tuple[int, int]:
        """The two mode ids."""
        return self.classifier.i, self.classifier.j

    @property
    def urgency(self) -> tuple[bool, float, float, tuple[int, int]]:
        """Sorting key: those begun, the most contradicted, those with most examples of their rarer mode."""
        return self.draft is None, -self.contradictions, -min(self.seen), self.modes

    def observe(self, outcome: int, is_i: bool, growth: float, weight: float = 1.0) -> bool:
        """Count one more example, which stands for so many; whether it contradicts the classifier."""
        self.seen[not is_i] += weight
        wrong = self.classifier.for_i[outcome] != is_i
        self.classifier.count(outcome, is_i, weight)
        self.contradictions += weight * wrong
        # A short faultless definition learned whole is only confirmed by agreeing examples, however many.
        imperfect = self.errors > 0 or self.mended or self.classifier.definition.size > SHORT
        grown = imperfect and min(self.seen) >= growth * max(min(self.learned), 1.0)
        self.stale = self.stale or self.contradictions > self.errors or grown
        return wrong

    @property
    def unlearned(self) -> bool:
        """Whether the pair has seen at most one of its modes when it was learned."""
        return min(self.learned) == 0

    def check(self, lesson: Lesson) -> None:
        """Count everything anew after examples changed labels; stale if the errors became more."""
        self.seen, self.draft = list(lesson.counts), None
        errors = self.classifier.recount(lesson.view, lesson.rows, lesson.is_i, lesson.weights)
        self.contradictions = max(self.contradictions, errors - self.errors)
        self.stale = self.stale or errors > self.errors or (self.unlearned and min(self.seen) > 0)

    def refresh(self, lesson: Lesson, config: ClassificationConfig, budget: float) -> int:
        """Mend the classifier or learn it anew as far as a budget goes; the cells spent. Not `stale`: done."""
        if self.draft is None:
            grown = min(lesson.counts) >= config.relearn_growth * max(min(self.learned), 1.0)
            mendable = not grown and all(lesson.counts)
            self.draft = Task(
                renew, self.classifier, lesson.alone(), self.errors if mendable else None, config
            )
            self._taught = lesson.counts
        work = CALL + self.draft.advance(int(min(budget, sys.maxsize)))
        if self.draft.done:
            found, mended = self.draft.result
            if not mended:
                self.learned = self._taught
                right = np.array(found.for_i)[found.decide_batch(lesson.view, lesson.rows)] == lesson.is_i
                self.errors = float(lesson.weights[~right].sum())
            self._adopt(found, lesson, mended=mended)
        return work

    def _adopt(self, found: BinaryClassifier, lesson: Lesson, *, mended: bool) -> None:
        self.classifier, self.seen, self.mended = found, list(lesson.counts), mended
        self.contradictions, self.stale, self.draft = 0.0, False, None

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON-able dictionary."""
        names = ("seen", "errors", "contradictions", "mended", "stale")
        plain = {name: getattr(self, name) for name in names}
        return plain | {"learned": list(self.learned), "classifier": self.classifier.to_dict(), "draft": None}

    @classmethod
    def from_dict(cls, data: dict[str, Any], scope: Scope) -> PairState:
        """Inverse of `to_dict`."""
        names = ("seen", "errors", "contradictions", "mended", "stale")
        plain = {name: data[name] for name in names}
        plain["seen"] = list(plain["seen"])
        first, second = data["learned"]
        classifier = BinaryClassifier.from_dict(data["classifier"], scope)
        return cls(classifier, learned=(first, second), **plain)


@resumable
def renew(
    known: BinaryClassifier, lesson: Lesson, allowed: float | None, config: ClassificationConfig
) -> Steps[tuple[BinaryClassifier, bool]]:
    """A classifier mended so that it errs on no more than is allowed, or learned anew; and whether it was mended.

    None allowed: it isn't to be mended.
    """
    mended = None
    if allowed is not None:
        mended = yield from mend.steps(known, lesson, allowed, config)
    if mended is not None:
        return mended, True
    return (yield from learn_pair.steps(known.i, known.j, lesson, known.scope, config, known)), False


def pair_labels(
    assigned: Any, owners: Any, fits: Any, modes: tuple[int, ...], pairs: Iterable[tuple[int, int]]
) -> dict[tuple[int, int], NDArray[np.int8]]:
    """For each pair (i, j) 1 for an example of mode `i`, -1 for one of `j`, 0 for one that isn't used.

    An example counts for the mode it belongs to (`Owners`), and for every mode that *covers* that one, against one that
    doesn't explain it. Bouncing covers sliding: a slide must not let a third mode win against bouncing, or votes go
    round in circles. A mode that explains some of another's examples by chance covers nothing.

    Parameters
    ----------
    assigned, owners
        Mode that each example was assigned to, and mode that it belongs to, shape ``(n,)``.
    fits
        Which of `modes` explain it, shape ``(n, len(modes))``.
    modes
        All modes.
    pairs
        The pairs.
    """

    @cache
    def sides(mode: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which examples count for a mode, and which it doesn't explain."""
        explained = fits[:, modes.index(mode)] | (assigned == mode)
        counts = (owners == mode) | (explained & np.isin(owners, covered_by(assigned, explained)))
        return counts, ~explained

    found = {}
    for i, j in pairs:
        (for_i, not_i), (for_j, not_j) = sides(i), sides(j)
        found[i, j] = (for_i & not_j).astype(np.int8) - (for_j & not_i)
    return found


def covered_by(assigned: Any, explained: Any) -> list[int]:
    """Modes nearly all of whose examples another mode explains.

    Parameters
    ----------
    assigned
        Mode of each example, shape ``(n,)``.
    explained
        Whether the other mode explains it, shape ``(n,)``.
    """
    shifted = assigned - NOISE
    total = np.bincount(shifted)
    share = np.bincount(shifted, weights=explained, minlength=len(total)) >= NEARLY_ALL * np.maximum(total, 1)
    return [int(m) + NOISE for m in np.flatnonzero(share & (total > 0)) if m + NOISE != NOISE]
