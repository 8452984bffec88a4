"""Training examples as the thesis' system keeps them: whole state vectors, lined up by place (Figure 3.3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from relgym.scene.objects import SceneLayout

__all__ = ["Arrangement", "Examples"]

Floats = NDArray[np.float64]
_FIRST = 256


@dataclass(frozen=True)
class Arrangement:
    """Objects of the same types in the same places of the state vector, with the same one as target.

    Attributes
    ----------
    layout
        Of the first of its scenes; others may name the objects otherwise.
    target
        Index of the target object.
    """

    layout: SceneLayout
    target: int

    @property
    def key(self) -> tuple[tuple[str, ...], int]:
        """What makes two arrangements one."""
        return tuple(t.name for t in self.layout.types), self.target

    def columns(self, index: int) -> range:
        """Where an object's properties lie."""
        start = self.layout.offsets[index]
        return range(start, start + len(self.layout.types[index].properties))

    def place(self, column: int) -> tuple[int, int]:
        """Object and property number of a column."""
        index = int(np.searchsorted(np.array(self.layout.offsets), column, side="right")) - 1
        return index, column - self.layout.offsets[index]

    def alone(self) -> tuple[int, ...]:
        """The target, and objects of whose type there is only one."""
        names = [t.name for t in self.layout.types]
        return tuple(i for i, name in enumerate(names) if i == self.target or names.count(name) == 1)


@dataclass
class _Rows:
    """State vectors of one arrangement, and the examples' numbers."""

    x: Floats
    numbers: NDArray[np.intp]
    count: int = 0


@dataclass
class Examples:
    """All examples of one target, numbered as they came."""

    arrangements: list[Arrangement] = field(default_factory=list)
    count: int = 0

    def __post_init__(self) -> None:
        self._known: dict[tuple[tuple[str, ...], int], int] = {}
        self._rows: list[_Rows] = []
        self._y = np.empty(_FIRST)
        self._group = np.empty(_FIRST, dtype=np.int32)
        self._row = np.empty(_FIRST, dtype=np.intp)

    def number_of(self, layout: SceneLayout, target: int) -> int:
        """Number of an arrangement; a new one is taken up."""
        arrangement = Arrangement(layout, target)
        known = self._known.get(arrangement.key)
        if known is None:
            known = self._known[arrangement.key] = len(self.arrangements)
            self.arrangements.append(arrangement)
            self._rows.append(_Rows(np.empty((_FIRST, layout.width)), np.empty(_FIRST, dtype=np.intp)))
        return known

    def add(self, group: int, x: Floats, y: float) -> int:
        """Take up an example; returns its number."""
        rows = self._rows[group]
        if rows.count == len(rows.x):
            rows.x = np.concatenate([rows.x, np.empty_like(rows.x)])
            rows.numbers = np.concatenate([rows.numbers, np.empty_like(rows.numbers)])
        if self.count == len(self._y):
            self._y, self._group, self._row = (
                np.concatenate([a, np.empty_like(a)]) for a in (self._y, self._group, self._row)
            )
        number = self.count
        rows.x[rows.count], rows.numbers[rows.count] = x, number
        self._y[number], self._group[number], self._row[number] = y, group, rows.count
        rows.count += 1
        self.count += 1
        return number

    @property
    def y(self) -> Floats:
        """Next values, shape ``(count,)``."""
        return self._y[: self.count]

    @property
    def groups(self) -> NDArray[np.int32]:
        """Arrangement of each example, shape ``(count,)``."""
        return self._group[: self.count]

    def rows(self, group: int) -> tuple[NDArray[np.intp], Floats]:
        """Numbers and state vectors of an arrangement's examples."""
        rows = self._rows[group]
        return rows.numbers[: rows.count], rows.x[: rows.count]

    def stream(self) -> Iterator[tuple[SceneLayout, int, Floats, float]]:
        """All examples as they came: layout, target object, state vector, next value."""
        for group, row, y in zip(
            self.groups.tolist(), self._row[: self.count].tolist(), self.y.tolist(), strict=True
        ):
            arrangement = self.arrangements[group]
            yield arrangement.layout, arrangement.target, self._rows[group].x[row], y

    def x(self, group: int, numbers: NDArray[np.intp] | Sequence[int]) -> Floats:
        """State vectors of some examples of one arrangement."""
        found: Floats = self._rows[group].x[self._row[np.asarray(numbers, dtype=np.intp)]]
        return found
