"""How far examples scatter about their modes, mode by mode and action by action.

Noise need not be the same everywhere: an engine that fires makes what follows uncertain, one that rests doesn't. The
spread that goes with a prediction is that of training examples of the same mode after the same action, where the agent
chooses among a few; else that of the mode.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.clusterer import ModeClusterer
from relgym.clustering.columns import SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.scene.objects import ACTION

__all__ = ["Spread", "Spreads", "measure"]

ROWS = 2_000
"""At most this many examples of a mode, the newest, are measured."""

FEW_ACTIONS, LEAST = 8, 8
"""More different actions than this are no choice among a few; fewer examples of one say nothing of its spread."""

_Action = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Spread:
    """Standard deviations of residuals, in units of the target: over all, and by action where there are few."""

    whole: float
    by_action: dict[_Action, float] = field(default_factory=dict)

    def uneven(self, factor: float = 3.0) -> bool:
        """Whether some action scatters so many times as much as another one."""
        values = self.by_action.values()
        return bool(values) and max(values) > factor * min(values)


class Spreads:
    """Spreads of a target's modes, by id.

    Parameters
    ----------
    by_mode
        The spreads.
    """

    def __init__(self, by_mode: Mapping[int, Spread] | None = None) -> None:
        self.by_mode = dict(by_mode or {})

    def of(self, mode: int, action: _Action) -> float:
        """Spread of a mode after an action; NaN if it was never measured."""
        spread = self.by_mode.get(mode)
        return float("nan") if spread is None else spread.by_action.get(action, spread.whole)

    def of_many(self, modes: NDArray[np.int64], actions: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same for n predictions, actions of shape ``(n, components)``."""
        pairs = zip(modes.tolist(), map(tuple, actions.tolist()), strict=True)
        return np.array([self.of(mode, action) for mode, action in pairs])

    def to_json(self) -> list[Any]:
        """Plain data that `from_json` reads back."""
        return [
            [mode, s.whole, [[list(action), value] for action, value in s.by_action.items()]]
            for mode, s in sorted(self.by_mode.items())
        ]

    @classmethod
    def from_json(cls, data: Sequence[Any]) -> Spreads:
        """Read what `to_json` wrote."""
        return cls(
            {
                int(mode): Spread(float(whole), {tuple(map(float, a)): float(v) for a, v in by_action})
                for mode, whole, by_action in data
            }
        )


def measure(clusterer: ModeClusterer, table: ExampleTable) -> Spreads:
    """Measure all modes of a target. Cost: O(modes) evaluations of at most `ROWS` rows each."""
    found: dict[int, Spread] = {}
    for number, cluster in sorted(clusterer.clusters.items()):
        members = np.flatnonzero(clusterer.labels == number)[-ROWS:]
        rows = clusterer.rows[members]
        if len(members):
            error, _ = cluster.errors(table, rows, clusterer.y[members], clusterer.scale)
            found[number] = Spread(_size(error), _by_action(error, _actions(table, rows)))
    return Spreads(found)


def action_columns(signature: SlotSignature) -> NDArray[np.intp]:
    """Columns of the action's properties."""
    return np.array(
        [
            k
            for k, c in enumerate(signature.columns)
            if signature.types[c.slot].name == ACTION and not c.property.endswith("'")
        ],
        dtype=np.intp,
    )


def _actions(table: ExampleTable, rows: NDArray[np.int64]) -> NDArray[np.float64] | None:
    """Actions of some rows, shape ``(n, components)``; None if the rows don't agree on where they stand."""
    signatures = np.unique(table.signature_ids[rows])
    if len(signatures) != 1:
        return None
    return table.x[rows][:, action_columns(table.signatures[int(signatures[0])])]


def _by_action(error: NDArray[np.float64], actions: NDArray[np.float64] | None) -> dict[_Action, float]:
    if actions is None or not actions.shape[1]:
        return {}
    kinds, which = np.unique(actions, axis=0, return_inverse=True)
    if not 1 < len(kinds) <= FEW_ACTIONS:
        return {}
    parts = [(tuple(kind), error[which.reshape(-1) == k]) for k, kind in enumerate(kinds.tolist())]
    return {kind: _size(part) for kind, part in parts if len(part) >= LEAST}


def _size(error: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.square(error).mean()))
