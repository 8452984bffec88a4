"""Mending a contradicted definition without learning it anew (§5.1 asks for an incremental learner).

Tried in turn: move one numeric threshold, drop one clause, add one clause. The first change that brings the
errors down to what they were when the definition was learned is taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from relgym.classification.binary import BinaryClassifier
from relgym.classification.examples import Bools, Floats
from relgym.classification.learning import Lesson, foil_config
from relgym.classification.views import lift
from relgym.config import ClassificationConfig
from relgym.config.constants import CALL
from relgym.logic.clause import ANY, Clause, Definition
from relgym.logic.csp import matches
from relgym.logic.facts import Facts
from relgym.logic.foil import learn
from relgym.logic.thresholds import merit, rounding, simplest_between
from relgym.scheduling.work import Steps, resumable

__all__ = ["mend"]


@resumable
def mend(
    broken: BinaryClassifier, lesson: Lesson, allowed: float, config: ClassificationConfig
) -> Steps[BinaryClassifier | None]:
    """A mended classifier that errs on at most `allowed` weight of examples, or none.

    Classifiers with decision trees aren't mended: their trees would have to be learned anew anyway.
    """
    if broken.fall_through_tree is not None or any(broken.clause_trees):
        return None
    mending = _Mending.of(broken, lesson)
    work = len(lesson.rows) * (1 + len(broken.definition.clauses))
    yield CALL + work

    def repaired(definition: Definition) -> BinaryClassifier | None:
        nonlocal work
        work += definition.work + len(lesson.rows)
        mended = BinaryClassifier(broken.i, broken.j, broken.scope, broken.context, definition, work=work)
        errors = mended.recount(lesson.view, lesson.rows, lesson.is_i, lesson.weights)
        return mended if errors <= allowed else None

    for definition in mending.changes():
        yield CALL + len(lesson.rows)
        if (mended := repaired(definition)) is not None:
            return mended
    added = yield from mending.added(config)
    return None if added is None else repaired(added)


@dataclass(frozen=True, eq=False)
class _Mending:
    lesson: Lesson
    facts: Facts
    definition: Definition
    positive: Bools
    covers: Bools  # shape (clauses, n)

    @classmethod
    def of(cls, broken: BinaryClassifier, lesson: Lesson) -> _Mending:
        facts = lesson.view.facts(broken.context, broken.scope)
        tuples = lesson.view.tuples(lesson.rows)
        covers = [matches(clause, facts, tuples) for clause in broken.definition.clauses]
        table = np.array(covers, dtype=np.bool_).reshape(len(covers), len(lesson.rows))
        return cls(lesson, facts, broken.definition, lesson.is_i != broken.definition.negated, table)

    def changes(self) -> Iterator[Definition]:
        """Definitions with a threshold moved, then those with a clause less."""
        clauses = self.definition.clauses
        for at, clause in enumerate(clauses):
            open_ = np.logical_not(np.delete(self.covers, at, axis=0).any(axis=0))
            for moved in self._moved(clause, open_):
                yield self._with((*clauses[:at], moved, *clauses[at + 1 :]))
        for at in range(len(clauses)):
            yield self._with(clauses[:at] + clauses[at + 1 :])

    def _with(self, clauses: tuple[Clause, ...], work: int = 0) -> Definition:
        return Definition(clauses, 1, self.definition.negated, bits=self.definition.bits, work=work)

    def _moved(self, clause: Clause, open_: Bools) -> Iterator[Clause]:
        """The clause with one threshold moved, for each of its thresholds that can be."""
        for at, literal in enumerate(clause.literals):
            if literal.op is None or literal.negated or ANY in literal.args:
                continue
            values = self._values(clause, at)
            use = open_ & ~np.isnan(values)
            threshold = _best_threshold(
                values[use], self.positive[use], self.lesson.weights[use], literal.op == "<="
            )
            if threshold is not None:
                yield clause.replace(at, replace(literal, threshold=threshold))

    def _values(self, clause: Clause, at: int) -> Floats:
        """What literal number `at` compares in each example that satisfies the rest of its clause, else NaN.

        Of several objects that fit, the one that passes most easily counts.
        """
        literal, tuples = clause.literals[at], self.lesson.view.tuples(self.lesson.rows)
        numbers = self.facts.numeric[literal.relation]
        if not literal.args:
            rest = Clause(clause.literals[:at] + clause.literals[at + 1 :])
            scalar: Floats = np.where(matches(rest, self.facts, tuples), numbers[tuples[:, 0]], np.nan)
            return scalar
        literals = lift(clause, literal.args[1]).literals
        rest = Clause(literals[:at] + literals[at + 1 :], 2)
        worst, best = (np.inf, np.fmin) if literal.op == "<=" else (-np.inf, np.fmax)
        result = np.full(len(tuples), worst)
        for slot in range(self.facts.objects):
            fits = np.flatnonzero(self.facts.exists[tuples[:, 0], slot])
            triples = np.column_stack([tuples[fits], np.full(len(fits), slot)])
            fits = fits[matches(rest, self.facts, triples)]
            result[fits] = best(result[fits], numbers[tuples[fits, 0], slot])
        return np.where(np.isinf(result), np.nan, result)

    def added(self, config: ClassificationConfig) -> Steps[Definition | None]:
        """The definition with one more clause, for the positives that it misses."""
        tuples, weights = self.lesson.view.tuples(self.lesson.rows), self.lesson.weights
        missed = self.positive & ~self.covers.any(axis=0)
        if not missed.any() or self.positive.all():
            return None
        found = yield from learn.steps(
            self.facts,
            tuples[missed],
            tuples[~self.positive],
            pos_weights=weights[missed],
            neg_weights=weights[~self.positive],
            config=replace(foil_config(config), max_clauses=1),
        )
        return self._with(self.definition.clauses + found.clauses, found.work) if found.clauses else None


def _best_threshold(values: Floats, positive: Bools, weights: Floats, at_most: bool) -> float | None:
    """Threshold with the fewest errors: zero, or else in the widest such gap; none if there is no gap at all."""
    order = np.argsort(values, kind="stable")
    values, signs = values[order], np.where(positive[order] == at_most, weights[order], -weights[order])
    cuts = np.flatnonzero(np.diff(values) > rounding(values))
    if not len(cuts):
        return None
    right = np.cumsum(signs)[cuts]  # weight that a cut puts on its right side, up to a constant
    widest = cuts[right >= right.max() - 1e-9]
    cut = widest[np.argmax(merit(values[widest], values[widest + 1]))]
    return simplest_between(float(values[cut]), float(values[cut + 1]))
