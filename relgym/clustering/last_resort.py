"""An approximation for a target of which exact laws explain too little, and whether it is worth having.

After 256, 1,024, ... examples, oftener among features unless noise is what is left, where exact laws explain less
than half, the best sparse function is taken that leaves at most 10 % of the change (1 % without features), or with
features up to half of it where what it leaves is noise: residuals of neighbours are not alike. The wider the library,
the more terms it may have. What it leaves becomes the target's noise, and the report says so. A later approximation
replaces it if it is better on nearly all of the rows that it wasn't fitted to, or as good and shorter, and it
replaces modes that explain most if errors take fewer bits then, of k modes k times what they leave: so much less
would k slices of noise. Rows without a law, a lander's touches, make most of the squares, and terms for them hold
nowhere else. So a term that serves few rows must explain most of them, or it and they are left aside; a second search
sees changes no larger than most to begin with; and columns that are no features are searched alone, too. Of what is
as good within 10 % the shortest is taken: ``th' = th + 0.05 w'``, where there were five sines before, or seven terms
of the legs.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.approximation import (
    LEFT,
    Approximation,
    approximate,
    as_good,
    reach,
    terms_of,
)
from relgym.clustering.examples import ExampleTable
from relgym.clustering.population import Population
from relgym.clustering.unification import reordered
from relgym.config.constants import FIRST, LITTLE, MOST_ROWS, NEARLY_ALL, OFTEN, RECENT, SELDOM
from relgym.numeric.stepwise import LinearFit
from relgym.scheduling.renewal import due
from relgym.scheduling.work import Task

__all__ = ["LastResort", "Resort", "last_resort", "timely"]


@dataclass(frozen=True, slots=True)
class LastResort:
    """An approximation: the signature of its columns, the function on them, and what it leaves of its examples."""

    signature: int
    fit: LinearFit
    sigma: float


def timely(population: Population, table: ExampleTable, *, again: bool) -> bool:
    """Whether it is time to look for an approximation; `again`: there is one already.

    Among features it is looked for oftener, since more examples choose better among many: unless noise is what is left.
    """
    if population.seen < RECENT or due(population.seen, FIRST, SELDOM):
        return population.seen >= RECENT
    if not due(population.seen, FIRST, OFTEN):
        return False
    signature, recent = _recent(population, table)
    slots = table.signatures[signature]
    if not slots.features or not again:
        return bool(slots.features)
    change = population.y[recent] - slots.present(table.x[population.rows[recent]], population.target)
    return population.scale.sigma <= LEFT * float(change.std())


def last_resort(
    population: Population, table: ExampleTable, *, floor: float, again: bool
) -> LastResort | None:
    """The best sparse function of a target's newest examples, if it is better than what there is.

    Parameters
    ----------
    population, table
        The target's examples and their rows.
    floor
        Rounding noise, in units of the target.
    again
        Whether the present modes are approximations too.
    """
    resort = Resort.of(population, table, floor=floor, again=again)
    resort.task.advance(sys.maxsize)
    return resort.found(population, table, floor=floor, again=again)


@dataclass(frozen=True, slots=True)
class Resort:
    """The search for an approximation, under way: of which signature, with its columns in this order.

    None of a target's examples later than the first so many that there ever were is `fitted` to.
    """

    signature: int
    order: NDArray[np.intp]
    task: Task[Approximation | None]
    fitted: int

    @classmethod
    def of(cls, population: Population, table: ExampleTable, *, floor: float, again: bool) -> Resort:
        """Begin one among a target's newest examples; parameters as of `last_resort`."""
        signature, recent = _recent(population, table)
        if again:  # it is compared on the others: who was fitted to rows errs less there than it will
            recent = recent[: max(1, int(NEARLY_ALL * len(recent)))]
        slots, rows, y = table.signatures[signature], population.rows[recent], population.y[recent]
        order, stages = slots.preference(population.target)
        order = order[: stages[min(1, len(stages) - 1)] if slots.features else stages[0]]
        task = Task(
            approximate,
            slots.matrix(table.x[rows], order),
            y,
            slots.present(table.x[rows], population.target),
            floor=floor,
            terms=terms_of(len(order), population.config),
            stds=population.scale.inlier_stds,
            left=LEFT if slots.features else LITTLE,
            noisy=stages[0] if slots.features else 0,
        )
        later = len(population.y) - 1 - int(recent[-1])
        return cls(signature, order, task, population.seen - later)

    def found(
        self, population: Population, table: ExampleTable, *, floor: float, again: bool
    ) -> LastResort | None:
        """What was found, if it is better than what there is by now; parameters as of `last_resort`."""
        found = self.task.result
        return None if found is None else _accepted(self, found, population, table, floor=floor, again=again)


def _accepted(
    resort: Resort,
    found: Approximation,
    population: Population,
    table: ExampleTable,
    *,
    floor: float,
    again: bool,
) -> LastResort | None:
    signature, recent = _recent(population, table)
    slots, rows, y = table.signatures[resort.signature], population.rows[recent], population.y[recent]
    if signature != resort.signature:
        return None  # examples look otherwise by now
    if again and slots.features:  # few examples choose among many features badly
        modes = list(population.clusters.values())
        unseen = recent >= len(population.y) - (population.seen - resort.fitted)
        if unseen.any():
            rows, y = rows[unseen], y[unseen]
        own = np.abs(y - found.fit.predict(slots.matrix(table.x[rows], resort.order)))
        errors = [c.errors(table, rows, y, population.scale)[0] for c in modes]
        shorter = found.fit.terms < sum(c.mode.parameters for c in modes)
        if modes:
            new, old = reach(own, floor), reach(np.min(errors, axis=0), floor)
            if not as_good(new, old) if shorter else as_good(old, new):
                return None
    elif 2 * population.noise_examples <= population.seen:
        spread = max(float((y - slots.present(table.x[rows], population.target)).std()), found.sigma)
        explained, count = 1.0 - population.noise_examples / population.seen, max(len(population.clusters), 1)
        # Bits that errors take. So many modes that merely slice noise leave that much less of it.
        bits = explained * np.log2(count * population.scale.sigma / spread)
        if float(found.inliers.mean()) * np.log2(found.sigma / spread) >= bits:
            return None
    return LastResort(resort.signature, reordered(found.fit, resort.order), found.sigma)


def _recent(population: Population, table: ExampleTable) -> tuple[int, NDArray[np.intp]]:
    """The newest example's signature, and the newest examples that have it."""
    recent = np.arange(max(0, len(population.y) - MOST_ROWS), len(population.y))
    signature = int(table.signature_ids[population.rows[-1]])
    return signature, recent[table.signature_ids[population.rows[recent]] == signature]
