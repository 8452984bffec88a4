"""How an example's state vector is lined up into regression columns (§3.2.3).

The target object's properties come first. The other objects go into *slots* ``(type, k)`` in the scene's
canonical order, never by name. Examples whose slots have the same types share a `SlotSignature` and with it
the meaning of their columns. Columns stand in order of preference: what the target itself has, then what
bodiless objects say (actions), then the target's pose, then other objects; of two columns that explain
equally well the earlier wins. Non-linear features, where they are offered, are columns behind these, worked out
when they are read.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum, auto
from functools import cached_property
from itertools import accumulate, chain

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.features import NO_FEATURES, Feature, Library
from relgym.scene.objects import ACTION, STILL, TASK, ObjectType, SceneLayout, Target

__all__ = ["Column", "Rank", "SlotSignature", "slot_order"]

PRIME = "'"


class Rank(IntEnum):
    """What a column is, in order of preference."""

    OWN = auto()
    """A property of the target other than its pose."""
    BODILESS = auto()
    """A property of an object without a body, alone of its type."""
    POSE = auto()
    """Of the target; and what never changes in an episode, where the target is what a step is worth."""
    OTHER = auto()
    """A property of another object other than its pose."""
    OTHER_POSE = auto()
    """Of another object."""
    FEATURE = auto()
    """Non-linear."""


_STAGES = ((Rank.OWN, Rank.BODILESS), (Rank.FEATURE,), (Rank.OTHER,), (Rank.POSE, Rank.OTHER_POSE))
"""What is tried together, one after the other: poses last, since few laws depend on where things are (R2). With them
what never changes in an episode: what a step is worth is mostly what it changes, and among sixty columns, most of them
constants of a scene, no sample of a few steps finds a reward's modes."""


@dataclass(frozen=True, slots=True)
class Column:
    """One regression column: a property of the object in a slot; a prime marks its *next* value."""

    slot: int
    property: str
    rank: Rank


