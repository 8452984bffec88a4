"""Learning one pair: FOIL in all contexts and both polarities, then trees where clauses err (§3.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.classification.binary import BinaryClassifier, majority, tree_columns, tree_features
from relgym.classification.examples import Bools, Floats
from relgym.classification.views import CONTEXTS, Context, Scope, View
from relgym.config import ClassificationConfig
from relgym.config.constants import CALL, SHORT
from relgym.logic.clause import Clause, Definition
from relgym.logic.csp import matches
from relgym.logic.facts import Facts
from relgym.logic.foil import FoilConfig, learn_both, recounted
from relgym.numeric.tree import DecisionTree, learn_tree
from relgym.scheduling.work import Steps, resumable

__all__ = ["Lesson", "foil_config", "learn_pair"]

_Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Lesson:
    """What one pair of modes is to be learned from.

    Parameters
    ----------
    view
        All examples.
    rows
        Those that teach this pair, shape ``(n,)``.
    is_i
        Whether each shows the pair's first mode, shape ``(n,)``.
    weights
        How many seen examples each stands for, shape ``(n,)``.
    """

    view: View
    rows: _Rows
    is_i: Bools
    weights: Floats

    def alone(self) -> Lesson:
        """The same lesson with examples of its own, that nobody changes."""
        return Lesson(self.view.take(self.rows), np.arange(len(self.rows)), self.is_i, self.weights)

    @property
    def counts(self) -> tuple[float, float]:
        """Weight of the first and of the second mode's examples."""
        return float(self.weights[self.is_i].sum()), float(self.weights[~self.is_i].sum())


def foil_config(config: ClassificationConfig) -> FoilConfig:
    """FOIL's settings."""
    return FoilConfig(
        max_literals=config.max_literals,
        max_clauses=config.max_clauses,
        max_new_variables=config.max_new_variables,
        beam=config.beam,
    )


@resumable
def learn_pair(
    i: int,
    j: int,
    lesson: Lesson,
    scope: Scope,
    config: ClassificationConfig,
    known: BinaryClassifier | None = None,
) -> Steps[BinaryClassifier]:
    """Learn to tell mode `i` from mode `j`: in one context after the other, until a definition settles it.

    What is `known` stays where nothing better is found: searches are greedy, and conditions that tell nothing unless
    they come together are found of few examples sooner than of many. With examples of one mode only there is nothing
    to tell: the result has no clause and votes for that mode.
    """
    if not all(lesson.counts):
        return majority(i, j, scope, lesson.counts)
    definitions: dict[Context, Definition] = {}
    for context in _contexts(lesson) if config.context == "auto" else [config.context]:
        found = definitions[context] = yield from _define(lesson, context, scope, config)
        if _settles(found, context):
            break
    if known is not None and known.definition.clauses:
        yield CALL
        stands = recounted(
            known.definition, *_classes(lesson, known.context, scope), **_weighed(lesson, config)
        )
        if known.context not in definitions or stands.rank < definitions[known.context].rank:
            definitions[known.context] = stands
    # as between polarities, errors count first; the narrowest context wins ties
    best = min(definitions.items(), key=lambda each: each[1].rank)
    work = sum(each.work for each in definitions.values())
    classifier = yield from _with_trees(BinaryClassifier(i, j, scope, *best, work=work), lesson, config)
    classifier.recount(lesson.view, lesson.rows, lesson.is_i, lesson.weights)
    return classifier


def _settles(found: Definition, context: Context) -> bool:
    """Whether a definition is so good that wider contexts needn't be looked at.

    In the narrowest one, thresholds on the target's own numbers may stand in for objects that it doesn't show.
    """
    if found.errors > 0 or found.size > SHORT:
        return False
    own = any(literal.op is not None and not literal.args for clause in found.clauses for literal in clause)
    return context != "approached" or (len(found.clauses) <= 1 and not own)


