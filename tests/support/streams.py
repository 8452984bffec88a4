"""Streams of examples for a clusterer, without scenes: regression rows in one or several slot signatures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from relgym.clustering.clusterer import ClusterReport, ModeClusterer
from relgym.clustering.columns import SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import Mode, Role
from relgym.config import ClusteringConfig
from relgym.scene.objects import ObjectType, Target

BALL = ObjectType("ball", ("v", "w"))
ALONE = SlotSignature((BALL,))
V = Target("ball", "v")


class Stream:
    """A clusterer of ``ball.v`` with the table it reads; `feed` gives it rows in one relational state.

    Parameters
    ----------
    signature
        Types of the slots of all rows.
    """

    def __init__(
        self, signature: SlotSignature = ALONE, config: ClusteringConfig | None = None, *, seed: int = 0
    ) -> None:
        self.signature = signature
        self.table = ExampleTable()
        self.clusterer = ModeClusterer(V, config or ClusteringConfig(), seed=seed)

    def feed(
        self, rows: Iterable[Sequence[float]], values: Iterable[float], state: bytes = b""
    ) -> list[ClusterReport]:
        """Take up examples one by one; rows follow the order of the signature's columns."""
        bodies = [-1] * len(self.signature.types)
        return [
            self.clusterer.learn_one(
                self.table, self.table.add(self.signature, np.asarray(row, dtype=float), state, bodies), value
            )
            for row, value in zip(rows, values, strict=True)
        ]

    @property
    def formulas(self) -> list[str]:
        """Functions of all modes to six digits, sorted."""
        return sorted(m.formula(6) for m in self.clusterer.modes)

    def counts(self) -> dict[str, int]:
        """Examples of each function, and of the noise where there is any."""
        found = {m.formula(6): m.examples for m in self.clusterer.modes}
        noise = self.clusterer.noise_examples
        return found | ({"noise": noise} if noise else {})


def mode_of(
    *terms: tuple[str, float], others: Sequence[Role] = (), constant: float = 0.0, id: int = 1
) -> Mode:
    """A mode of ``ball.v`` by hand."""
    return Mode(id, V, (Role("ball", tuple(terms)), *others), constant)
