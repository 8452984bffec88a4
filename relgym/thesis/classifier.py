"""Mode classifiers (§3.4.2-§3.4.5): clauses with decision trees behind them, for each pair of modes, and votes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.numeric.tree import DecisionTree, learn_tree
from relgym.thesis.facts import Facts
from relgym.thesis.foil import Clause, holds, learn_clauses
from relgym.thesis.settings import ThesisSettings

__all__ = ["Pair", "Sample", "Stage", "learn_pair", "ranking"]

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

_DEEP = 64
"""Trees have no limit of depth (§3.4.4); this one is never reached."""


@dataclass(frozen=True)
class Sample:
    """Examples as classifiers see them.

    Attributes
    ----------
    facts
        Relational states.
    state
        State of each example, shape ``(n,)``.
    numbers
        The target's own properties, shape ``(n, len(names))``.
    names
        Of those.
    """

    facts: Facts
    state: Rows
    numbers: Floats
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Stage:
    """A clause (none: the fall-through) with its tree and the training examples that were decided there.

    Attributes
    ----------
    clause, tree
        What decides; no tree: the clause alone.
    right, wrong
        Training examples decided rightly and wrongly.
    """

    clause: Clause | None
    tree: DecisionTree | None
    right: int
    wrong: int


@dataclass(frozen=True, slots=True)
class Pair:
    """A binary classifier (Figure 3.6).

    Attributes
    ----------
    positive, negative
        Modes: that of the clauses, and that of what no clause covers.
    stages
        Clauses in order; the last stage is the fall-through.
    success
        Share of the examples that were decided rightly, as the learner counts them (§3.4.5).
    """

    positive: int
    negative: int
    stages: tuple[Stage, ...]
    success: float

    @property
    def performance(self) -> float:
        """Share of all training examples that it decides rightly."""
        right, wrong = sum(s.right for s in self.stages), sum(s.wrong for s in self.stages)
        return right / (right + wrong) if right + wrong else 1.0

    def says_positive(self, sample: Sample) -> Bools:
        """The waterfall (§3.4.4), shape ``(n,)``."""
        return _waterfall(self.stages, sample) >= 0


def _waterfall(stages: Sequence[Stage], sample: Sample) -> NDArray[np.int64]:
    """Stage that says yes to each example; where none does, -1 less the number of the last one."""
    decided = np.full(len(sample.state), -len(stages), dtype=np.int64)
    open_rows = np.arange(len(sample.state))
    for number, stage in enumerate(stages):
        if not len(open_rows):
            break
        if stage.clause is not None:
            here = open_rows[holds(stage.clause, sample.facts)[sample.state[open_rows]]]
            if stage.tree is not None:
                here = here[stage.tree.predict_batch(sample.numbers[here])]
        else:
            here = open_rows[:0]
            if stage.tree is not None:
                here = open_rows[stage.tree.predict_batch(sample.numbers[open_rows])]
        decided[here] = number
        open_rows = open_rows[decided[open_rows] < 0]
    return decided


def learn_pair(
    modes: tuple[int, int],
    sample: Sample,
    labels: NDArray[np.int64],
    settings: ThesisSettings,
    rng: np.random.Generator,
) -> Pair:
    """Learn to tell two modes apart, in both polarities, and keep the one that errs less (§3.4.5).

    Parameters
    ----------
    modes
        The older one first.
    sample, labels
        Examples, and the mode of each, shape ``(n,)``.
    settings, rng
        Rules, and draws.
    """
    first, second = modes
    chosen = _learn(first, second, sample, labels, settings, rng)
    if settings.polarities and chosen.success < 1.0:
        other = _learn(second, first, sample, labels, settings, rng)
        if other.success > chosen.success:
            return other
    return chosen


def _learn(
    positive: int,
    negative: int,
    sample: Sample,
    labels: NDArray[np.int64],
    settings: ThesisSettings,
    rng: np.random.Generator,
) -> Pair:
    yes, no = np.flatnonzero(labels == positive), np.flatnonzero(labels == negative)
    counts = [np.bincount(sample.state[rows], minlength=len(sample.facts)) for rows in (yes, no)]
    clauses = learn_clauses(sample.facts, counts[0], counts[1], settings, rng)
    left, right, total = np.concatenate([yes, no]), 0.0, 0.0
    stages: list[Stage] = []
    evaluated = 0
    for clause, true, false in clauses:
        here = left[holds(clause, sample.facts)[sample.state[left]]]
        success = true / max(true + false, 1)
        tree, success = _tree(here, labels == positive, sample, success, settings, rng)
        right += success * (true + false)
        total += true + false
        evaluated += false
        stages.append(_stage(clause, tree, here, labels == positive, sample))
        left = left[~np.isin(left, here)] if tree is None else _rest(left, here, tree, sample)
    missed = int((labels[left] == positive).sum())
    # What the program takes for true negatives: all but those that it saw covered.
    rest = len(no) - evaluated if settings.grow_share < 1.0 else int((labels[left] == negative).sum())
    success = rest / max(rest + missed, 1)
    tree, success = _tree(left, labels == positive, sample, success, settings, rng)
    right += success * (rest + missed)
    total += rest + missed
    stages.append(_stage(None, tree, left, labels == positive, sample))
    return Pair(positive, negative, tuple(stages), right / total if total else 1.0)


def _rest(left: Rows, here: Rows, tree: DecisionTree, sample: Sample) -> Rows:
    """Examples that a clause with a tree leaves undecided."""
    taken = here[tree.predict_batch(sample.numbers[here])]
    return left[~np.isin(left, taken)]


def _stage(
    clause: Clause | None, tree: DecisionTree | None, rows: Rows, positive: Bools, sample: Sample
) -> Stage:
    """Count what is decided at a stage."""
    truth = positive[rows]
    if tree is None:
        right = int(truth.sum()) if clause is not None else int((~truth).sum())
        return Stage(clause, None, right, len(rows) - right)
    said = tree.predict_batch(sample.numbers[rows])
    if clause is not None:
        return Stage(clause, tree, int(truth[said].sum()), int((~truth[said]).sum()))
    return Stage(None, tree, int((said == truth).sum()), int((said != truth).sum()))


def _tree(
    rows: Rows,
    positive: Bools,
    sample: Sample,
    success: float,
    settings: ThesisSettings,
    rng: np.random.Generator,
) -> tuple[DecisionTree | None, float]:
    """A decision tree where a stage is wrong too often, if it does better (§3.4.4); and the success rate then."""
    if success >= settings.tree_success:
        return None, success
    truth = positive[rows]
    grow, test = _parts(truth, settings, rng)
    if grow is None:
        return None, success
    x = sample.numbers[rows]
    tree = learn_tree(x[grow], truth[grow], columns=sample.names, min_leaf=2, max_depth=_DEEP, prune=False)
    reached = float((tree.predict_batch(x[test]) == truth[test]).mean())
    return (tree, reached) if reached > success else (None, success)


def _parts(
    truth: Bools, settings: ThesisSettings, rng: np.random.Generator
) -> tuple[Bools, Bools] | tuple[None, None]:
    """What a tree is grown on and tested on: of each class `tree_least` examples at least; none if there are fewer.

    Of 72 examples 30 test it, though the share would leave 22: Table 4.5 has a tree there, Table 4.11 one of 93.
    """
    grow = np.ones(len(truth), dtype=np.bool_)
    for these in (np.flatnonzero(truth), np.flatnonzero(~truth)):
        if settings.tree_share == 1.0:
            tests = 0
        else:
            tests = max(len(these) - round(settings.tree_share * len(these)), settings.tree_least)
        if len(these) - tests < settings.tree_least:
            return None, None
        grow[rng.permutation(these)[:tests]] = False
    return grow, (grow if settings.tree_share == 1.0 else ~grow)


def ranking(pairs: Sequence[Pair], modes: Sequence[int], sample: Sample) -> NDArray[np.int64]:
    """Modes of each example by their votes, one of each pair, the most first; of equals the younger (§3.4.3).

    Parameters
    ----------
    pairs
        Binary classifiers.
    modes
        All modes, the oldest first.
    sample
        The examples.

    Returns
    -------
    Mode ids, shape ``(n, len(modes))``.
    """
    place = {mode: k for k, mode in enumerate(modes)}
    votes = np.zeros((len(sample.state), len(modes)), dtype=np.int64)
    for pair in pairs:
        yes = pair.says_positive(sample)
        votes[yes, place[pair.positive]] += 1
        votes[~yes, place[pair.negative]] += 1
    order = np.argsort(-votes[:, ::-1], axis=1, kind="stable")
    return np.array(modes, dtype=np.int64)[::-1][order]
