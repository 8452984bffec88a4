"""Stops: a wall that halts what runs into it, told by where the object would get to, ``x + v' <= -1.2``.

Where a property follows a rate (``x' = x + k v'``), a wall shows in both: the place takes a constant value beyond
which it never gets, and the rate another one. *When* that happens is a question about what the right one of the
rate's other modes would have led to, as with limits (`relgym.model.target.limits`), and not one that clauses could
decide better. So the rate's constant mode is a `Stop`, cut off by the place's bound; and the place's constant mode is
a `Landing`, which holds where the rate it is given has the value that goes with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.clusterer import ModeClusterer
from relgym.clustering.columns import PRIME, SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import Mode, sum_text
from relgym.config.constants import ALIKE, DIGITS, NEARLY_ALL, RECENT
from relgym.model.target.limits import constants, furthest

__all__ = ["Landing", "Stop", "Stops", "find_stops"]

Follows: TypeAlias = Sequence[tuple[str, float]]
"""Properties that follow the target, and k: ``name' = name + k * target'``."""


@dataclass(frozen=True, slots=True)
class Stop:
    """A constant mode of a rate that holds where the property that follows it would reach a bound.

    Attributes
    ----------
    mode, value
        Id of the rate's mode, and its constant.
    property, step
        What follows, and k: ``property' = property + step * rate'``.
    bound, side
        Beyond what it never gets, and whether that lies below (-1) or above (+1).
    slack
        Values of the property that differ by less are the same.
    """

    mode: int
    value: float
    property: str
    step: float
    bound: float
    side: float
    slack: float

    def contradicted(self, reached: float) -> bool:
        """Whether a next value of the property lies beyond the bound."""
        return self.side * (reached - self.bound) > self.slack

    def at(self, reached: NDArray[np.float64] | float) -> NDArray[np.bool_]:
        """Whether next values of the property are the bound."""
        found: NDArray[np.bool_] = np.abs(np.asarray(reached) - self.bound) <= self.slack
        return found

    def holds(self, row: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where the property's present values and the rate's next ones lead to the bound, shape ``(n,)``."""
        found: NDArray[np.bool_] = self.side * (row + self.step * values - self.bound) >= 0.0
        return found

    def text(self, rate: str) -> str:
        """The condition, for people, given the rate's name: ``where x + v' would be <= -1.2``."""
        led = sum_text([(1.0, self.property), (self.step, f"{rate}'")], 0.0, DIGITS)
        return f"where {led} would be {'<=' if self.side < 0.0 else '>='} {self.bound:.{DIGITS}g}"


