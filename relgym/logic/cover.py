"""FOIL's outer loop: add clauses until the positive tuples are covered (Algorithm 2, lines 5 and 13-15)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relgym.config.constants import ALTERNATIVES, CALL, ROUNDED, SAME_DIGITS, SHORT
from relgym.config.logic import FoilConfig
from relgym.logic.clause import Clause, Coverage, Definition
from relgym.logic.description import DescriptionLength
from relgym.logic.facts import Bool, Float
from relgym.logic.growing import Growing, Score, Weights
from relgym.logic.pruning import Problem, center_thresholds, prune
from relgym.logic.search import Harvest, grow
from relgym.logic.tables import Tables
from relgym.scheduling.work import Steps

__all__ = ["Cover"]


class Cover:
    """One learning problem of one polarity.

    Parameters
    ----------
    tables
        The tuples. Both polarities share them.
    weights
        Shape (n,): their weights.
    config
        Search and acceptance.
    swapped
        Whether the tables' *second* class is the one to be described.
    """

    def __init__(self, tables: Tables, weights: Float, config: FoilConfig, swapped: bool = False) -> None:
        positive = (np.arange(tables.size) < tables.split) != swapped
        self._tables = tables
        self._config = config
        self._swapped = swapped
        self._problem = Problem(tables.facts, tables.tuples, weights, positive)
        names = len(tables.facts.relations) + len(tables.functions)
        self._length = DescriptionLength(names, tables.size, _typical(weights, tables.split))
        self._harvests: dict[tuple[bool, bytes], Harvest] = {}
        self._work = 0

    def swapped(self) -> Cover:
        """Return the same problem with the classes exchanged (§3.4.5)."""
        return Cover(self._tables, self._problem.weights, self._config, not self._swapped)

    def solve(self, limit: float = math.inf) -> Steps[Definition]:
        """Learn the definition, see `foil.learn`; its clauses take no more bits than `limit`."""
        everything = self._problem.count(np.ones(self._tables.size, dtype=np.bool_))
        if everything.positives <= 0 or everything.negatives <= 0:
            # a single class: the clause without literals covers it
            return self.definition([Clause((), self._tables.arity)] if everything.positives > 0 else [])
        if not self._config.mdl:
            return self.definition((yield from self._clauses(self._config, math.inf, pure=True)))
        # relations alone first: thresholds that tell most tuples apart would crowd them out of the beam
        best = self.definition((yield from self._clauses(replace(self._config, numeric=False), limit)))
        looks = [(False, 1), (True, SHORT)] if self._tables.functions else [(True, SHORT)]
        for pure, enough in looks:
            if best.errors <= ROUNDED and sum(map(len, best.clauses)) <= enough:
                break
            clauses = yield from self._clauses(self._config, min(limit, best.bits), pure=pure)
            other = self.definition(clauses)
            best = other if other.bits < best.bits - ROUNDED else best
        return replace(best, work=self._work)

    def _clauses(self, config: FoilConfig, limit: float, *, pure: bool = False) -> Steps[list[Clause]]:
        """Add clauses, `pure` ones if any, until all is covered or they cost more bits than `limit`."""
        alive = np.ones(self._tables.size, dtype=np.bool_)
        clauses: list[Clause] = []
        while len(clauses) < self._config.max_clauses and self._problem.count(alive).positives > ROUNDED:
            clause = yield from self._acceptable(alive, config, pure=pure)
            if clause is None or self._length.clauses([*clauses, clause]) > limit:
                break
            clauses.append(clause)
            alive &= ~self._problem.matches(clause)
        return self._without_redundant(clauses)

    def _acceptable(self, alive: Bool, config: FoilConfig, *, pure: bool) -> Steps[Clause | None]:
        """The best clause that tells enough about the tuples left."""
        problem = self._problem
        rest = replace(problem, weights=np.where(alive | ~problem.positive, problem.weights, 0.0))
        for growing in (yield from self._ranked(alive, config, pure=pure))[:ALTERNATIVES]:
            clause = prune(Clause.of(growing.literals, self._tables.arity), rest)
            clause = center_thresholds(clause.connected(), rest)
            covered = problem.count(alive & problem.matches(clause))
            # It is matched once, and pruned: matched without each of its literals, and again.
            yield 2 * CALL * (1 + 2 * len(growing.literals))
            if self._accepts(clause, covered, problem.count(alive)):
                return clause
        return None

    def _ranked(self, alive: Bool, config: FoilConfig, *, pure: bool) -> Steps[list[Growing]]:
        key = (config.numeric and bool(self._tables.functions), alive.tobytes())
        if key not in self._harvests:
            harvest = self._harvests[key] = yield from self._harvest(alive, config)
            self._work += harvest.work
        whole = self._problem.count(alive)
        information = Score(whole.positives, whole.negatives).information
        keys = {}
        for place, growing in enumerate(self._harvests[key].clauses):
            left = Coverage(float(growing.left.positives), float(growing.left.negatives))
            bits = self._length.literals(growing.literals, self._tables.arity)
            clean = pure and left.negatives <= ROUNDED
            value = left.positives * information - bits if clean else self._length.saving(bits, left, whole)
            keys[place] = (not clean, -round(value, SAME_DIGITS), round(bits, SAME_DIGITS), place)
        return [self._harvests[key].clauses[place] for place in sorted(keys, key=keys.__getitem__)]

    def _harvest(self, alive: Bool, config: FoilConfig) -> Steps[Harvest]:
        """Search among the tuples left. Where some are gone it is cheaper to lay out the others anew."""
        tables, weights = self._tables, self._problem.weights
        if not alive.all():
            tables, weights = tables.restricted(alive), weights[alive]
        classes = Weights(weights[: tables.split], weights[tables.split :], self._swapped)
        return grow.steps(tables, classes, config, self._length)

    def _accepts(self, clause: Clause, covered: Coverage, whole: Coverage) -> bool:
        if covered.positives <= covered.negatives + ROUNDED or covered.precision < self._config.min_precision:
            return False
        return not self._config.mdl or self._length.saving(self._length.clause(clause), covered, whole) > 0

    def _without_redundant(self, clauses: list[Clause]) -> list[Clause]:
        """Drop clauses, later ones first, without which there are no more errors than with them."""
        matched = [self._problem.matches(clause) for clause in clauses]
        for place in reversed(range(len(clauses))):
            others = matched[:place] + matched[place + 1 :]
            if others and self._errors(others) <= self._errors(matched) + ROUNDED:
                matched, clauses = others, clauses[:place] + clauses[place + 1 :]
        return clauses

    def _errors(self, matched: Sequence[Bool]) -> float:
        covered = np.logical_or.reduce(matched)
        return self._problem.count(covered).negatives + self._problem.count(~covered).positives

    def definition(self, clauses: Sequence[Clause]) -> Definition:
        """What some clauses cover, one after the other, and how many bits they take."""
        left = np.ones(self._tables.size, dtype=np.bool_)
        coverage = []
        for clause in clauses:
            matched = self._problem.matches(clause)
            coverage.append(self._problem.count(left & matched))
            left &= ~matched
        covered, uncovered = self._problem.count(~left), self._problem.count(left)
        bits = self._length.definition(clauses, covered, uncovered)
        arity = self._tables.arity
        return Definition(tuple(clauses), arity, False, tuple(coverage), uncovered, bits, self._work)


def _typical(weights: Float, split: int) -> float:
    """Mean weight of a tuple of the class whose tuples weigh less, at least 1; rare ones keep their say."""
    means = [float(part.mean()) for part in (weights[:split], weights[split:]) if len(part)]
    return max(1.0, min(means, default=1.0))
