"""How an example's state vector is lined up into regression columns (§3.2.3).

The target object's properties come first. The other objects go into *slots* ``(type, k)`` in the scene's
canonical order, never by name. Examples whose slots have the same types share a `SlotSignature` and with it
the meaning of their columns. Columns stand in order of preference: what the target itself has, then what
bodiless objects say (actions), then the target's pose, then other objects; of two columns that explain
equally well the earlier wins.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relgym.scene.objects import ObjectType, SceneLayout, Target

__all__ = ["Column", "SlotSignature", "slot_order"]

PRIME = "'"

_STAGE = (0, 0, 2, 1, 2)
"""When columns of each rank are tried: poses last, since few laws depend on where things are (R2)."""


@dataclass(frozen=True, slots=True)
class Column:
    """One regression column: a property of the object in a slot; a prime marks its *next* value."""

    slot: int
    property: str
    rank: int


@dataclass(frozen=True)
class SlotSignature:
    """The types in an example's slots, and the columns they give.

    Parameters
    ----------
    types
        Type of each slot; slot 0 is the target object. Bodiless objects come next, then bodies.
    given
        (type, property) pairs whose next values are columns too (`Target.given`).
    """

    types: tuple[ObjectType, ...]
    given: tuple[tuple[str, str], ...] = ()

    @cached_property
    def _hash(self) -> int:
        return hash((self.types, self.given))

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """All columns, in order of preference."""
        found = []
        for slot, t in enumerate(self.types):
            supplied = {own for own in t.pose_columns() if own >= 0}
            for k, prop in enumerate(t.properties):
                found.append(Column(slot, prop, self._rank(slot, k in supplied)))
            primes = [prop for name, prop in self.given if name == t.name]
            found.extend(Column(slot, prop + PRIME, self._rank(slot, posed=False)) for prop in primes)
        return tuple(sorted(found, key=lambda c: (c.rank, c.slot)))

    def _rank(self, slot: int, posed: bool) -> int:
        if slot == 0:
            return 2 if posed else 0
        if self.singleton(slot) and not self.types[slot].has_body:
            return 1
        return 4 if posed else 3

    @cached_property
    def _index(self) -> dict[tuple[int, str], int]:
        return {(c.slot, c.property): k for k, c in enumerate(self.columns)}

    @cached_property
    def core(self) -> int:
        """Number of leading columns that mean the same in every signature of the same target."""
        return sum(c.rank <= 2 for c in self.columns)

    @cached_property
    def slots_by_type(self) -> dict[str, tuple[int, ...]]:
        """Slots of each type name, the target's own slot left out."""
        found: dict[str, list[int]] = {}
        for slot, t in enumerate(self.types):
            if slot:
                found.setdefault(t.name, []).append(slot)
        return {name: tuple(slots) for name, slots in found.items()}

    def singleton(self, slot: int) -> bool:
        """Whether no other slot but the target's has this slot's type."""
        name = self.types[slot].name
        return sum(t.name == name for t in self.types[1:]) == 1

    def column(self, slot: int, prop: str) -> int:
        """Index of a column."""
        return self._index[slot, prop]

    def preference(self, target: Target) -> tuple[NDArray[np.intp], tuple[int, ...]]:
        """Columns that a target's functions may use, in order of preference, and where its stages end.

        The target property's own column comes first. The stages are the numbers of leading columns that are
        tried together: what the target and bodiless objects have; then what other objects have; then poses as
        well. Next values are left out unless the target is given them.
        """
        first = self._index[0, target.property]
        rest = [k for k, c in enumerate(self.columns) if k != first and self._allowed(c, target)]
        rest.sort(key=lambda k: (_STAGE[self.columns[k].rank], k))
        stage = [_STAGE[self.columns[k].rank] for k in rest]
        ends = tuple(dict.fromkeys(1 + sum(s <= last for s in stage) for last in (0, 1, 2)))
        return np.array([first, *rest], dtype=np.intp), ends

    def _allowed(self, column: Column, target: Target) -> bool:
        if not column.property.endswith(PRIME):
            return True
        return (self.types[column.slot].name, column.property.rstrip(PRIME)) in target.given

    def gather(self, layout: SceneLayout, order: tuple[int, ...]) -> NDArray[np.intp]:
        """Where each column lies in the concatenation of a scene's vector and its next vector.

        Parameters
        ----------
        layout
            Layout of both vectors.
        order
            Index of the object in each slot.
        """
        places = []
        for column in self.columns:
            primed = column.property.endswith(PRIME)
            place = layout.column(order[column.slot], column.property.rstrip(PRIME))
            places.append(place + layout.width * primed)
        return np.array(places, dtype=np.intp)


def slot_order(layout: SceneLayout, target: int, bodies: tuple[int, ...]) -> tuple[int, ...]:
    """Object index per slot: the target, then bodiless objects by type, then `bodies` as given."""
    bodiless = sorted(
        (i for i, t in enumerate(layout.types) if not t.has_body and i != target),
        key=lambda i: (layout.types[i].name, i),
    )
    return (target, *bodiless, *bodies)
