"""Has anything like this been seen? What classifiers look at, whatever the order and number of objects.

An object is described by the relations that clauses use: its own, those to the target, and which described
objects it stands in which relation to. A situation is the *set* of these descriptions, because clauses don't
count objects: ten more boxes beside the track make no new situation, a box on top of a third one may.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import Bools, Example, ExampleBatch, Vocabulary
from relgym.classification.plans import Key
from relgym.classification.views import Context, View
from relgym.config.constants import ANSWERS
from relgym.logic.situations import situation
from relgym.mixing import mixed

__all__ = ["Familiarity", "Used", "situations", "used_by"]

Used: TypeAlias = tuple[tuple[Context, tuple[int, ...], tuple[int, ...]], ...]
"""Per context: columns of the binary and of the unary relations that clauses use."""

_Hashes: TypeAlias = NDArray[np.uint64]


class Familiarity:
    """Remembers which situations were seen, as far as a set of classifiers can tell them apart.

    Parameters
    ----------
    used
        What the classifiers look at.
    seen
        Situations seen so far.
    """

    def __init__(self, used: Used, seen: Iterable[int]) -> None:
        self.used = used
        self.seen = set(seen)
        self._known: dict[Key, bool] = {}

    def is_seen(self, example: Example, key: Key) -> bool:
        """Whether an example's situation was seen; answers are kept by `key` (`Plan.key`)."""
        found = self._known.get(key)
        if found is None:
            if len(self._known) >= ANSWERS:
                self._known.clear()
            found = self._known[key] = self._situation(example) in self.seen
        return found

    def is_seen_batch(self, view: View) -> Bools:
        """The same for many examples, shape ``(n,)``."""
        seen = np.fromiter(self.seen, dtype=np.uint64, count=len(self.seen))
        first, which = _alike(view, self.used)
        return np.isin(situations(view.take(first), self.used), seen)[which]

    def add(self, example: Example, key: Key) -> None:
        """Remember an example's situation."""
        if self.is_seen(example, key):
            return
        self.seen.add(self._situation(example))
        self._known.clear()  # other keys may stand for the same situation
        self._known[key] = True

    def _situation(self, example: Example) -> int:
        view = View.of_batch(ExampleBatch.of(example), (), np.empty((1, 0)))
        return int(situations(view, self.used)[0])


def used_by(classifiers: Iterable[BinaryClassifier], vocabulary: Vocabulary) -> Used:
    """Columns of all relations that the clauses of some classifiers use."""
    names: dict[Context, set[str]] = {}
    for classifier in classifiers:
        literals = [literal for clause in classifier.definition.clauses for literal in clause]
        names.setdefault(classifier.context, set()).update(literal.relation for literal in literals)
    return tuple(
        (context, _columns(vocabulary.relations, names[context]), _columns(vocabulary.unary, names[context]))
        for context in sorted(names)
    )


def situations(view: View, used: Used) -> _Hashes:
    """A number per example that stands for its situation, shape ``(n,)``; equal for equal situations.

    Cost: O(n K^2 log K).
    """
    result = np.zeros(len(view), dtype=np.uint64)
    for context, relations, unary in used:
        told = view.table[:, list(relations)], view.unary[:, list(unary)]
        result = mixed(result + situation(*told, view.target, view.shown(context)))
    return result


def _alike(view: View, used: Used) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Group examples that show the same in what clauses use: one of each group, and every example's group."""
    columns = sorted({column for _, relations, _ in used for column in relations})
    unary = sorted({column for _, _, columns in used for column in columns})
    shown = (view.approached, view.close, view.exists, view.table[:, columns], view.unary[:, unary])
    flat = [part.reshape(len(view), int(np.prod(part.shape[1:]))) for part in shown]  # of none, too
    bits = np.packbits(np.concatenate(flat, axis=1), axis=1)
    whole = np.concatenate([bits, view.target[:, None].view(np.uint8)], axis=1)
    # As strings, of equal length, rows are sorted fast.
    _, first, which = np.unique(whole.view(f"S{whole.shape[1]}"), return_index=True, return_inverse=True)
    return first, which.reshape(-1)


def _columns(known: tuple[str, ...], names: set[str]) -> tuple[int, ...]:
    return tuple(column for column, name in enumerate(known) if name in names)
