"""A target's examples and modes, and which mode each example is assigned to (§3.2.4, the E-step)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.assignments import AssignmentLog
from relgym.clustering.discovery import Scale, least_examples
from relgym.clustering.em import Cluster, preferred, refit
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE, Mode
from relgym.config import ClusteringConfig
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
    """

    mode: int
    fits: tuple[int, ...]
    created: tuple[int, ...] = ()
    removed: tuple[int, ...] = ()

    @property
    def changed(self) -> bool:
        """Whether the set of modes is another than before."""
        return bool(self.created or self.removed)


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
    """

    def __init__(self, target: Target, config: ClusteringConfig) -> None:
        self.target = target
        self.config = config
        self.clusters: dict[int, Cluster] = {}
        self.scale = Scale(1e-12, config.inlier_stds, config.tail_stds)
        self._log = AssignmentLog()
        self._next_id = 1
        self._known_noise = 0  # of a model that was loaded without its examples

    @property
    def y(self) -> NDArray[np.float64]:
        """Target values of all examples, shape ``(n,)``."""
        return self._log.y

    @property
    def labels(self) -> NDArray[np.int32]:
        """Mode id of every example, shape ``(n,)``."""
        return self._log.labels

    @property
    def rows(self) -> NDArray[np.int64]:
        """Row of every example in the example table, shape ``(n,)``."""
        return self._log.rows

    @property
    def modes(self) -> tuple[Mode, ...]:
        """All modes but noise, by id."""
        if not len(self._log):
            return tuple(c.mode for _, c in sorted(self.clusters.items()))
        counts = np.bincount(self.labels, minlength=self._next_id)
        dropped = self._log.forgotten
        return tuple(
            c.mode.with_examples(int(counts[i]) + dropped[i]) for i, c in sorted(self.clusters.items())
        )

    @property
    def noise_examples(self) -> int:
        """Number of examples no mode explains."""
        if not len(self._log):
            return self._known_noise
        return int((self.labels == NOISE).sum()) + self._log.forgotten[NOISE]

    @property
    def seen(self) -> int:
        """Number of examples that ever came, forgotten ones included."""
        return self._log.seen

    def keep(self, rows: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Forget the examples of dropped rows of the example table; see `AssignmentLog.keep`."""
        return self._log.keep(rows)

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

    def _errors_of(self, table: ExampleTable, example: int) -> dict[int, float]:
        rows, y = self.rows[example : example + 1], self.y[example : example + 1]
        return {i: float(c.errors(table, rows, y, self.scale)[0][0]) for i, c in self.clusters.items()}

    def _noise(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.labels == NOISE)

    def _explained(
        self, table: ExampleTable, cluster: Cluster, examples: NDArray[np.intp]
    ) -> NDArray[np.intp]:
        error, _ = cluster.errors(table, self.rows[examples], self.y[examples], self.scale)
        return examples[error <= self.scale.tolerance]

    def _remove(self, mode: int) -> None:
        """A deleted mode gives its examples back to the noise, from where others take them."""
        del self.clusters[mode]
        self._log.forgotten[NOISE] += self._log.forgotten.pop(mode, 0)
        self.labels[self.labels == mode] = NOISE

    def _reassign(self, table: ExampleTable, new: int) -> None:
        """E-step for a new mode: it takes what it explains from the noise and from less simple modes."""
        everyone = self._explained(table, self.clusters[new], np.arange(len(self._log)))
        for example in everyone:
            held = int(self.labels[example])
            if held == NOISE or _simpler(self.clusters[new].mode, self.clusters[held].mode):
                self.labels[example] = new
        self._prune(table)
        for i in [new] if new in self.clusters else []:
            members = np.flatnonzero(self.labels == i)
            self.clusters[i] = refit(self.clusters[i], table, self.rows[members], self.y[members], self.scale)

    def _prune(self, table: ExampleTable) -> None:
        """Delete modes that were left with fewer than T / 2 examples; their examples find other homes."""
        least = least_examples(self.y, self.scale, self.config) / 2
        for i in sorted(self.clusters):
            if (self.labels == i).sum() >= least or len(self.clusters) == 1:
                continue
            orphans = np.flatnonzero(self.labels == i)
            self._remove(i)
            self._rehome(table, orphans)

    def _rehome(self, table: ExampleTable, examples: NDArray[np.intp]) -> None:
        ids, fits = self.fits(table, examples)
        for example, row in zip(examples, fits, strict=True):
            fitting = [i for i, ok in zip(ids, row, strict=True) if ok]
            if fitting:
                errors = self._errors_of(table, int(example))
                self.labels[example] = preferred(fitting, errors, self.clusters, self.scale, self.config)


def _simpler(mode: Mode, rival: Mode) -> bool:
    return mode.parameters < rival.parameters