def _contexts(lesson: Lesson) -> list[Context]:
    """The contexts to try, the narrowest first; those that show a lesson's examples no differently are left out."""
    narrow, usual, wide = (lesson.view.shown(each)[lesson.rows] for each in CONTEXTS)
    found = [CONTEXTS[0]] if not np.array_equal(narrow, usual) else []
    found.append(CONTEXTS[1])
    return found if np.array_equal(usual, wide) else [*found, CONTEXTS[2]]


def _define(
    lesson: Lesson, context: Context, scope: Scope, config: ClassificationConfig
) -> Steps[Definition]:
    shown = _classes(lesson, context, scope)
    yield CALL
    found: Definition = yield from learn_both.steps(*shown, **_weighed(lesson, config))
    return found


def _classes(lesson: Lesson, context: Context, scope: Scope) -> tuple[Facts, _Rows, _Rows]:
    """The facts of a context, and the tuples of the first and of the second mode."""
    tuples = lesson.view.tuples(lesson.rows)
    return lesson.view.facts(context, scope), tuples[lesson.is_i], tuples[~lesson.is_i]


def _weighed(lesson: Lesson, config: ClassificationConfig) -> dict[str, Any]:
    """Their weights, and FOIL's settings."""
    weights = lesson.weights
    return {
        "pos_weights": weights[lesson.is_i],
        "neg_weights": weights[~lesson.is_i],
        "config": foil_config(config),
    }


def _with_trees(
    found: BinaryClassifier, lesson: Lesson, config: ClassificationConfig
) -> Steps[BinaryClassifier]:
    """Add decision trees where clauses, or the fall-through, err too often (§3.4.4)."""
    view, facts = lesson.view, lesson.view.facts(found.context, found.scope)
    positive = lesson.is_i != found.definition.negated
    open_ = np.arange(len(lesson.rows))
    trees: list[DecisionTree | None] = []
    for clause in found.definition.clauses:
        hit = matches(clause, facts, view.tuples(lesson.rows[open_]))
        here = open_[hit]
        wrong = here[~positive[here]]
        tree = None
        if _rate(lesson, wrong, here, ~positive) > config.clause_tree_threshold:
            tree = yield from _tree(found, clause, lesson, here, positive, config)
        if tree is not None:
            features = tree_features(view, found.scope, found.context, clause, lesson.rows[here])
            here = here[tree.predict_batch(features)]
        trees.append(tree)
        open_ = np.setdiff1d(open_, here)
    last = None
    if _rate(lesson, open_[positive[open_]], open_, positive) > config.fall_through_tree_threshold:
        last = yield from _tree(found, None, lesson, open_, positive, config)
    return BinaryClassifier(
        found.i, found.j, found.scope, found.context, found.definition, tuple(trees), last, work=found.work
    )


def _rate(lesson: Lesson, wrong: _Rows, here: _Rows, suffering: Bools) -> float:
    """Share of errors among the examples decided here, or in the class that suffers them if larger.

    The second makes rare modes count: 20 among 16,000 are no share to speak of, but may be all there are.
    """
    w = lesson.weights
    errors = float(w[wrong].sum())
    return max(
        errors / max(float(w[part].sum()), float(np.finfo(np.float64).tiny)) for part in (here, suffering)
    )


def _tree(
    found: BinaryClassifier,
    clause: Clause | None,
    lesson: Lesson,
    here: _Rows,
    positive: Bools,
    config: ClassificationConfig,
) -> Steps[DecisionTree | None]:
    """A tree for the examples at one stage; none if it would always give the same answer."""
    columns = tree_columns(found.scope, 1 if clause is None else clause.variables)
    if not columns:
        return None
    tree = yield from learn_tree.steps(
        tree_features(lesson.view, found.scope, found.context, clause, lesson.rows[here]),
        positive[here],
        weights=lesson.weights[here],
        columns=columns,
        min_leaf=config.tree_min_leaf,
        max_depth=config.tree_max_depth,
    )
    return tree if len({tree.says_yes(leaf) for leaf in tree.leaves}) == 2 else None