@dataclass(frozen=True)
class SlotSignature:
    """The types in an example's slots, and the columns they give.

    Parameters
    ----------
    types
        Type of each slot; slot 0 is the target object. Bodiless objects come next, then bodies.
    given
        (type, property) pairs whose next values are columns too (`Target.given`).
    chained
        The same for pairs among which the order is still to be found: columns only of the target itself, of bodiless
        objects, and, for reward and termination, of any object that is alone of its type.
    nonlinear
        Non-linear features offered.
    """

    types: tuple[ObjectType, ...]
    given: tuple[tuple[str, str], ...] = ()
    chained: tuple[tuple[str, str], ...] = ()
    nonlinear: Library = NO_FEATURES

    @cached_property
    def _hash(self) -> int:
        return hash((self.types, self.given, self.chained, self.nonlinear))

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """All columns that a row holds, in order of preference."""
        found, task = [], self.types[0].name == TASK
        for slot, t in enumerate(self.types):
            supplied = {own for own in t.pose_columns() if own >= 0}
            for k, prop in enumerate(t.properties):
                found.append(Column(slot, prop, self._rank(slot, k in supplied)))
            alone = slot == 0 or (self.singleton(slot) and (task or not t.has_body))
            pairs = dict.fromkeys((*self.given, *(self.chained if alone else ())))
            primes = [prop for name, prop in pairs if name == t.name]
            found.extend(Column(slot, prop + PRIME, self._rank(slot, posed=False)) for prop in primes)
        return tuple(sorted(found, key=lambda c: (c.rank, c.slot)))

    @cached_property
    def actions(self) -> tuple[int, ...]:
        """Columns of the action's properties."""
        return tuple(
            k
            for k, c in enumerate(self.columns)
            if self.types[c.slot].name == ACTION and not c.property.endswith(PRIME)
        )

    @cached_property
    def _places(self) -> NDArray[np.intp]:
        """Slot, place among that object's numbers, and whether it is a next value, of each column, ``(3, columns)``."""
        found = [
            (
                c.slot,
                self.types[c.slot].properties.index(c.property.rstrip(PRIME)),
                c.property.endswith(PRIME),
            )
            for c in self.columns
        ]
        return np.array(found, dtype=np.intp).T

    @cached_property
    def features(self) -> tuple[Feature, ...]:
        """Non-linear features, columns behind those that a row holds; `ConfigError` if there would be too many."""
        offered, names, own = self._factors
        return tuple(feature.moved(offered) for feature in self.nonlinear.features(names, own))

    @property
    def feature_count(self) -> int:
        """Number of non-linear features that there are, or a little more; cheap, however many."""
        return self.nonlinear.size(*self._factors[1:])

    @property
    def _factors(self) -> tuple[list[int], list[str], list[bool]]:
        """Columns that features are made of, their names, and whether they are the target's own."""
        task = self.types[0].name == TASK
        offered = [
            k
            for k in range(self.core)
            if (self.types[self.columns[k].slot].name != TASK) and (self.columns[k].slot or not task)
        ]
        return offered, [self.named(k) for k in offered], [self.columns[k].slot == 0 or task for k in offered]

    def named(self, index: int) -> str:
        """A column's name, that of another object's property with its type in front."""
        column = self.at(index)
        return column.property if column.slot == 0 else f"{self.types[column.slot].name}.{column.property}"

    def _rank(self, slot: int, posed: bool) -> Rank:
        if slot == 0:
            return Rank.POSE if posed else Rank.OWN
        if self.singleton(slot) and not self.types[slot].has_body:
            still = self.types[slot].name == STILL and self.types[0].name == TASK
            return Rank.POSE if still else Rank.BODILESS
        return Rank.OTHER_POSE if posed else Rank.OTHER

    @cached_property
    def _index(self) -> dict[tuple[int, str], int]:
        index = {(c.slot, c.property): k for k, c in enumerate(self.columns)}
        width = len(self.columns)
        return {(0, f.name): width + k for k, f in enumerate(self.features)} | index

    @cached_property
    def core(self) -> int:
        """Number of leading columns that mean the same in every signature of the same target."""
        return sum(c.rank <= Rank.POSE for c in self.columns)

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
        """Index of a column; `KeyError` when this signature has none of that name."""
        return self._index[slot, prop]

    def has(self, slot: int, prop: str) -> bool:
        """Whether there is a column of that name."""
        return (slot, prop) in self._index

    def offers(self, props: Iterable[str]) -> bool:
        """Whether the target's own slot has columns of these names."""
        return all((0, prop) in self._index for prop in props)

    def at(self, index: int) -> Column:
        """The column of an index, a feature being one of slot 0."""
        if index < len(self.columns):
            return self.columns[index]
        return Column(0, self.features[index - len(self.columns)].name, Rank.FEATURE)

    def values(self, x: NDArray[np.float64], index: int) -> NDArray[np.float64]:
        """One column, features included, on rows ``(n, d)``; shape ``(n,)``."""
        width = len(self.columns)
        return x[:, index] if index < width else self.features[index - width].values(x)

    def matrix(
        self, x: NDArray[np.float64], indices: Sequence[int] | NDArray[np.intp]
    ) -> NDArray[np.float64]:
        """Some columns, features included, on rows ``(n, d)``; shape ``(n, len(indices))``."""
        indices = np.asarray(indices, dtype=np.intp)
        plain = indices < len(self.columns)
        if plain.all():
            return x[:, indices]
        found = np.empty((len(x), len(indices)))
        found[:, plain] = x[:, indices[plain]]
        for k in np.flatnonzero(~plain):
            found[:, k] = self.values(x, int(indices[k]))
        return found

    def preference(self, target: Target) -> tuple[NDArray[np.intp], tuple[int, ...]]:
        """Columns that a target's functions may use, in order of preference, and where its stages end.

        The target property's own column comes first, except for the task's: its present values are no columns of its
        functions at all. The stages are the numbers of leading columns that are
        tried together: what the target and bodiless objects have; non-linear features of these; then what other
        objects have; then poses as well. Next values are left out unless the target is given them.
        """
        if (known := self._preferences.get(target)) is None:
            known = self._preferences[target] = self._prefer(target)
        return known

    @cached_property
    def _preferences(self) -> dict[Target, tuple[NDArray[np.intp], tuple[int, ...]]]:
        return {}

    def _prefer(self, target: Target) -> tuple[NDArray[np.intp], tuple[int, ...]]:
        first = self._index[0, target.property]
        every = range(len(self.columns) + len(self.features))
        rest = [k for k in every if k != first and self._allowed(k, target)]
        stages = [[k for k in rest if self.at(k).rank in ranks] for ranks in _STAGES]
        rest = list(chain.from_iterable(stages))
        ends = tuple(dict.fromkeys(1 + end for end in accumulate(map(len, stages))))
        if target.type == TASK:  # what a step is worth doesn't depend on what the last one was
            return np.array(rest, dtype=np.intp), tuple(max(0, end - 1) for end in ends)
        return np.array([first, *rest], dtype=np.intp), ends

    def present(self, x: NDArray[np.float64], target: Target) -> NDArray[np.float64]:
        """What changes count from, shape ``(n,)``: the property's present value; 0 for reward and termination."""
        return self.present_of(x, slice(None), target)

    def present_of(
        self, x: NDArray[np.float64], rows: NDArray[np.integer] | slice, target: Target
    ) -> NDArray[np.float64]:
        """`present` of some rows only; the others, and the other columns, aren't copied."""
        if target.type == TASK:
            return np.zeros(len(x[rows, 0]))
        found: NDArray[np.float64] = x[rows, self._index[0, target.property]]
        return found

    def _allowed(self, index: int, target: Target) -> bool:
        width = len(self.columns)
        parts = (index,) if index < width else self.features[index - width].columns
        return all(self._open(self.columns[k], target) for k in parts)

    def _open(self, column: Column, target: Target) -> bool:
        name = self.types[column.slot].name
        if column.property.endswith(PRIME):
            return (name, column.property.rstrip(PRIME)) in target.given
        return name != TASK  # the world goes on whatever it is worth

    def gather(self, layout: SceneLayout, order: tuple[int, ...]) -> NDArray[np.intp]:
        """Where each column lies in the concatenation of a scene's vector and its next vector.

        Parameters
        ----------
        layout
            Layout of both vectors.
        order
            Index of the object in each slot.
        """
        slots, places, primed = self._places
        starts = np.array([layout.offsets[index] for index in order], dtype=np.intp)
        found: NDArray[np.intp] = starts[slots] + places + layout.width * primed
        return found


def slot_order(layout: SceneLayout, target: int, bodies: tuple[int, ...]) -> tuple[int, ...]:
    """Object index per slot: the target, then bodiless objects by type, then `bodies` as given."""
    bodiless = sorted(
        (i for i, t in enumerate(layout.types) if not t.has_body and i != target),
        key=lambda i: (layout.types[i].name, i),
    )
    return (target, *bodiless, *bodies)
