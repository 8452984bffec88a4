"""How far examples scatter about their modes, mode by mode and action by action.

Noise need not be the same everywhere: an engine that fires makes what follows uncertain, one that rests doesn't. The
spread that goes with a prediction is that of training examples of the same mode after the same action, where the agent
chooses among a few; else on the same side of a number's threshold, if one tells; else that of the mode.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.clusterer import ModeClusterer
from relgym.clustering.columns import PRIME, SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE
from relgym.config.constants import ENOUGH, FEW_VALUES, MOST_ROWS, ROUGH, TYPICAL
from relgym.model.target.spread_split import Split, find_split, place_of

__all__ = ["Spread", "Spreads", "measure"]

_Action = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Spread:
    """Standard deviations of residuals, in units of the target.

    Attributes
    ----------
    whole
        Over all examples.
    by_action
        By action, where an agent chooses among a few.
    pooled
        Whether it chooses among more than are told apart: what holds over all may hold after none.
    split
        By which side of a threshold a number lies, where that and no action tells them apart.
    """

    whole: float
    by_action: dict[_Action, float] = field(default_factory=dict)
    pooled: bool = False
    split: Split | None = None

    def uneven(self) -> bool:
        """Whether some action scatters more than twice as much as another one."""
        values = self.by_action.values()
        return bool(values) and max(values) > 2.0 * min(values)


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

    def at(self, mode: int, signature: SlotSignature, x: Sequence[float]) -> float:
        """Spread of a mode in the situation that a row of the table would describe; NaN if it was never measured."""
        spread = self.by_mode.get(mode)
        if spread is not None and spread.split is not None:
            place = place_of(spread.split.name, signature)
            if place is not None:
                return spread.split.of(x[place])
        return self.of(mode, tuple(x[k] for k in signature.actions))

    def to_json(self) -> list[Any]:
        """Plain data that `from_json` reads back."""
        return [
            [
                mode,
                s.whole,
                [[list(action), value] for action, value in s.by_action.items()],
                *([s.pooled] if s.pooled or s.split else []),
                *([s.split.to_json()] if s.split else []),
            ]
            for mode, s in sorted(self.by_mode.items())
        ]

    @classmethod
    def from_json(cls, data: Sequence[Any]) -> Spreads:
        """Read what `to_json` wrote."""
        found = {}
        for mode, whole, by_action, *rest in data:
            split = Split.from_json(rest[1]) if len(rest) > 1 and rest[1] is not None else None
            actions = {tuple(map(float, a)): float(v) for a, v in by_action}
            found[int(mode)] = Spread(float(whole), actions, bool(rest and rest[0]), split)
        return cls(found)


def measure(clusterer: ModeClusterer, table: ExampleTable) -> Spreads:
    """Measure all modes of a target. Cost: O(modes) evaluations of at most `MOST_ROWS` rows each."""
    found: dict[int, Spread] = {}
    own: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}
    for number, cluster in sorted(clusterer.clusters.items()):
        members = np.flatnonzero(clusterer.labels == number)[-MOST_ROWS:]
        rows = clusterer.rows[members]
        if not len(members):
            continue
        error, _ = cluster.errors(table, rows, clusterer.y[members], clusterer.scale)
        actions = _actions(table, rows)
        found[number] = Spread(_size(error), *_by_action(error, actions))
        if found[number].by_action and actions is not None:
            own[number] = error, actions
    for number, (error, rows) in _left_over(clusterer, table, list(own)).items():
        after = _actions(table, rows)
        if after is not None and after.shape[1] == own[number][1].shape[1]:
            found[number].by_action.update(_loud(*own[number], error, after))
    quiet = max(clusterer.floor, clusterer.scale.sigma / ROUGH)
    # What an approximation leaves is a curve, no noise that depends on where one is.
    for number, spread in () if clusterer.approximate else found.items():
        if spread.whole > quiet and not spread.uneven():
            found[number] = replace(spread, split=_split(clusterer, table, number))
    return Spreads(found)


def _split(clusterer: ModeClusterer, table: ExampleTable, mode: int) -> Split | None:
    """A threshold of a number, the target's own or of something without a body, that tells spreads apart."""
    members = np.flatnonzero(clusterer.labels == mode)[-MOST_ROWS:]
    ids = table.signature_ids[clusterer.rows[members]]
    core = {
        k: [table.signatures[k].named(c) for c in range(table.signatures[k].core)] for k in set(ids.tolist())
    }
    known = core[int(ids[-1])]
    members = members[np.isin(ids, [k for k, names in core.items() if names == known])]
    rows = clusterer.rows[members]
    error, _ = clusterer.clusters[mode].errors(table, rows, clusterer.y[members], clusterer.scale)
    places = np.array([k for k, name in enumerate(known) if not name.endswith(PRIME)], dtype=np.intp)
    names = [known[k] for k in places.tolist()]
    return find_split(error, table.x[np.ix_(rows, places)], names, clusterer.floor)


