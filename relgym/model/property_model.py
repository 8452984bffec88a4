"""The model of one target: its modes, when each holds, and which objects play its roles (Figure 1.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.classification.examples import Example, Vocabulary
from relgym.classification.examples import NOISE as UNKNOWN
from relgym.classification.mode_classifier import ModeClassifier
from relgym.classification.role_classifier import RoleClassifier
from relgym.clustering.clusterer import ClusterReport, ModeClusterer
from relgym.clustering.em import Cluster
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE, Mode
from relgym.clustering.roles import Binding, bind
from relgym.config import ModelConfig
from relgym.model.perception import Situation
from relgym.model.prediction import OUTCOMES, Outcome
from relgym.scene.objects import Target

__all__ = ["PropertyModel", "Verdict"]


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a property model says of n examples: arrays of shape ``(n,)``.

    `objects` lists, for each example, the object index of every role of its mode.
    """

    values: NDArray[np.float64]
    modes: NDArray[np.int64]
    outcomes: NDArray[np.int8]
    margins: NDArray[np.float64]
    objects: list[tuple[int, ...]]


class PropertyModel:
    """Learns and predicts one target.

    Parameters
    ----------
    target
        What it predicts.
    vocabulary
        Names of what its classifiers are shown.
    config
        Free parameters.
    """

    def __init__(self, target: Target, vocabulary: Vocabulary, config: ModelConfig) -> None:
        self.target = target
        self.config = config
        self.clusterer = ModeClusterer(target, config.clustering, seed=config.seed)
        self.classifier = ModeClassifier(vocabulary, config.classification)
        self.roles: dict[int, RoleClassifier] = {}
        self._bindings: dict[tuple[int, int], Binding | None] = {}
        self._functions: dict[int, Mode] = {}

    @property
    def modes(self) -> tuple[Mode, ...]:
        """All modes but noise, by id."""
        return self.clusterer.modes

    # ------------------------------------------------------------------ learning
    def learn_one(
        self, table: ExampleTable, row: int, y: float, situation: Situation, example: Example
    ) -> ClusterReport:
        """Take up one example: cluster it, then let the classifiers see where it belongs.

        Parameters
        ----------
        table, row
            The example's regression row.
        y
            The property's next value.
        situation, example
            How the target object is situated; `situation` of a single scene.
        """
        report = self.clusterer.learn_one(table, row, y)
        if report.changed:
            self._relabel(table)
        number = len(self.clusterer.y) - 1
        fits = np.array([i in report.fits for i in self._ids], dtype=bool)
        values = self._values(situation, table.x[row : row + 1])[0]
        roles = self._played(table, number, report.mode, situation)
        assigned = UNKNOWN if report.mode == NOISE else report.mode
        seen = Example(
            example.table, example.unary, example.close, example.pair, example.own, example.target, example.key, number
        )
        self.classifier.observe(seen, assigned, fits, values, roles=roles)
        self._observe_roles(report.mode, seen, roles)
        return report
