"""The clusterer of one target: EM, discovery and unification over a stream of examples (§3.2, Figure 3.2)."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.assignments import AssignmentLog
from relgym.clustering.discovery import Scale, least_examples
from relgym.clustering.em import Cluster, refit
from relgym.clustering.examples import ExampleTable
from relgym.clustering.last_resort import Resort, timely
from relgym.clustering.mode import NOISE, Mode, Role
from relgym.clustering.mode_search import ModeSearch
from relgym.clustering.noise import coded_by_a_law, estimate_noise, refuted, rounding_noise
from relgym.clustering.population import ClusterReport, Population
from relgym.config import ClusteringConfig
from relgym.config.constants import ALIKE, FEWEST, FIRST, OFTEN, RECENT, ROUGH, SEARCHED_CELLS, SELDOM
from relgym.scene.objects import Target
from relgym.scheduling.agenda import Budget
from relgym.scheduling.renewal import due

__all__ = ["ClusterReport", "ModeClusterer"]


class ModeClusterer:
    """Segments a target's examples into modes, one example at a time.

    Parameters
    ----------
    target
        The target whose examples it sees.
    config
        Free parameters.
    seed
        Seed of the random draws; the same examples and seed give the same modes.

    Attributes
    ----------
    population
        The examples and the modes they are assigned to.
    search
        The search for further modes among them.
    floor
        Rounding noise, the least that is possible, in units of the target.
    reach
        The largest magnitude that the target ever had; 0 before the first.
    due
        Whether an approximation is to be sought at the next opportunity, once the one under way, if any, is found.

    Notes
    -----
    Cost per example: one evaluation of every mode, O(modes * terms * assignments). A search runs only when an
    unexplained example came, ever more rarely while searches fail. Every loop ends: a search that finds a
    mode shrinks the noise, a unification lowers the number of modes, and both are counted.
    """

    def __init__(self, target: Target, config: ClusteringConfig, *, seed: int) -> None:
        self.population = Population(target, config)
        self.search = ModeSearch(self.population, seed=seed)
        self.floor = float(np.finfo(np.float64).eps)
        self.reach = 0.0
        self.due = False
        self._resort: Resort | None = None  # the search for an approximation, under way
        self._sought = 0  # after so many examples the latest one began
        self._anew = False  # other next values are given since the latest one: laws are searched for first
        self._estimating = False  # whether the noise is to be estimated anew
        self._largest = 0.0  # number among the columns and the target's values
        self._spread = 0.0  # noise found in the data, rounding apart

    # ------------------------------------------------------------------ what it knows
    @property
    def target(self) -> Target:
        """The target whose examples it sees."""
        return self.population.target

    @property
    def config(self) -> ClusteringConfig:
        """Free parameters."""
        return self.population.config

    @property
    def scale(self) -> Scale:
        """Noise as assumed at present, and the tolerances that follow from it."""
        return self.population.scale

    @property
    def approximate(self) -> bool:
        """Whether the noise assumed is what an approximation leaves, no exact law being known."""
        return self.population.approximate

    @property
    def waits(self) -> bool:
        """Whether a search for modes or for an approximation is under way, or one for an approximation is due."""
        return self.search.under_way or self.approximating or self.due

    @property
    def approximating(self) -> bool:
        """Whether a search for an approximation is under way."""
        return self._resort is not None

    @property
    def turn(self) -> tuple[bool, int] | None:
        """Sorting key: approximations under way, then those whose latest is oldest; None where none is wanted."""
        wanted = self.approximating or self.due or self._anew
        return (not self.approximating, self._sought) if wanted else None

    @property
    def clusters(self) -> dict[int, Cluster]:
        """The modes at work, by id."""
        return self.population.clusters

    @property
    def modes(self) -> tuple[Mode, ...]:
        """All modes but noise, by id."""
        return self.population.modes

    @property
    def y(self) -> NDArray[np.float64]:
        """Target values of all examples, shape ``(n,)``."""
        return self.population.y

    @property
    def labels(self) -> NDArray[np.int32]:
        """Mode id of every example, shape ``(n,)``."""
        return self.population.labels

    @property
    def rows(self) -> NDArray[np.int64]:
        """Row of every example in the example table, shape ``(n,)``."""
        return self.population.rows

    @property
    def noise_examples(self) -> int:
        """Number of examples no mode explains."""
        return self.population.noise_examples

    @property
    def seen(self) -> int:
        """Number of examples that it ever learned from, forgotten ones included."""
        return self.population.seen

    def pass_over(self, count: int = 1) -> None:
        """Count examples that aren't learned from, since others stand for them."""
        self.population.log.passed[NOISE] += count

    def stand_for(self, mode: int, others: int) -> None:
        """An example of a mode stands for so many that were passed over."""
        passed = self.population.log.passed
        found = min(others, passed[NOISE])
        passed[NOISE] -= found
        passed[mode] += found

    def fits(
        self, table: ExampleTable, examples: NDArray[np.intp]
    ) -> tuple[tuple[int, ...], NDArray[np.bool_]]:
        """Which modes explain the given examples: ids and a boolean array ``(len(examples), modes)``."""
        return self.population.fits(table, examples)

    def keep(self, rows: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Forget the examples of dropped rows of the example table; see `AssignmentLog.keep`."""
        return self.population.log.keep(rows)

    # ------------------------------------------------------------------ one example (Figure 3.2)
    def learn_one(
        self, table: ExampleTable, row: int, y: float, budget: Budget | None = None
    ) -> ClusterReport:
        """Take up one example: assign it, and where it is news, look for modes.

        Parameters
        ----------
        table, row
            The rows of the target's type, and the number of the example's.
        y
            The property's next value.
        budget
            What may be spent on searches; those that take more are gone on with (`go_on`). Default: all they take.
        """
        budget = Budget() if budget is None else budget
        before, installed = set(self.clusters), self.population.installed
        example, moved = self._append(table, row, y, budget), False
        errors = self.population.errors_of(table, example)
        if (mode := self.population.choose(table, example, errors)) != NOISE:
            self.labels[example] = mode
            moved = self._grow(table, mode)
        elif min(errors.values(), default=np.inf) > self.scale.tail:  # a known mode's tail seeds nothing
            self.search.discover(table, example, budget)
        reassigned = self.seen >= RECENT and due(self.seen, FIRST, OFTEN) and self._review(table)
        self.due |= self._timely(table)
        self.approximate_now(table, budget)
        moved |= self.population.installed > installed
        after = set(self.clusters)
        fitting = [i for i, e in errors.items() if e <= self.scale.tolerance]
        if reassigned or moved or after != set(errors):
            ids, known = self.fits(table, np.array([example]))
            fitting = [i for i, ok in zip(ids, known[0], strict=True) if ok]
        created, removed = tuple(sorted(after - before)), tuple(sorted(before - after))
        label, fits = int(self.labels[example]), tuple(sorted(fitting))
        return ClusterReport(label, fits, created, removed, reassigned=reassigned, moved=moved)

    @property
    def searching(self) -> bool:
        """Whether a search for modes is under way."""
        return self.search.under_way

    def go_on(self, table: ExampleTable, budget: Budget, *, begin: bool = False) -> bool:
        """Go on with the search for modes, as far as the budget goes; whether they are others than before.

        To `begin`, one is begun where all examples are news and the next one would begin it.
        """
        before, installed = set(self.clusters), self.population.installed
        if begin:
            self.search.search_all(table, budget)
        self.search.pursue(table, budget)
        return before != set(self.clusters) or self.population.installed > installed

    def _append(self, table: ExampleTable, row: int, y: float, budget: Budget) -> int:
        example = self.population.log.append(row, y)
        self._estimating |= due(self.seen, FIRST, SELDOM)
        core = table.signatures[table.signature_ids[row]].core
        largest = max(float(np.abs(table.x[row, :core]).max(initial=0.0)), abs(y))
        # Of many targets not all estimate in the same step.
        estimating = self._estimating and budget.left > 0
        if largest > self._largest or abs(y) > self.reach or estimating:
            self._largest, self.reach = max(largest, self._largest), max(abs(y), self.reach)
            self._rescale(table, budget, estimating=estimating)
        return example

    def _grow(self, table: ExampleTable, mode: int) -> bool:
        """§3.2.4, M-step: refit a mode whose examples have multiplied since its last fit; whether it is another now."""
        cluster = self.clusters[mode]
        cluster.unfitted += 1
        if cluster.unfitted < (self.config.refit_growth - 1.0) * cluster.fitted:
            return False
        members = np.flatnonzero(self.labels == mode)
        self.clusters[mode] = refit(cluster, table, self.rows[members], self.y[members], self.scale)
        self._split_rest(table, mode, members)
        return not self.clusters[mode].mode.same_function(cluster.mode)

    def _split_rest(self, table: ExampleTable, number: int, members: NDArray[np.intp]) -> None:
        """Give a mode's examples on which none of its terms acts a mode of their own, if they are enough.

        Where v = 0, both ``v' = 0`` and ``v' = -0.9 v`` hold. That is rest, not bouncing: the simpler law is
        stated apart, whichever was found first.
        """
        cluster = self.clusters[number]
        mode = cluster.mode
        if self.approximate or mode.intercept != 0.0 or mode.constant or mode.persists:
            return  # to an approximation, whatever is small looks like rest; and what persists rests at 0, too
        idle = members[np.abs(self.y[members]) <= self.scale.tolerance]
        idle = idle[cluster.idle(table, self.rows[idle], self.scale.tolerance)]
        if len(idle) < least_examples(self.y, self.scale, self.config):
            return
        bare = Mode(
            self.population.next_id, self.target, (Role(self.target.type, ()),), 0.0, sigma=self.scale.sigma
        )
        if any(bare.same_function(c.mode, slack=self.scale.sigma) for c in self.clusters.values()):
            return
        self.clusters[bare.id] = Cluster(bare, fitted=len(idle))
        self.population.next_id += 1
        self.labels[idle] = bare.id

    # ------------------------------------------------------------------ noise scale
    def _rescale(self, table: ExampleTable, budget: Budget, *, estimating: bool) -> None:
        if self.config.noise_std != "auto":
            self.population.scale = replace(self.scale, sigma=float(self.config.noise_std))
            return
        recent = self.rows[-256:]
        slots = table.signatures[table.signature_ids[recent[-1]]]
        own = table.x[recent][:, : slots.core]
        observed = np.delete(own, [k for k in slots.actions if k < slots.core], axis=1)
        latest = self.y[-256:]
        changes = latest - slots.present_of(table.x, recent, self.target)
        floor = rounding_noise(own, np.append(latest, self.reach), observed, changes=changes)
        self.floor = floor
        self._estimating &= not estimating
        if estimating and 2 * self.noise_examples > self.seen:
            budget.spend(2 * SEARCHED_CELLS)  # two kinds of functions: each takes a look at as many numbers
            part, x, width = self._unclear(table)
            strata = table.strata[self.rows[part]]
            estimate = estimate_noise(x, self.y[part], strata, floor=floor, own=width)
            if (
                estimate is not None
                and self._refutes(estimate)
                and not self._lawful(part, x[:, :width], estimate, budget)
            ):
                self._spread, self.population.approximate = estimate if estimate > floor else 0.0, False
                self._start_over()
        self._assume(max(floor, self._spread))

    def _refutes(self, estimate: float) -> bool:
        """Whether an estimate of the noise refutes the one that is assumed: it is larger, or most was overrated.

        Where most is unexplained, the first few examples overrated it if more of them show less than half of it.
        """
        if 2.0 * estimate < self.scale.sigma and not self.approximate:
            return True
        explained = 1.0 - self.noise_examples / self.seen
        return refuted(self.scale.sigma, estimate, explained=explained, y=self.y)

    def _assume(self, sigma: float) -> None:
        """Another noise: the tolerances follow."""
        self.population.scale = replace(self.scale, sigma=sigma, misfit=self.approximate)

    def _review(self, table: ExampleTable) -> bool:
        """The same with the noise that the modes known so far leave, which tells more than a first estimate did.

        Where only rounding was assumed, they leave more than that if less of it is now: columns have been seen to vary.
        """
        rounding, moved = self._spread <= self.floor and not self.approximate, False
        if (self.population.chancy or rounding) and self.config.noise_std == "auto":
            left = self.population.residual_spread(table)
            if left > self.floor * (1.0 if self.population.chancy else ROUGH):
                self._spread = left
                self._assume(left)
                if rounding:  # what was beyond the tolerance that there was
                    noise = self.population.noise()
                    self.population.rehome(table, noise)
                    moved = len(self.population.noise()) < len(noise)
        return self.search.review(table) or moved

    def _unclear(self, table: ExampleTable) -> tuple[NDArray[np.intp], NDArray[np.float64], int]:
        """Examples of the signature that holds most of the unexplained ones, their columns, and how many are own."""
        ids = table.signature_ids[self.rows]
        most = int(np.bincount(ids[self.labels == NOISE], minlength=1).argmax())
        part = np.flatnonzero(ids == most)
        slots = table.signatures[most]
        order, stages = slots.preference(self.target)
        order = order[order < len(slots.columns)]
        return part, table.x[self.rows[part]][:, order], stages[0]

    def _lawful(
        self, part: NDArray[np.intp], x: NDArray[np.float64], estimate: float, budget: Budget
    ) -> bool:
        """Whether a law that too few obey yet says more of the first examples than so much noise does."""
        if len(self.y) >= RECENT or estimate <= self.scale.sigma:
            return False
        left = self.labels[part] == NOISE
        budget.spend(self.config.draws * x.shape[1] * FEWEST)
        rng = np.random.default_rng(len(self.y))
        y = self.y[part[left]]
        return coded_by_a_law(x[left], y, self.scale, estimate, draws=self.config.draws, rng=rng)

    def _start_over(self) -> None:
        """Another noise scale: forget the modes, all examples become noise and are searched again."""
        self.search.start_over()
        self.population.start_over()

    def retarget(self, target: Target) -> None:
        """Be given other next values: the examples stay, modes are searched again."""
        self.population.target = target
        # Who waited for an approximation, or had one, needs one again, unless there is a law now.
        self.due |= self.approximating or self.approximate
        self._anew = True
        self._spread, self.population.approximate, self._resort = 0.0, False, None
        self._assume(self.floor)
        self._start_over()

    # ------------------------------------------------------------------ the last resort
    @property
    def _hopeless(self) -> bool:
        """Whether exact laws explain too little."""
        # Where noise was assumed to be larger than rounding, that may have been a curve that features would follow.
        return 2 * self.noise_examples > self.seen or self._spread > 0.0

    def _timely(self, table: ExampleTable) -> bool:
        """Whether it is time to look for an approximation, since exact laws explain too little."""
        if self.config.noise_std != "auto" or not timely(self.population, table, again=self.approximate):
            return False
        return self._hopeless

    def approximate_now(self, table: ExampleTable, budget: Budget) -> bool:
        """Look for an approximation, the law of last resort, if one is due; whether it is found and taken.

        As far as the budget goes: it is called again until none is `approximating` or `due`.
        """
        if self._resort is None:
            if self._anew and self.search.tried:  # for laws, in vain
                self._anew = False
                self.due |= self.config.noise_std == "auto" and self.seen >= RECENT
            if not self.due or not budget.left or self._anew:
                return False  # what waits holds no data
            self.due = False
            if not self._hopeless:
                return False
            self._resort = Resort.of(self.population, table, floor=self.floor, again=self.approximate)
            self._sought = self.seen
        if not budget.work(self._resort.task):
            return False
        found = self._resort.found(self.population, table, floor=self.floor, again=self.approximate)
        self._resort = None
        if found is None:
            return False
        self._spread, self.population.approximate = found.sigma, True
        self._assume(max(self.floor, found.sigma))
        self._start_over()
        self.search.adopt(table, found.signature, found.fit)
        return True

    def absorb(
        self, other: ModeClusterer, table: ExampleTable, rows: NDArray[np.int64], *, functions: bool
    ) -> None:
        """Take up another clusterer's examples and modes, as if this one had seen them.

        Parameters
        ----------
        other
            Of the same property; unchanged.
        table, rows
            Where its examples lie now: row of each in the table, shape ``(n,)``.
        functions
            Whether its modes may be taken over: not if they were given other next values.
        """
        first = len(self.population.log)
        for row, y in zip(rows.tolist(), other.y.tolist(), strict=True):
            self.population.log.append(row, y)
        self._largest, self.reach = max(self._largest, other._largest), max(self.reach, other.reach)
        self._spread, self.floor = max(self._spread, other._spread), max(self.floor, other.floor)
        self.population.approximate |= other.approximate
        self._assume(max(self.scale.sigma, other.scale.sigma))
        self.population.rehome(table, np.arange(first, len(self.population.log)))
        matched = {NOISE: NOISE}
        for i, cluster in sorted(other.clusters.items()):
            alike = [
                k
                for k, c in sorted(self.clusters.items())
                if c.mode.same_function(cluster.mode, ALIKE, slack=self.scale.sigma)
            ]
            if alike:
                matched[i] = alike[0]
            elif (
                functions
                and len(self.population.explained(table, Cluster(cluster.mode), self.population.noise()))
                >= FEWEST
            ):
                own = Cluster(replace(cluster.mode, id=0, target=self.target))
                matched[i] = self.search.admit(table, self.population.known(table), own)
        log, its = self.population.log, other.population.log
        for mine, theirs in ((log.forgotten, its.forgotten), (log.passed, its.passed)):
            for i, count in theirs.items():
                mine[matched.get(i, NOISE)] += count
        self.population.log.seen += other.population.log.seen - len(other.population.log)

    # ------------------------------------------------------------------ saving
    def to_json(self) -> dict[str, Any]:
        """Everything but the examples."""
        passed = sorted([mode, count] for mode, count in self.population.log.passed.items() if count)
        return {
            "sigma": self.scale.sigma,
            "next_id": self.population.next_id,
            "largest": self._largest,
            "reach": self.reach,
            "spread": self._spread,
            "rounding": self.floor,
            "approximate": self.approximate,
            **({"due": True} if self.due or self.approximating else {}),
            **({"chancy": True} if self.population.chancy else {}),
            **({"estimating": True} if self._estimating else {}),
            **({"passed": passed} if passed else {}),
            "noise": self.population.unexplained,
            "modes": [m.to_json() for m in self.modes],
            "fitted": [[i, c.fitted, c.unfitted] for i, c in sorted(self.clusters.items())],
            **self.search.to_json(),
        }

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The examples: target values, modes and rows."""
        return self.population.log.to_arrays()

    def restore(self, data: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
        """Take over what `to_json` and `to_arrays` wrote; without arrays there are no examples."""
        self.population.next_id = int(data["next_id"])
        self._largest, self.reach = float(data["largest"]), float(data["reach"])
        self.population.approximate, self.due = bool(data["approximate"]), bool(data.get("due", False))
        self.population.chancy = bool(data.get("chancy", False))
        self._estimating = bool(data.get("estimating", False))
        self._assume(float(data["sigma"]))
        self._spread, self.floor = float(data["spread"]), float(data["rounding"])
        self.population.known_noise = int(data["noise"])
        modes = {int(m["id"]): Mode.from_json(self.target, m) for m in data["modes"]}
        self.population.clusters = {
            int(i): Cluster(modes[int(i)], int(f), int(u)) for i, f, u in data["fitted"]
        }
        self.search.restore(data)
        if arrays:
            self.population.log = AssignmentLog.from_arrays(arrays)
            self.population.log.passed = Counter({int(i): int(n) for i, n in data.get("passed", ())})
