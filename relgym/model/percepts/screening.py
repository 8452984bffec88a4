"""Gross errors in observations are set aside before they are learned from (outlier screening).

A number some thirty times as large as anything known of its property tells nothing of the world's laws, but reaches
far into what is learned: tolerances follow the largest numbers, squares overflow, thresholds drown in rounding. A
transition that holds one is left out as a whole, since such a number misleads about all objects: how they lie to one
another.

A number that comes again is no error: a sudden change of scale, a rare event or a rare reward is believed after a few
occurrences.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ALIKE, ENOUGH, FIRST, LAYOUTS, OUTLYING, REPEATED, SUMMABLE
from relgym.scene.objects import SceneLayout

__all__ = ["Screen"]

MOST = math.sqrt(SUMMABLE)
"""Larger numbers are always set aside: searches square products of two, whose sums may overflow."""


class _Marks(NamedTuple):
    """What the numbers of a layout are held against.

    Attributes
    ----------
    places
        Number of the property of each column.
    limits, known
        Largest magnitude that is no gross error, and largest that is no news.
    young
        Whether too few scenes of it were seen so far.
    """

    layout: SceneLayout
    places: NDArray[np.intp]
    limits: NDArray[np.float64]
    known: NDArray[np.float64]
    young: bool


class Screen:
    """Knows how large the numbers of each property are, and tells what is far larger.

    Attributes
    ----------
    set_aside : int
        Transitions that were left out.

    Notes
    -----
    Cost O(numbers) a scene. The magnitude of a property is the fifth largest that came, at least the median
    magnitude of all properties; where one was zero so far, the largest magnitude of all others stands in for it.
    """

    def __init__(self) -> None:
        self.set_aside = 0
        self._names: dict[tuple[str, str], int] = {}
        self._largest = np.zeros((0, REPEATED))  # largest magnitudes, ascending
        self._scenes = np.zeros(0, dtype=np.int64)  # scenes in which a property was seen, up to ENOUGH
        self._waiting: dict[int, list[float]] = {}  # suspicious numbers, the latest last
        self._run: dict[int, int] = {}  # successive transitions with a suspicious number
        self._limits: NDArray[np.float64] | None = None
        self._columns: dict[int, tuple[SceneLayout, NDArray[np.intp]]] = {}
        self._marks: dict[int, _Marks] = {}

    def admits(self, layout: SceneLayout, before: NDArray[np.float64], after: NDArray[np.float64]) -> bool:
        """Whether to learn from a transition; takes note of its numbers, and counts what is set aside.

        Parameters
        ----------
        layout
            Of both vectors; what isn't there afterwards has its present values.
        before, after
            State vectors, shape ``(layout.width,)``.
        """
        sizes, marks = np.maximum(np.abs(before), np.abs(after)), self._marked(layout)
        if not marks.young and np.count_nonzero(sizes <= marks.known) == len(sizes):  # no news
            self._run.clear()
            return True
        places, limits = marks.places, marks.limits
        within = np.count_nonzero(sizes <= limits) == len(sizes)
        if within:
            self._run.clear()
        else:
            self._suspect(places, np.where(np.abs(before) < np.abs(after), after, before), sizes > limits)
            limits = self._marked(layout).limits
            within = bool((sizes <= limits).all())
        if np.count_nonzero(sizes > self._largest[places, 0]):  # one of both has news
            for vector in (before, after):
                magnitudes = np.abs(vector)
                fine = slice(None) if within else magnitudes <= limits
                self._note(places[fine], magnitudes[fine])
        young = self._scenes[places] < ENOUGH
        if np.count_nonzero(young):
            self._scenes[np.unique(places[young])] += 1
            self._moved()
        if within:
            return True
        self.set_aside += 1
        return False

    def plausible(
        self, layout: SceneLayout, vector: NDArray[np.float64], others: Sequence[tuple[int, float]] = ()
    ) -> bool:
        """Whether a scene's numbers, and others in some of its columns, are as large as is known; notes nothing."""
        limits = self._marked(layout).limits
        if np.count_nonzero(np.abs(vector) <= limits) < len(vector):
            return False
        return all([abs(number) <= limits[column] for column, number in others])

    def _marked(self, layout: SceneLayout) -> _Marks:
        """What the numbers of a layout are held against; cached until one of it moves."""
        marks = self._marks.get(id(layout))
        if marks is None or marks.layout is not layout:
            places = self._places(layout)
            limits, known = self._limit()[places], self._largest[places, 0]
            young = bool((self._scenes[places] < ENOUGH).any())
            if len(self._marks) >= LAYOUTS:
                self._marks.clear()
            marks = self._marks[id(layout)] = _Marks(layout, places, limits, np.minimum(limits, known), young)
        return marks

    def _moved(self) -> None:
        """Something that limits depend on isn't what it was."""
        self._limits = None
        self._marks.clear()

    def _places(self, layout: SceneLayout) -> NDArray[np.intp]:
        """Number of the property of each column; cached."""
        known = self._columns.get(id(layout))
        if known is None:
            names = [(t.name, p) for t in layout.types for p in t.properties]
            places = np.array(
                [self._names.setdefault(name, len(self._names)) for name in names], dtype=np.intp
            )
            self._widen()
            known = self._columns[id(layout)] = (layout, places)  # kept alive, so that its id stays its own
        return known[1]

    def _widen(self) -> None:
        missing = len(self._names) - len(self._largest)
        if missing:
            self._largest = np.pad(self._largest, ((0, missing), (0, 0)))
            self._scenes = np.pad(self._scenes, (0, missing))
            self._moved()

    def _limit(self) -> NDArray[np.float64]:
        if self._limits is None:
            known = self._largest[:, 0]
            some = known[known > 0.0]
            if not len(some):
                return np.full(len(known), 1.0 / ALIKE)
            most = float(some.max())
            limits = OUTLYING * np.where(known > 0.0, np.maximum(known, np.median(some)), most)
            # Of the first scenes only that is suspicious beside which all that is known, and 1, are next to nothing.
            limits[self._scenes < ENOUGH] = max(most, 1.0) / ALIKE
            self._limits = np.minimum(limits, MOST)
        return self._limits

    def _note(self, places: NDArray[np.intp], sizes: NDArray[np.float64]) -> None:
        """Take up magnitudes, several of one property or one."""
        news = sizes > self._largest[places, 0]
        if not news.any():
            return
        for place, size in zip(places[news].tolist(), sizes[news].tolist(), strict=True):
            row = self._largest[place]
            if size > row[0]:
                row[0] = size
                row.sort()
                self._moved()

    def _suspect(
        self, places: NDArray[np.intp], values: NDArray[np.float64], wild: NDArray[np.bool_]
    ) -> None:
        """Take up suspicious numbers, of each property the largest; what came often enough is believed."""
        largest: dict[int, float] = {}
        for place, value in zip(places[wild].tolist(), values[wild].tolist(), strict=True):
            if abs(value) <= MOST and abs(value) > abs(largest.get(place, 0.0)):
                largest[place] = value
        self._run = {place: self._run.get(place, 0) + 1 for place in largest}
        for place, value in largest.items():
            waiting = self._waiting.setdefault(place, [])
            waiting.append(value)
            del waiting[:-FIRST]
            size = abs(value)
            alike = sum(size / OUTLYING <= abs(other) <= size * OUTLYING for other in waiting)
            if alike >= ENOUGH or waiting.count(value) >= REPEATED or self._run[place] >= REPEATED:
                self._largest[place] = size  # known, as if so many had come
                self._moved()
                del self._waiting[place], self._run[place]

    def absorb(self, other: Screen) -> None:
        """Take up what another screen knows."""
        for pair, theirs in other._names.items():
            place = self._names.setdefault(pair, len(self._names))
            self._widen()
            both = np.concatenate([self._largest[place], other._largest[theirs]])
            self._largest[place] = np.sort(both)[-REPEATED:]
            self._scenes[place] = min(ENOUGH, int(self._scenes[place] + other._scenes[theirs]))
        self._moved()
        self.set_aside += other.set_aside

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_limits": None, "_columns": {}, "_marks": {}}

    # ------------------------------------------------------------------ saving
    def to_json(self) -> dict[str, Any]:
        """Plain data that `restore` reads back."""
        return {
            "set_aside": self.set_aside,
            "properties": [
                [
                    *pair,
                    int(self._scenes[k]),
                    self._largest[k].tolist(),
                    self._waiting.get(k, []),
                    self._run.get(k, 0),
                ]
                for pair, k in self._names.items()
            ],
        }

    def restore(self, data: Mapping[str, Any]) -> None:
        """Take over what `to_json` wrote."""
        rows = data["properties"]
        self.set_aside = int(data["set_aside"])
        self._names = {(str(row[0]), str(row[1])): k for k, row in enumerate(rows)}
        self._largest = np.array([row[3] for row in rows], dtype=np.float64).reshape(len(rows), REPEATED)
        self._scenes = np.array([row[2] for row in rows], dtype=np.int64)
        self._waiting = {k: [float(v) for v in row[4]] for k, row in enumerate(rows) if row[4]}
        self._run = {k: int(row[5]) for k, row in enumerate(rows) if row[5]}
        self._columns = {}
        self._moved()
