"""A target's examples and modes, and which mode each example is assigned to (§3.2.4, the E-step)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.assignments import AssignmentLog
from relgym.clustering.discovery import Scale, least_examples
from relgym.clustering.em import Cluster, preferred, refit
from relgym.clustering.examples import ExampleTable
from relgym.clustering.merging import Known
from relgym.clustering.mode import NOISE, Mode
from relgym.config import ClusteringConfig
from relgym.config.constants import MOST_ROWS, ROUNDS
from relgym.scene.objects import Target

__all__ = ["ClusterReport", "Population"]


@dataclass(frozen=True, slots=True)
class ClusterReport:
    """What one example changed.

    Attributes
    ----------
    mode
        Id of the mode the example was assigned to; `NOISE` if none explains it.
    fits
        Ids of all modes that explain it.
    created, removed
        Ids of modes that came and went.
    reassigned
        Whether older examples were assigned anew.
    moved
        Whether a mode's function is another one since it was fitted to more, or it took the place of others.
    """

    mode: int
    fits: tuple[int, ...]
    created: tuple[int, ...] = ()
    removed: tuple[int, ...] = ()
    reassigned: bool = False
    moved: bool = False

    @property
    def changed(self) -> bool:
        """Whether the set of modes is another than before, or its examples or functions are."""
        return bool(self.created or self.removed or self.reassigned or self.moved)


class Population:
    """Examples of one target and the modes they belong to; how modes are found is the clusterer's business.

    Parameters
    ----------
    target
        The target whose examples they are.
    config
        Free parameters.

    Attributes
    ----------
    clusters
        The modes at work, by id.
    scale
        Noise as assumed at present, and the tolerances that follow from it.
    approximate
        Whether the noise assumed is what an approximation leaves, no exact law being known.
    chancy
        Whether noise is so large that modes explain others' examples by chance.
    log
        The examples, and their modes by id.
    next_id
        Id of the next new mode.
    installed
        How often a mode was put in the place of others, or of none.
    known_noise
        Examples that no mode explained, of a model that was loaded without its examples.
    """

    def __init__(self, target: Target, config: ClusteringConfig) -> None:
        self.target = target
        self.config = config
        self.clusters: dict[int, Cluster] = {}
        self.scale = Scale(float(np.finfo(np.float64).eps), config.inlier_stds, config.tail_stds)
        self.log = AssignmentLog()
        self.next_id = 1
        self.installed = 0
        self.known_noise = 0
        self.approximate = False
        self.chancy = False

    @property
    def y(self) -> NDArray[np.float64]:
        """Target values of all examples, shape ``(n,)``."""
        return self.log.y

    @property
    def labels(self) -> NDArray[np.int32]:
        """Mode id of every example, shape ``(n,)``."""
        return self.log.labels

    @property
    def rows(self) -> NDArray[np.int64]:
        """Row of every example in the example table, shape ``(n,)``."""
        return self.log.rows

    @property
    def modes(self) -> tuple[Mode, ...]:
        """All modes but noise, by id."""
        if not len(self.log):
            return tuple(c.mode for _, c in sorted(self.clusters.items()))
        counts = self._counts()
        return tuple(c.mode.with_examples(counts[i]) for i, c in sorted(self.clusters.items()))

    def _counts(self) -> dict[int, int]:
        """Examples of each mode and of none (`NOISE`), with those that they stand for."""
        counts = {
            i: int(np.count_nonzero(self.labels == i)) + self.log.forgotten[i]
            for i in (NOISE, *self.clusters)
        }
        return {
            i: count + more
            for (i, count), more in zip(counts.items(), self._stood_for(counts).values(), strict=True)
        }

    def _stood_for(self, counts: Mapping[int, int]) -> dict[int, int]:
        """How many examples those of each mode, and of none, stand for beside themselves.

        Of what nobody stands for, yet or any more, each has as large a share as of the others.
        """
        found = {i: self.log.passed[i] if i != NOISE else 0 for i in counts}
        left, total = self.log.passed[NOISE], sum(counts.values())
        if left and total:
            for i in sorted(counts):
                found[i] += left * counts[i] // total
            most = max(sorted(counts), key=lambda i: counts[i])
            found[most] += self.log.passed.total() - sum(found.values())
        return found

    @property
    def unexplained(self) -> int:
        """Number of steps that no mode explains, those included that `noise_examples` stand for."""
        return self._counts()[NOISE] if len(self.log) else self.known_noise

    @property
    def noise_examples(self) -> int:
        """Number of examples no mode explains; where there are none any more, with those that they stood for."""
        if not len(self.log):
            return self.known_noise
        return int(np.count_nonzero(self.labels == NOISE)) + self.log.forgotten[NOISE]

    @property
    def seen(self) -> int:
        """Number of examples that ever came, forgotten ones included."""
        return self.log.seen

    @property
    def needed(self) -> int:
        """Examples that found a mode: each verifies it by as many bits as tell it from all values seen."""
        return least_examples(self.y, self.scale, self.config)

    def start_over(self) -> None:
        """Forget the modes: all examples become noise."""
        self.clusters.clear()
        self.chancy = False  # the next review tells, of the scale then assumed
        for counted in (self.log.forgotten, self.log.passed):
            total = counted.total()
            counted.clear()
            counted[NOISE] = total
        self.labels[:] = NOISE

    def fits(
        self, table: ExampleTable, examples: NDArray[np.intp]
    ) -> tuple[tuple[int, ...], NDArray[np.bool_]]:
        """Which modes explain the given examples: ids and a boolean array ``(len(examples), modes)``."""
        ids = tuple(sorted(self.clusters))
        found = np.zeros((len(examples), len(ids)), dtype=bool)
        for k, i in enumerate(ids):
            error, _ = self.clusters[i].errors(table, self.rows[examples], self.y[examples], self.scale)
            found[:, k] = error <= self.scale.tolerance
        return ids, found

    def errors_of(self, table: ExampleTable, example: int) -> dict[int, float]:
        """What each mode misses one example by, by id."""
        row, y = int(self.rows[example]), float(self.y[example])
        x = table.x[row].tolist()
        return {i: c.error_one(table, row, x, y, self.scale) for i, c in self.clusters.items()}

    def choose(self, table: ExampleTable, example: int, errors: dict[int, float]) -> int:
        """E-step for one example that no mode has: the one of those that explain it; `NOISE` if none does."""
        fitting = [i for i, e in errors.items() if e <= self.scale.tolerance]
        if not fitting:
            return NOISE
        if not self.chancy or len(fitting) == 1:
            return preferred(fitting, errors, self.clusters, self.scale)
        labels = self.labels[-MOST_ROWS:]
        labels = labels[table.strata[self.rows[-MOST_ROWS:]] == table.strata[self.rows[example]]]
        ids = np.array(sorted(fitting))
        error = np.array([[errors[i] for i in ids.tolist()]])
        held = np.array([np.count_nonzero(labels == i) for i in ids], dtype=float)
        return int(ids[self._cost(ids, error, held[None])[0].argmin()])

    def _cost(
        self, ids: NDArray[np.intp], errors: NDArray[np.float64], held: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Evidence against each mode where noise is large, in nats, shape ``(n, modes)``.

        Its error; that it holds few examples in the same relational state; and each parameter.

        Parameters
        ----------
        ids
            Modes, shape ``(modes,)``.
        errors
            Of each example by each mode, ``(n, modes)``.
        held
            How many other examples of its state are assigned to each mode, likewise.
        """
        surprise = np.where(
            errors <= self.scale.tolerance, 0.5 * np.square(errors / self.scale.sigma), np.inf
        )
        size = np.array([self.clusters[i].fitted + self.clusters[i].unfitted for i in ids.tolist()])
        parameters = np.array([self.clusters[i].mode.parameters for i in ids.tolist()])
        cost: NDArray[np.float64] = surprise - np.log(held + size / size.sum()) + parameters
        return cost

    def reassign_all(self, table: ExampleTable) -> None:
        """E-step for all examples where noise is large, and M-step for all modes."""
        ids = np.array(sorted(self.clusters), dtype=np.intp)
        if not len(ids):
            return
        errors = np.stack(
            [self.clusters[i].errors(table, self.rows, self.y, self.scale)[0] for i in ids.tolist()], axis=1
        )
        explained = (errors <= self.scale.tolerance).any(axis=1)
        _, state = np.unique(table.strata[self.rows], return_inverse=True)
        for _ in range(ROUNDS):
            own = self.labels[:, None] == ids
            held = np.stack([np.bincount(state, weights=column) for column in own.T], axis=1)
            cost = self._cost(ids, errors, held[state] - own)
            self.labels[:] = np.where(explained, ids[cost.argmin(axis=1)], NOISE)
        for i in ids.tolist():
            members = np.flatnonzero(self.labels == i)
            self.clusters[i] = refit(self.clusters[i], table, self.rows[members], self.y[members], self.scale)

    def residual_spread(self, table: ExampleTable) -> float:
        """Root mean square of what modes leave of their examples; 0 if there are none.

        Not a median: where noise depends on the state, tolerances must suit the examples where it is large.
        """
        total, count = 0.0, 0
        for i, cluster in self.clusters.items():
            members = np.flatnonzero(self.labels == i)
            errors, _ = cluster.errors(table, self.rows[members], self.y[members], self.scale)
            total, count = total + float(np.square(errors).sum()), count + len(members)
        return float(np.sqrt(total / max(count, 1)))

    def noise(self) -> NDArray[np.intp]:
        """Numbers of the examples that no mode explains."""
        return np.flatnonzero(self.labels == NOISE)

    def explained(
        self, table: ExampleTable, cluster: Cluster, examples: NDArray[np.intp]
    ) -> NDArray[np.intp]:
        """Those of the given examples that a mode explains."""
        error, _ = cluster.errors(table, self.rows[examples], self.y[examples], self.scale)
        return examples[error <= self.scale.tolerance]

    def least_errors(
        self, table: ExampleTable, examples: NDArray[np.intp], clusters: Iterable[Cluster] | None = None
    ) -> NDArray[np.float64]:
        """Error of the mode that explains each example best, infinite where none applies; default: of all modes."""
        least = np.full(len(examples), np.inf)
        for cluster in self.clusters.values() if clusters is None else clusters:
            errors, _ = cluster.errors(table, self.rows[examples], self.y[examples], self.scale)
            least = np.minimum(least, errors)
        return least

    def misfit(self, table: ExampleTable, clusters: Iterable[Cluster]) -> float:
        """Sum of all examples' squared errors by the mode that explains each best, in squares of the tail."""
        least = self.least_errors(table, np.arange(len(self.log)), clusters)
        return float(np.square(np.minimum(least / self.scale.tail, 1.0)).sum())

    def known(self, table: ExampleTable) -> Known:
        """All of it, as those are shown who unify and extend modes."""
        return Known(
            table, self.rows, self.y, self.labels, self.clusters, self.target, self.scale, self.config
        )

    def install(self, table: ExampleTable, cluster: Cluster, absorbed: tuple[int, ...]) -> int:
        """Put a mode in the place of those it absorbed; its id: of one with the same function, as which it is known."""
        known = self.log.forgotten, self.log.passed
        inherited = [sum(counted.pop(i, 0) for i in absorbed) for counted in known]
        same = [
            i for i in absorbed if self.clusters[i].mode.same_function(cluster.mode, slack=self.scale.sigma)
        ]
        for i in absorbed:
            self.remove(i)
        new = same[0] if same else self.next_id
        self.next_id = max(self.next_id, new + 1)
        self.installed += 1
        self.clusters[new] = replace(cluster, mode=replace(cluster.mode, id=new))
        for counted, more in zip(known, inherited, strict=True):
            counted[new] += more
        self.reassign(table, new)
        return new

    def remove(self, mode: int) -> None:
        """A deleted mode gives its examples back to the noise, from where others take them."""
        del self.clusters[mode]
        for counted in (self.log.forgotten, self.log.passed):
            counted[NOISE] += counted.pop(mode, 0)
        self.labels[self.labels == mode] = NOISE

    def reassign(self, table: ExampleTable, new: int) -> None:
        """E-step for a new mode: it takes what it explains from the noise and from less simple modes."""
        everyone = self.explained(table, self.clusters[new], np.arange(len(self.log)))
        for example in everyone:
            held = int(self.labels[example])
            if held == NOISE or _simpler(self.clusters[new].mode, self.clusters[held].mode):
                self.labels[example] = new
        self.prune(table)
        for i in [new] if new in self.clusters else []:
            members = np.flatnonzero(self.labels == i)
            self.clusters[i] = refit(self.clusters[i], table, self.rows[members], self.y[members], self.scale)

    def prune(self, table: ExampleTable) -> None:
        """Delete modes that were left with fewer than T / 2 examples; their examples find other homes."""
        least = self.needed / 2
        for i in sorted(self.clusters):
            if (self.labels == i).sum() >= least or len(self.clusters) == 1:
                continue
            orphans = np.flatnonzero(self.labels == i)
            self.remove(i)
            self.rehome(table, orphans)

    def rehome(self, table: ExampleTable, examples: NDArray[np.intp]) -> None:
        """Assign examples that no mode has to those that explain them."""
        _, fits = self.fits(table, examples)
        for example in examples[fits.any(axis=1)].tolist():
            self.labels[example] = self.choose(table, example, self.errors_of(table, example))


def _simpler(mode: Mode, other: Mode) -> bool:
    return mode.parameters < other.parameters
