"""Modes looked for among what none explains: when, in which examples, and what becomes of what is found (§3.2.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.discovery import counts, find_mode, searched, verifying_bits
from relgym.clustering.em import Cluster
from relgym.clustering.examples import ExampleTable
from relgym.clustering.exchange import orders_of
from relgym.clustering.extension import extendable, extended, is_flag
from relgym.clustering.merging import Known, generalise
from relgym.clustering.mode import NOISE
from relgym.clustering.population import Population
from relgym.clustering.suspects import Evidence, likeliest, suspects
from relgym.clustering.unification import reordered
from relgym.config.constants import ALTERNATIVES, CALL, EXACT, RECENT, SEARCHED_CELLS, SEARCHED_ROWS
from relgym.numeric.ransac import Consensus
from relgym.numeric.stepwise import LinearFit
from relgym.scheduling.agenda import Budget
from relgym.scheduling.work import Task

__all__ = ["ModeSearch", "Search"]


@dataclass(slots=True)
class Search:
    """When to search the noise of one slot signature next.

    Attributes
    ----------
    waiting
        Unexplained examples since the last search.
    failures
        Searches in a row that found nothing.
    """

    waiting: int = 0
    failures: int = 0


@dataclass(slots=True)
class Hunt:
    """A search for modes that is under way.

    Attributes
    ----------
    signature
        Whose noise is searched.
    fresh
        How many of its examples no search had seen when it began.
    left
        New modes that it may still look for.
    task
        The search for one of them; None between two.
    order
        The columns that it looks at.
    late
        Whether it has taken more than one step, so that modes may have changed in the meantime.
    """

    signature: int
    fresh: int
    left: int = ALTERNATIVES
    task: Task[Consensus | None] | None = None
    order: NDArray[np.intp] | None = None
    late: bool = False


class ModeSearch:
    """The search for further modes of a target's examples; when there is reason to is the clusterer's business.

    Parameters
    ----------
    population
        The examples, and the modes so far: what is found goes there.
    seed
        Seed of the random draws.
    """

    def __init__(self, population: Population, *, seed: int) -> None:
        self.population = population
        self._rng = np.random.default_rng(seed)
        self._searches: dict[int, Search] = {}
        self._hunt: Hunt | None = None

    @property
    def under_way(self) -> bool:
        """Whether there is a search to be gone on with."""
        return self._hunt is not None

    @property
    def tried(self) -> bool:
        """Whether a search has been in vain since the examples were news."""
        return any(search.failures for search in self._searches.values())

    def start_over(self) -> None:
        """All examples are news again."""
        self._hunt = None
        self._searches.clear()

    def discover(self, table: ExampleTable, example: int, budget: Budget) -> None:
        """An example is news: search for modes among its like, unless that is in vain, or one is under way."""
        population = self.population
        signature = int(table.signature_ids[population.rows[example]])
        search = self._searches.setdefault(signature, Search())
        search.waiting += 1
        slots = table.signatures[signature]
        patience = self._patience(search, bool(slots.features), bool(slots.features or slots.chained))
        if search.waiting <= patience or self._hunt is not None:
            known = population.known(table)
            if extendable(known) and extended(
                known, signature, self._newest(table, signature), fresh=1, flags=True
            ):
                self._extend(table, signature, self._pool(table, signature), fresh=1, flags=True)
            return
        self._hunt = Hunt(signature, search.waiting)
        if budget.left:  # else its turn comes
            self.pursue(table, budget)

    def search_all(self, table: ExampleTable, budget: Budget) -> None:
        """Search where all examples are news; else the next one would begin that, with itself in each sample."""
        population, unexplained = self.population, self.population.noise()
        if self._searches or not len(unexplained):
            return
        ids = table.signature_ids[population.rows[unexplained]]
        search = self._searches[int(ids[-1])] = Search(waiting=int((ids == ids[-1]).sum()))
        self._hunt = Hunt(int(ids[-1]), search.waiting)
        self.pursue(table, budget)

    def pursue(self, table: ExampleTable, budget: Budget) -> None:
        """Go on with the search that is under way, as far as the budget goes."""
        while (hunt := self._hunt) is not None:
            search = self._searches.setdefault(hunt.signature, Search())
            if hunt.task is None:
                if (
                    hunt.left == ALTERNATIVES
                ):  # it begins: what came while it waited for its turn is news, too
                    hunt.fresh = search.waiting
                pool = self._pool(table, hunt.signature)
                if not hunt.left or len(pool) < self.population.needed:  # not a failure: nothing was searched
                    self._give_up(table, search, pool)
                    return
                self._begin(table, hunt, pool, budget)
            assert hunt.task is not None and hunt.order is not None
            if not budget.work(hunt.task):
                hunt.late = True
                return
            found, self._rng, hunt.task = hunt.task.result, hunt.task.rng, None
            hunt.left -= 1
            if found is None:
                search.failures += 1
                self._give_up(table, search, self._pool(table, hunt.signature))
                return
            search.failures = 0
            fit = reordered(found.fit, hunt.order)
            if not hunt.late or self._wanted(table, hunt.signature, fit):
                self.adopt(table, hunt.signature, fit)

    def _give_up(self, table: ExampleTable, search: Search, pool: NDArray[np.intp]) -> None:
        """End the search that is under way; what has come since it began is news to the next one."""
        hunt, self._hunt = self._hunt, None
        assert hunt is not None
        self._extend(table, hunt.signature, pool, fresh=search.waiting)
        search.waiting = max(0, search.waiting - hunt.fresh)

    def _begin(self, table: ExampleTable, hunt: Hunt, pool: NDArray[np.intp], budget: Budget) -> None:
        """Begin to search unexplained examples for one mode, as they now are."""
        population = self.population
        slots = table.signatures[hunt.signature]
        order, stages = slots.preference(population.target)
        pool = pool[-max(2 * SEARCHED_ROWS, SEARCHED_CELLS // max(1, len(order))) :]
        rows = population.rows[pool]
        part = searched(len(pool), hunt.fresh, self._rng)
        several = len(np.unique(table.strata[rows[part]])) > 1
        property_ = population.target.property
        at = np.flatnonzero(order == slots.column(0, property_)) if slots.has(0, property_) else order[:0]
        hunt.order = order
        hunt.task = Task(
            find_mode,
            slots.matrix(table.x[rows], order),
            population.y[pool],
            table.strata[rows],
            stages=stages,
            fresh=hunt.fresh,
            scale=population.scale,
            config=population.config,
            rng=self._rng,
            needed=population.needed,
            counting=counts(population.y, population.scale),
            rows=part,
            apart=table.differences(rows[part]) if several else None,
            orders=orders_of(slots, order, population.config.draws),
            present=int(at[0]) if len(at) else None,
        )
        budget.spend(CALL + len(rows) * len(order) + several * len(part) ** 2)

    def _wanted(self, table: ExampleTable, signature: int, fit: LinearFit) -> bool:
        """Whether a function still explains enough of what none explains."""
        population = self.population
        cluster = population.known(table).cluster(fit, signature)
        return len(population.explained(table, cluster, population.noise())) >= population.needed

    def _extend(
        self,
        table: ExampleTable,
        signature: int,
        pool: NDArray[np.intp],
        *,
        fresh: int,
        flags: bool = False,
    ) -> None:
        """Extend modes by terms that new examples show; what one mode tells, older examples of others confirm."""
        while (
            wider := extended(self.population.known(table), signature, pool, fresh=fresh, flags=flags)
        ) is not None:
            self.adopt(table, signature, wider)
            left = self._pool(table, signature)
            if len(left) >= len(pool):
                return
            pool, fresh = left, len(left)

    def _patience(self, search: Search, dear: bool, doubtful: bool) -> int:
        """News to wait for until the next search: the more, the oftener it was in vain.

        It is longer where searches are dear, for features, or may be in vain, since nobody said that there are laws.
        Where they are cheap it may take many to find the first law of many, and none is given up.
        """
        population = self.population
        lost = dear and population.seen >= RECENT and 2 * population.noise_examples > population.seen
        if population.approximate or lost:  # what an approximation leaves is mostly its own tail
            return search.failures * search.failures
        return search.failures if doubtful else math.isqrt(search.failures)

    def _newest(self, table: ExampleTable, signature: int) -> NDArray[np.intp]:
        """The end of `_pool`, all that `extended` looks at: found without a look at everything that is remembered."""
        if is_flag(self.population.y):  # how many took a value counts
            return self._pool(table, signature)
        found, end, length = np.empty(0, dtype=np.intp), len(self.population.y), 2 * SEARCHED_ROWS
        while end > 0 and len(found) < SEARCHED_ROWS:
            found = np.concatenate([self._pool(table, signature, slice(max(end - length, 0), end)), found])
            end, length = end - length, 2 * length
        return found[-SEARCHED_ROWS:]

    def _pool(self, table: ExampleTable, signature: int, among: slice = slice(None)) -> NDArray[np.intp]:
        """Noise examples of one signature that aren't some mode's tail, oldest first; default: among all."""
        population = self.population
        pool: NDArray[np.intp] = np.flatnonzero(population.labels[among] == NOISE) + (among.start or 0)
        pool = pool[table.signature_ids[population.rows[pool]] == signature]
        if len(pool) and population.clusters:
            pool = pool[population.least_errors(table, pool) > population.scale.tail]
        return pool

    def review(self, table: ExampleTable) -> bool:
        """Where noise is large, look for modes whose examples others explain by chance, and assign all anew."""
        population = self.population
        by_chance = (
            not population.scale.misfit and verifying_bits(population.y, population.scale) <= 0.5 * EXACT
        )
        # In a world of one state all examples are where they are; there noise that depends on the action would give
        # its quiet actions a mode of their own, and leave the loud ones without any (LunarLander's engine).
        states = table.strata[population.rows]
        population.chancy = by_chance and bool((states != states[0]).any())
        if not population.chancy:
            return False
        ids = table.signature_ids[population.rows]
        for signature in np.unique(ids).tolist():
            there = np.flatnonzero(ids == signature)
            for _ in range(ALTERNATIVES):
                found = self._among_suspects(table, signature, there)
                if found is None or not self._take_over(table, signature, *found):
                    break
        population.reassign_all(table)
        population.prune(table)
        return True

    def _among_suspects(
        self, table: ExampleTable, signature: int, examples: NDArray[np.intp]
    ) -> tuple[LinearFit, NDArray[np.intp]] | None:
        """A function of the object's own state that explains suspects well enough, and those that it takes over."""
        population = self.population
        slots = table.signatures[signature]
        order, stages = slots.preference(population.target)
        order = order[: stages[0]]
        known = population.least_errors(table, examples)
        strata = table.strata[population.rows[examples]]
        part = suspects(strata, known, population.scale)
        rows = population.rows[examples[part]]
        evidence = Evidence(
            slots.matrix(table.x[rows], order),
            population.y[examples[part]],
            known[part],
            scale=population.scale,
            spread=float(np.ptp(population.y)),
        )
        config = population.config
        found = likeliest(evidence, strata[part], rng=self._rng, draws=config.draws, most=config.max_terms)
        if found is None:
            return None
        taken = examples[part[evidence.close(found) & (known[part] > population.scale.surprising)]]
        if 2 * len(taken) < population.needed:
            return None
        return reordered(found, order), taken

    def _take_over(
        self, table: ExampleTable, signature: int, fit: LinearFit, taken: NDArray[np.intp]
    ) -> bool:
        """Make a mode of suspects' function; whether that leaves more modes, and none worse explained for it."""
        population = self.population
        known = population.known(table)
        cluster, absorbed = generalise(known, known.cluster(fit, signature), taken, rng=self._rng)
        kept = [c for i, c in population.clusters.items() if i not in absorbed]
        if absorbed and population.misfit(table, [*kept, cluster]) > population.misfit(
            table, population.clusters.values()
        ):
            return False  # another of the same, that suits these better and all others worse
        population.labels[taken] = NOISE
        population.install(table, cluster, absorbed)
        return not absorbed

    def adopt(self, table: ExampleTable, signature: int, fit: LinearFit) -> None:
        """Make a mode of a function: unify it with the known ones (§3.2.5), reassign examples (§3.2.4)."""
        known = self.population.known(table)
        self.admit(table, known, known.cluster(fit, signature))

    def admit(self, table: ExampleTable, known: Known, cluster: Cluster) -> int:
        """Take up a mode that has no id yet; the id that it gets."""
        population = self.population
        members = population.explained(table, cluster, population.noise())
        return population.install(table, *generalise(known, cluster, members, rng=self._rng))

    def to_json(self) -> dict[str, Any]:
        """Plain data that `restore` reads back: when to search, and the state of the random numbers."""
        return {
            "searches": [[i, s.waiting, s.failures] for i, s in sorted(self._searches.items())],
            "random": self._rng.bit_generator.state,
        }

    def restore(self, data: dict[str, Any]) -> None:
        """Take over what `to_json` wrote."""
        self._searches = {int(i): Search(int(w), int(f)) for i, w, f in data["searches"]}
        self._rng.bit_generator.state = data["random"]