@dataclass(frozen=True, slots=True)
class Landing:
    """A constant mode of a property that holds where the rate that it is given has a certain value.

    Attributes
    ----------
    mode, value
        Id of the property's mode, and its constant.
    property, at
        The rate, and its next value.
    slack
        Values of the rate that differ by less are the same.
    """

    mode: int
    value: float
    property: str
    at: float
    slack: float

    def contradicted(self, assigned: int, rate: float) -> bool:
        """Whether an example's mode and the rate's next value don't go together."""
        return (abs(rate - self.at) <= self.slack) != (assigned == self.mode)

    def holds(self, row: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where the rate's next values are as they must be, shape ``(n,)``."""
        found: NDArray[np.bool_] = np.abs(row - self.at) <= self.slack
        return found & np.isfinite(values)

    def text(self, _: str) -> str:
        """The condition, for people: ``where v' = 0``."""
        return f"where {self.property}' = {self.at:.{DIGITS}g}"


@dataclass(frozen=True, slots=True)
class Stops:
    """All stops and landings of a target; their modes take no part in the vote."""

    stops: tuple[Stop, ...] = ()
    landings: tuple[Landing, ...] = ()

    @property
    def every(self) -> tuple[Stop | Landing, ...]:
        """Both kinds, in the order in which they are applied."""
        return (*self.stops, *self.landings)

    def __contains__(self, mode: object) -> bool:
        return any(each.mode == mode for each in self.every)

    def text(self, mode: int, target: str) -> str:
        """When a mode of theirs holds, for people; `target` is the property predicted."""
        return next(each.text(target) for each in self.every if each.mode == mode)

    def contradicted(self, assigned: int, signature: SlotSignature, x: NDArray[np.float64]) -> bool:
        """Whether an example, its mode and its regression row ``(d,)``, refutes one of them."""
        if not self.every:
            return False
        following = {each.property: _next(signature, x, each.property) for each in self.every}
        if any(each.contradicted(following[each.property]) for each in self.stops):
            return True
        mine = [each for each in self.stops if each.mode == assigned]
        if mine and not any(each.at(following[each.property]) for each in mine):
            return True  # it held elsewhere than at a wall
        return any(each.contradicted(assigned, following[each.property]) for each in self.landings)

    def apply(
        self,
        signature: SlotSignature,
        x: NDArray[np.float64],
        values: NDArray[np.float64],
        modes: NDArray[np.int64],
    ) -> None:
        """Put in the constants where they hold, in place; what isn't predicted (NaN) stays.

        Parameters
        ----------
        signature, x
            Regression rows, shape ``(n, d)``.
        values, modes
            What the other modes predict, and which ones, shape ``(n,)``.
        """
        for each in self.every:
            name = each.property if isinstance(each, Stop) else each.property + PRIME
            if signature.has(0, name):
                held = each.holds(x[:, signature.column(0, name)], values)
                values[held], modes[held] = each.value, each.mode

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {"stops": [asdict(s) for s in self.stops], "landings": [asdict(s) for s in self.landings]}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Stops:
        """Read what `to_json` wrote."""
        stops, landings = data.get("stops", ()), data.get("landings", ())
        return cls(tuple(Stop(**s) for s in stops), tuple(Landing(**s) for s in landings))


def find_stops(
    clusterer: ModeClusterer,
    table: ExampleTable,
    follows: Follows,
    given: Iterable[str],
    taken: Iterable[int],
) -> Stops:
    """Which constant modes are stops and landings.

    Parameters
    ----------
    clusterer, table
        Modes and examples of a target, and the examples' rows.
    follows
        What follows the target.
    given
        Properties of the same object whose next values the target is given.
    taken
        Ids of modes that are limits already.

    Notes
    -----
    Cost: O(examples) per constant; nothing where nothing follows and nothing is given.
    """
    given = tuple(given)
    if not follows and not given:
        return Stops()
    free = [m for m in constants(clusterer) if m.id not in set(taken)]
    stops = [s for mode in free for prop, step in follows for s in _stops(clusterer, table, mode, prop, step)]
    landings = [_landing(clusterer, table, mode, prop) for mode in free for prop in given]
    return Stops(tuple(stops), tuple(landing for landing in landings if landing is not None))


def _stops(clusterer: ModeClusterer, table: ExampleTable, mode: Mode, prop: str, step: float) -> list[Stop]:
    """A constant as stops at the least and the greatest value of a property; none if it held elsewhere too."""
    held = np.flatnonzero(clusterer.labels == mode.id)[-RECENT:]
    every = _values(table, clusterer.rows, prop + PRIME)
    if not len(held) or not np.isfinite(every).all():
        return []
    slack = ALIKE * float(np.ptp(every))
    now = _values(table, clusterer.rows[held], prop)
    found, explained = [], np.zeros(len(held), dtype=bool)
    for side, bound in ((-1.0, float(every.min())), (1.0, float(every.max()))):
        stop = Stop(mode.id, mode.intercept, prop, step, bound, side, slack)
        turned = side * float(np.sign(step))
        led = now + step * turned * furthest(clusterer, table, held, turned, without=mode.id)
        there = stop.at(every[held]) & (side * (led - bound) >= -slack)
        if there.any():
            found.append(stop)
        explained |= there
    return found if explained.mean() >= NEARLY_ALL else []


def _landing(clusterer: ModeClusterer, table: ExampleTable, mode: Mode, prop: str) -> Landing | None:
    held = clusterer.labels == mode.id
    every = _values(table, clusterer.rows, prop + PRIME)
    if not held.any() or not np.isfinite(every).all():
        return None
    at = float(np.median(every[held]))
    slack = ALIKE * float(np.ptp(every))
    there = np.abs(every - at) <= slack
    if there[held].mean() < NEARLY_ALL or held[there].mean() < NEARLY_ALL:
        return None
    return Landing(mode.id, mode.intercept, prop, at, slack)


def _next(signature: SlotSignature, x: NDArray[np.float64], prop: str) -> float:
    """A property's next value on a regression row ``(d,)``; NaN, which contradicts nothing, if it has none."""
    return float(x[signature.column(0, prop + PRIME)]) if signature.has(0, prop + PRIME) else float("nan")


def _values(table: ExampleTable, rows: NDArray[np.integer], name: str) -> NDArray[np.float64]:
    """A column of the target's own slot by name, shape ``(n,)``; NaN where a row has none."""
    found = np.full(len(rows), np.nan)
    signatures = table.signature_ids[rows]
    for number in np.unique(signatures):
        slots = table.signatures[int(number)]
        if slots.has(0, name):
            part = np.flatnonzero(signatures == number)
            found[part] = table.x[rows[part], slots.column(0, name)]
    return found
