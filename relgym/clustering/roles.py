"""Roles: which weights belong to one object (§3.2.3), and which objects play them in an example (§3.2.4)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import SlotSignature
from relgym.clustering.mode import Mode, Role
from relgym.config.constants import RECENT, SEARCHED_CELLS
from relgym.numeric.stepwise import LinearFit

__all__ = ["Binding", "bind", "identify_roles"]

MAX_ASSIGNMENTS: Final = SEARCHED_CELLS // RECENT
"""At most this many role assignments of one example are tried, canonical ones first: those of the latest examples are
as many numbers as one search looks at."""


def identify_roles(fit: LinearFit, signature: SlotSignature) -> tuple[Role, ...]:
    """Cut a weight vector into one segment per slot; one with a non-zero weight is a role (Figure 3.3)."""
    terms: dict[int, list[tuple[str, float]]] = {0: []}
    for column, weight in zip(fit.columns, fit.weights, strict=True):
        where = signature.at(column)
        terms.setdefault(where.slot, []).append((where.property, weight))
    others = [Role(signature.types[s].name, tuple(sorted(t))) for s, t in terms.items() if s]
    own = Role(signature.types[0].name, tuple(terms[0]))
    return (own, *sorted(others, key=lambda r: (r.type, [(p, w) for p, w in r.terms])))


@dataclass(frozen=True, slots=True)
class Binding:
    """A mode laid over the columns of one slot signature.

    Attributes
    ----------
    fixed
        (column, weight) of roles that only one slot can play, in the order they are summed.
    open
        For each remaining role its (property column per slot, weight) pairs: ``({slot: column}, weight)``.
    assignments
        Slot of each open role, one row per legal assignment, shape ``(a, len(open))``; rows in canonical
        order.
    forced
        Slot of every role but the target's where it is the only one possible, -1 for open roles.
    """

    signature: SlotSignature
    intercept: float
    fixed: tuple[tuple[int, float], ...]
    open: tuple[tuple[tuple[dict[int, int], float], ...], ...]
    assignments: NDArray[np.intp]
    forced: tuple[int, ...]

    def values(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """The function under every assignment, rows ``(n, d)`` → ``(n, a)``; sums in a fixed order."""
        total = np.full(len(x), self.intercept)
        for column, weight in self.fixed:
            total = total + weight * self.signature.values(x, column)
        every = np.repeat(total[:, None], len(self.assignments), axis=1)
        for k, terms in enumerate(self.open):
            for places, weight in terms:
                columns = np.array([places[int(s)] for s in self.assignments[:, k]], dtype=np.intp)
                every = every + weight * x[:, columns]
        return every

    def value(self, x: list[float], slots: tuple[int, ...] = ()) -> float:
        """The function on one row with the open roles played by `slots`; the same bits as `values`."""
        total, width = self.intercept, len(self.signature.columns)
        for column, weight in self.fixed:
            total = total + weight * (x[column] if column < width else self._feature(x, column))
        for terms, slot in zip(self.open, slots, strict=True):
            for places, weight in terms:
                total = total + weight * x[places[slot]]
        return total

    def _feature(self, x: list[float], column: int) -> float:
        return float(self.signature.values(np.array([x]), column)[0])

    def values_as(self, x: NDArray[np.float64], slots: tuple[int, ...]) -> NDArray[np.float64]:
        """`value` on n rows with the open roles played by the same slots; the same bits."""
        total = np.full(len(x), self.intercept)
        for column, weight in self.fixed:
            total = total + weight * self.signature.values(x, column)
        for terms, slot in zip(self.open, slots, strict=True):
            for places, weight in terms:
                total = total + weight * x[:, places[slot]]
        return total

    def closest(
        self, x: NDArray[np.float64], y: NDArray[np.float64], slack: float
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Smallest absolute residual over all assignments and the assignment's row, each of shape ``(n,)``.

        Assignments within `slack` of the best are ties; the canonically first of them counts.
        """
        errors = np.abs(self.values(x) - y[:, None])
        best = errors.min(axis=1)
        return best, np.argmax(errors <= best[:, None] + slack, axis=1)

    def closest_one(self, x: list[float], y: float, slack: float) -> tuple[float, int]:
        """`closest` of one row; the same bits."""
        if len(self.open) != 1:
            error, assignment = self.closest(np.array([x]), np.array([y]), slack)
            return float(error[0]), int(assignment[0])
        errors = [abs(self.value(x, (slot,)) - y) for slot in self.assignments[:, 0].tolist()]
        if any(map(math.isnan, errors)):
            return math.nan, 0
        best = min(errors)
        return best, next(k for k, error in enumerate(errors) if error <= best + slack)

    @property
    def slots(self) -> NDArray[np.intp]:
        """Slot of every role but the target's under each assignment, shape ``(a, roles)``."""
        table = np.tile(np.array(self.forced, dtype=np.intp), (len(self.assignments), 1))
        table[:, table[0] < 0] = self.assignments
        return table

    def roles_of(self, assignment: int) -> tuple[int, ...]:
        """Slot of every role but the target's under the given row of `assignments`."""
        played = iter(self.assignments[assignment].tolist())
        return tuple(next(played) if slot < 0 else slot for slot in self.forced)


def bind(mode: Mode, signature: SlotSignature, played: tuple[int, ...] = ()) -> Binding | None:
    """Lay a mode over a signature; None when some role has no object or column that could play it.

    `played`: of every role but the target's, which of the slots of its type plays it, if that is always the same.
    """
    by_type = signature.slots_by_type
    if not signature.offers(prop for prop, _ in mode.roles[0].terms):
        return None
    fixed = [(signature.column(0, prop), weight) for prop, weight in mode.roles[0].terms]
    forced: list[int] = []
    open_roles: list[Role] = []
    for k, role in enumerate(mode.open_roles):
        slots = by_type.get(role.type, ())
        wanted = sum(r.type == role.type for r in mode.open_roles)
        # Next values of a type are columns only where they were asked for, or where an object is alone of its type.
        if len(slots) < wanted or not all(signature.has(s, prop) for s in slots for prop, _ in role.terms):
            return None
        slots = slots if not played or played[k] >= len(slots) else (slots[played[k]],)
        if len(slots) == 1:
            forced.append(slots[0])
            fixed += [(signature.column(slots[0], prop), weight) for prop, weight in role.terms]
        else:
            forced.append(-1)
            open_roles.append(role)
    places = tuple(
        tuple(
            ({s: signature.column(s, prop) for s in by_type[role.type]}, weight)
            for prop, weight in role.terms
        )
        for role in open_roles
    )
    rows = list(itertools.islice(_assignments(open_roles, by_type), MAX_ASSIGNMENTS))
    table = np.array(rows, dtype=np.intp).reshape(len(rows), len(open_roles))
    return Binding(signature, mode.intercept, tuple(fixed), places, table, tuple(forced))


def _assignments(roles: list[Role], by_type: dict[str, tuple[int, ...]]) -> Iterator[tuple[int, ...]]:
    """All injective assignments of slots to roles; equal roles in ascending order only."""

    def extend(done: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
        k = len(done)
        if k == len(roles):
            yield done
            return
        least = done[-1] if k and roles[k].kind == roles[k - 1].kind else -1
        for slot in by_type[roles[k].type]:
            if slot > least and slot not in done:
                yield from extend((*done, slot))

    return extend(())
