"""A bounded memory of examples, from which laws are derived again when what they rest on is revised."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import FIRST_ROOM
from relgym.numeric.growing import grown

__all__ = ["Store", "Stream"]


class Stream(enum.IntEnum):
    """Who draws random numbers of its own from the same seed, whatever others draw."""

    FREE = enum.auto()
    KEPT = enum.auto()
    PAIRS = enum.auto()


class Store:
    """At most `limit` rows; when it is full, a row of the most crowded cell makes room.

    So the examples that once were news stay, whatever comes in between.

    Parameters
    ----------
    width
        Numbers in a row.
    limit
        Most rows kept.
    seed
        Seed of the choice of rows that make room.
    """

    def __init__(self, width: int, limit: int, *, seed: int) -> None:
        self.limit = limit
        self.seen = 0
        self._rows = np.zeros((FIRST_ROOM, width))
        self._cells = np.zeros(FIRST_ROOM, dtype=np.int64)
        self._arrived = np.zeros(FIRST_ROOM, dtype=np.int64)
        self._size = 0
        self._counts: dict[int, int] | None = None  # worked out when it is needed
        self._rng = np.random.default_rng([seed, Stream.KEPT])

    @property
    def rows(self) -> NDArray[np.float64]:
        """The rows kept, shape ``(n, width)``."""
        return self._rows[: self._size]

    @property
    def cells(self) -> NDArray[np.int64]:
        """The cell of each, shape ``(n,)``."""
        return self._cells[: self._size]

    @property
    def arrived(self) -> NDArray[np.int64]:
        """How many rows had come when each came, itself counted, shape ``(n,)``."""
        return self._arrived[: self._size]

    @property
    def shape(self) -> tuple[int, int]:
        """Width of a row, and most rows kept."""
        return self._rows.shape[1], self.limit

    def add(self, row: NDArray[np.float64], *, cell: int) -> None:
        """Keep a row in a cell."""
        if (place := self.draw(cell)) is not None:
            self.put(place, row, cell=cell)

    def draw(self, cell: int) -> int | None:
        """Count one more row of a cell, and draw whether it is kept: where `put` is to put it, or None."""
        self.seen += 1
        if self._size == self.limit:
            return self._make_room(cell)
        if self._size == len(self._rows):
            self._rows, self._cells = grown(self._rows, self.limit), grown(self._cells, self.limit)
            self._arrived = grown(self._arrived, self.limit)
        return self._size

    def put(self, place: int, row: NDArray[np.float64], *, cell: int) -> None:
        """Keep a row that was drawn, in the place of another one or behind all."""
        counts = self._cell_counts()
        if place == self._size:
            self._size += 1
        else:
            counts[int(self._cells[place])] -= 1
        counts[cell] = counts.get(cell, 0) + 1
        self._rows[place], self._cells[place], self._arrived[place] = row, cell, self.seen

    def drop(self, places: NDArray[np.intp]) -> None:
        """Keep some rows no longer."""
        kept = np.setdiff1d(np.arange(self._size), places)
        end = len(kept)
        self._rows[:end], self._cells[:end] = self._rows[kept], self._cells[kept]
        self._arrived[:end] = self._arrived[kept]
        self._size, self._counts = end, None

    def _cell_counts(self) -> dict[int, int]:
        """Number of rows kept in each cell."""
        if self._counts is None:
            numbers, counts = np.unique(self._cells[: self._size], return_counts=True)
            self._counts = dict(zip(numbers.tolist(), counts.tolist(), strict=True))
        return self._counts

    def _make_room(self, cell: int) -> int | None:
        """Place of a row to replace; None where the new row's own cell is crowded and it isn't drawn."""
        most, crowded = max([(count, -number) for number, count in self._cell_counts().items()])
        # A reservoir within the crowded cell: later rows come in ever more rarely.
        if cell == -crowded and self._rng.random() > most / self.seen:
            return None
        return int(self._rng.choice(np.flatnonzero(self._cells[: self._size] == -crowded)))

    def to_json(self) -> dict[str, Any]:
        """Everything but the rows."""
        return {"seen": self.seen, "random": self._rng.bit_generator.state}

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The rows, their cells, and when they came."""
        return {"rows": self.rows, "cells": self.cells, "arrived": self.arrived}

    def restore(self, data: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over what `to_json` and `to_arrays` wrote."""
        self.seen = int(data["seen"])
        self._rng.bit_generator.state = data["random"]
        self._rows = np.array(arrays["rows"], dtype=np.float64)
        self._cells = np.array(arrays["cells"], dtype=np.int64)
        self._size, self._counts = len(self._rows), None
        # Earlier files don't say when rows came; until a store was full they lay in that order.
        came = arrays["arrived"] if "arrived" in arrays else np.arange(1, self._size + 1)
        self._arrived = np.array(came, dtype=np.int64)
