"""Limits: a constant beyond which a property never goes, whatever the other modes would have it do.

A truck that friction stops stands still: ``v' = max(0, v + (F - friction) / M)``. Among the modes that is a
constant one, ``v' = 0``, and *when* it holds is a question about the value that the right one of the other
modes would give, with its roles filled, not about the scene. So it takes no part in the vote: the others are
ranked without it, and their winner's value is cut off at the limit. So the examples of a limit are examples of the
modes that would have led beyond it, and of no other: a counter that stays at 0 until it starts again shows, as long as
it stays, that it doesn't start.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.clusterer import ModeClusterer
from relgym.clustering.em import Cluster
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE, Mode
from relgym.config.constants import NEARLY_ALL, RECENT
from relgym.model.predicting.prediction import Prediction

__all__ = ["Limits", "constants", "find_limits", "furthest"]


@dataclass(frozen=True, slots=True)
class Limits:
    """The modes that bound a target.

    Attributes
    ----------
    low, high
        Ids of the modes that bound it from below and from above; `NOISE` where there is no bound.
    least, most
        Their values, in units of the target; infinite where there is no bound.
    """

    low: int = NOISE
    high: int = NOISE
    least: float = -np.inf
    most: float = np.inf

    def __contains__(self, mode: object) -> bool:
        return mode != NOISE and mode in (self.low, self.high)

    def overstepped(self, y: float, slack: float) -> bool:
        """Whether a value lies beyond what was taken for a limit."""
        return not self.least - slack <= y <= self.most + slack

    def cut_off(self, found: Prediction) -> Prediction:
        """The prediction, or the limit that it goes beyond."""
        if self.least <= found.value <= self.most:
            return found
        value, mode = (self.least, self.low) if found.value < self.least else (self.most, self.high)
        return found.replace(value=value, mode=mode, roles=found.roles[:1])

    def cut_off_all(self, values: NDArray[np.float64], modes: NDArray[np.int64]) -> None:
        """Likewise for many values and the modes that gave them, in place; NaN stays."""
        under, over = values < self.least, values > self.most
        values[under], modes[under] = self.least, self.low
        values[over], modes[over] = self.most, self.high

    def credited(
        self,
        labels: NDArray[np.integer],
        fits: NDArray[np.bool_],
        values: NDArray[np.float64],
        voters: Sequence[int],
        slack: float,
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Give the examples of limits to the modes that would have led beyond them.

        Parameters
        ----------
        labels
            Mode of each example, shape ``(n,)``.
        fits, values
            Whether each voting mode explains it, and what it says, shape ``(n, len(voters))``; NaN: its roles are open.
        voters
            Ids of the modes that take part in the vote, the first that leads beyond a limit is taken for the mode.
        slack
            Distance from a limit that counts as having reached it.

        Returns
        -------
        labels, fits
            New arrays; other examples are as they were.
        """
        given, fits = labels.astype(np.int64), fits.copy()
        for mode, beyond in (
            (self.low, values <= self.least + slack),
            (self.high, values >= self.most - slack),
        ):
            held = np.flatnonzero((labels == mode) & (mode != NOISE) & beyond.any(axis=1))
            if len(held):
                fits[held] = beyond[held]
                given[held] = np.asarray(voters)[beyond[held].argmax(axis=1)]
        return given, fits

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back: id and value of each bound there is."""
        bounds = {"low": (self.low, self.least), "high": (self.high, self.most)}
        return {side: list(bound) for side, bound in bounds.items() if bound[0] != NOISE}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Limits:
        """Read what `to_json` wrote."""
        low, least = data.get("low") or (NOISE, -np.inf)
        high, most = data.get("high") or (NOISE, np.inf)
        return cls(int(low), int(high), float(least), float(most))


def find_limits(clusterer: ModeClusterer, table: ExampleTable) -> Limits:
    """Which constant modes are limits.

    A constant is one if no example ever lay beyond it, and if where it held, some other mode would have led
    beyond it. A constant that holds for other reasons (a switch, a grip) is none.

    Parameters
    ----------
    clusterer
        Modes and examples of a target.
    table
        The rows of the examples.

    Notes
    -----
    Cost: at most `RECENT` examples of each constant under all modes and role assignments.
    """
    known = [(m.intercept, m.id) for m in constants(clusterer)]
    if not known:
        return Limits()
    slack = clusterer.scale.tolerance
    found = Limits()
    for side, (value, mode) in ((-1.0, known[0]), (1.0, known[-1])):
        beyond = (side * (clusterer.y - value)).max() > slack
        if not beyond and _led_beyond(clusterer, table, mode, value, side):
            low = side < 0.0
            found = replace(found, low=mode, least=value) if low else replace(found, high=mode, most=value)
    return found


def _led_beyond(clusterer: ModeClusterer, table: ExampleTable, mode: int, value: float, side: float) -> bool:
    """Whether the other modes would have led beyond a constant nearly everywhere that it held."""
    held = np.flatnonzero(clusterer.labels == mode)[-RECENT:]
    reach = furthest(clusterer, table, held, side, without=mode)
    return bool((reach >= side * value - clusterer.scale.tolerance).mean() >= NEARLY_ALL)


def constants(clusterer: ModeClusterer) -> list[Mode]:
    """Modes without terms, unless there are no others, by value."""
    modes = [cluster.mode for cluster in clusterer.clusters.values()]
    found = [m for m in modes if m.constant]
    return sorted(found, key=lambda m: (m.intercept, m.id)) if len(found) < len(modes) else []


def furthest(
    clusterer: ModeClusterer, table: ExampleTable, examples: NDArray[np.intp], side: float, *, without: int
) -> NDArray[np.float64]:
    """How far to one side any mode but one would lead under any role assignment, times `side`, shape ``(n,)``."""
    found = np.full(len(examples), -np.inf)
    for number, cluster in sorted(clusterer.clusters.items()):
        if number != without:
            found = np.maximum(found, _furthest(cluster, table, clusterer.rows[examples], side))
    return found


def _furthest(
    cluster: Cluster, table: ExampleTable, rows: NDArray[np.integer], side: float
) -> NDArray[np.float64]:
    """The mode's value furthest to one side under any role assignment, times `side`; shape ``(n,)``."""
    found = np.full(len(rows), -np.inf)
    signatures = table.signature_ids[rows]
    for signature in np.unique(signatures):
        if (binding := cluster.binding(table, int(signature))) is not None:
            part = np.flatnonzero(signatures == signature)
            found[part] = (side * binding.values(table.x[rows[part]])).max(axis=1, initial=-np.inf)
    return found