def _left_over(
    clusterer: ModeClusterer, table: ExampleTable, modes: Sequence[int]
) -> dict[int, tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Errors and rows of the newest noise, by the mode that comes closest."""
    noise = np.flatnonzero(clusterer.labels == NOISE)[-MOST_ROWS:]
    if not modes or not len(noise):
        return {}
    rows = clusterer.rows[noise]
    every = sorted(clusterer.clusters)
    errors = np.stack(
        [clusterer.clusters[k].errors(table, rows, clusterer.y[noise], clusterer.scale)[0] for k in every]
    )
    least = errors.argmin(axis=0)
    parts = {k: (least == every.index(k)) & np.isfinite(errors.min(axis=0)) for k in modes}
    return {k: (errors[every.index(k), part], rows[part]) for k, part in parts.items() if part.any()}


def _loud(
    error: NDArray[np.float64],
    actions: NDArray[np.float64],
    left: NDArray[np.float64],
    after: NDArray[np.float64],
) -> dict[_Action, float]:
    """Spreads after actions that throw most examples beyond the tolerance, where a mode's own are but the least off.

    A median, since some of what is left over may be of other modes that nobody knows yet.
    """
    found = {}
    for kind in np.unique(after, axis=0):
        own, beyond = error[(actions == kind).all(axis=1)], left[(after == kind).all(axis=1)]
        if len(beyond) >= ENOUGH and len(beyond) > len(own):
            found[tuple(kind.tolist())] = float(np.median(np.concatenate([own, beyond]))) / TYPICAL
    return found


def _actions(table: ExampleTable, rows: NDArray[np.int64]) -> NDArray[np.float64] | None:
    """Actions of some rows, shape ``(n, components)``; None if they haven't as many components everywhere."""
    ids = table.signature_ids[rows]
    # Where the action's columns lie depends on which objects are there.
    places = {k: table.signatures[k].actions for k in np.unique(ids).tolist()}
    width = {len(columns) for columns in places.values()}
    if len(width) != 1:
        return None
    actions = np.empty((len(rows), width.pop()))
    for k, columns in places.items():
        part = np.flatnonzero(ids == k)
        actions[part] = table.x[np.ix_(rows[part], columns)]
    return actions


def _by_action(
    error: NDArray[np.float64], actions: NDArray[np.float64] | None
) -> tuple[dict[_Action, float], bool]:
    """Spreads by action, and whether there were too many actions, though they recur, for that."""
    if actions is None or not actions.shape[1]:
        return {}, False
    kinds, which = np.unique(actions, axis=0, return_inverse=True)
    if not 1 < len(kinds) <= FEW_VALUES:
        # A choice among many comes twice in the mean; other numbers are hardly ever the same.
        return {}, len(kinds) > FEW_VALUES and 2 * len(kinds) <= len(error)
    parts = [(tuple(kind), error[which.reshape(-1) == k]) for k, kind in enumerate(kinds.tolist())]
    return {kind: _size(part) for kind, part in parts if len(part) >= ENOUGH}, False


def _size(error: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.square(error).mean()))
