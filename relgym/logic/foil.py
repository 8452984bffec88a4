"""FOIL: learn clauses that cover the positive tuples and not the negative ones (thesis §3.4.1).

References
----------
J. R. Quinlan, "Learning logical definitions from relations", Machine Learning 5 (1990).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from relgym.arguments import array_of
from relgym.config.constants import ROUNDED
from relgym.config.logic import FoilConfig
from relgym.errors import ConfigError
from relgym.logic.clause import Definition
from relgym.logic.cover import Cover
from relgym.logic.facts import Facts, Float, Int
from relgym.logic.tables import Tables
from relgym.scheduling.work import Steps, resumable

__all__ = ["FoilConfig", "learn", "learn_both", "recounted"]


@resumable
def learn(
    facts: Facts,
    positives: Int,
    negatives: Int,
    *,
    pos_weights: ArrayLike | None = None,
    neg_weights: ArrayLike | None = None,
    config: FoilConfig | None = None,
) -> Steps[Definition]:
    """Learn a definition of the positive tuples (Algorithm 2).

    Parameters
    ----------
    facts
        Relations and numeric functions.
    positives, negatives
        Integers of shape (p, 1 + arity) and (q, 1 + arity): a world, then the objects of the target's
        arguments.
    pos_weights, neg_weights
        How often each tuple counts, > 0; default 1. Group identical worlds and give them weights: cost goes
        by tuples.
    config
        Search and acceptance.

    Returns
    -------
    Without negatives the clause ``true``, without positives no clause at all. It never errs more often, by
    weight, than "everything is negative".

    Raises
    ------
    ConfigError
        If shapes don't fit, a world or object doesn't exist, or a weight isn't positive and finite.

    Notes
    -----
    Deviations from the thesis: clauses are found by beam search and FOIL's gain, not by negatives alone; all
    tuples evaluate a clause, not a random quarter; a rejected clause doesn't end learning; description length
    decides what is noise. Three searches are made as long as one errs or needs many literals: for clauses of
    relations alone that compress best, for such clauses with thresholds, and for those without any negatives first;
    the definition that takes fewest bits is kept.
    Deterministic. Cost: see `search.grow`, per clause.
    """
    return (yield from _cover(facts, positives, negatives, pos_weights, neg_weights, config).solve())


@resumable
def learn_both(
    facts: Facts,
    positives: Int,
    negatives: Int,
    *,
    pos_weights: ArrayLike | None = None,
    neg_weights: ArrayLike | None = None,
    config: FoilConfig | None = None,
) -> Steps[Definition]:
    """Learn both polarities and keep the better one (§3.4.5).

    Parameters, errors and cost are those of `learn`, the latter twice.

    Returns
    -------
    Of the definition of the positives and that of the negatives (then `Definition.negated`) the one with
    fewer errors; on ties the one with fewer bits, then the former. `Definition.work` is that of both.
    """
    task = _cover(facts, positives, negatives, pos_weights, neg_weights, config)
    given = yield from task.solve()
    if given.errors <= ROUNDED and sum(map(len, given.clauses)) <= 1:
        return given  # one literal without errors: the other side can't be told more simply
    # nothing beats a definition without errors but one of fewer bits
    other = yield from task.swapped().solve(given.bits if given.errors <= ROUNDED else math.inf)
    work = given.work + other.work
    if other.rank < given.rank:
        return replace(other, negated=True, work=work)
    return replace(given, work=work)


def recounted(
    definition: Definition,
    facts: Facts,
    positives: Int,
    negatives: Int,
    *,
    pos_weights: ArrayLike | None = None,
    neg_weights: ArrayLike | None = None,
    config: FoilConfig | None = None,
) -> Definition:
    """A definition with coverage and bits as of these tuples; what `learn_both` finds of them compares with it.

    Parameters and errors are those of `learn_both`. Cost: the clauses, once for each tuple.
    """
    task = _cover(facts, positives, negatives, pos_weights, neg_weights, config)
    task = task.swapped() if definition.negated else task
    return replace(task.definition(definition.clauses), negated=definition.negated)


def _cover(
    facts: Facts,
    positives: Int,
    negatives: Int,
    pos_weights: ArrayLike | None,
    neg_weights: ArrayLike | None,
    config: FoilConfig | None,
) -> Cover:
    """Check the arguments and lay them out."""
    for what, given, kind in (("facts", facts, Facts), ("config", config, FoilConfig | None)):
        if not isinstance(given, kind):
            raise ConfigError(f"{what}={given!r}: expected {kind}")
    config = config or FoilConfig()
    positives, negatives = _checked(facts, positives, "positives"), _checked(facts, negatives, "negatives")
    if positives.shape[1] != negatives.shape[1]:
        raise ConfigError(f"Expected tuples of one width, got {positives.shape} and {negatives.shape}.")
    weights = np.concatenate([_weights(pos_weights, positives), _weights(neg_weights, negatives)])
    tables = Tables(facts, positives, negatives, config.max_new_variables, config.numeric)
    return Cover(tables, weights, config)


def _checked(facts: Facts, tuples: Int, what: str) -> Int:
    tuples = np.asarray(tuples)
    if tuples.ndim != 2 or tuples.shape[1] < 1 or not np.issubdtype(tuples.dtype, np.integer):
        kind = f"{tuples.dtype} of shape {tuples.shape}"
        raise ConfigError(f"{what}: expected integers of shape (n, 1 + arity), got {kind}.")
    limits = np.array([facts.worlds, *[facts.objects] * (tuples.shape[1] - 1)])
    if ((tuples < 0) | (tuples >= limits)).any():
        raise ConfigError(f"{what}: expected a world and objects below {limits.tolist()}, got others.")
    there = facts.exists[tuples[:, :1], tuples[:, 1:]].all(axis=1)
    if not there.all():
        raise ConfigError(
            f"{what}: expected objects that exist, got {tuples[~there][0].tolist()} (world, objects)."
        )
    return tuples.astype(np.int64)


def _weights(weights: ArrayLike | None, tuples: Int) -> Float:
    found = np.ones(len(tuples)) if weights is None else array_of("weights", weights, (None,), ConfigError)
    if found.shape != (len(tuples),) or not (np.isfinite(found) & (found > 0)).all():
        raise ConfigError(f"Expected {len(tuples)} positive, finite weights, one per tuple; got {found!r}.")
    return found
