"""Arrays that share their rows and grow: by doubling in rows, as needed along other named axes.

What several learners keep alike is held once: a pool (`relgym.classification.rows`) can stand behind an array, and who
reads or writes it sees no difference.
"""

from __future__ import annotations

import base64
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.classification.rows import Gathered, RowPool
from relgym.config.constants import FIRST_ROOM, LARGE

__all__ = ["Column", "Columns"]

_NONE: Final[Mapping[str, RowPool]] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Column:
    """Element type, the named axes after the row axis, and what unset elements hold."""

    dtype: str
    axes: tuple[str, ...] = ()
    fill: float | int | bool = 0


class Columns:
    """Named arrays of shape ``(size, *axes)``; ``columns[name]`` is a view of the rows in use (with a pool, a copy).

    Parameters
    ----------
    columns
        Description of each array.
    sizes
        Length of every named axis to begin with.
    pools
        Pools that hold the first numbers of all rows of an array, by its name. The array is of floats and has one more
        axis, at least as long as those rows; what is written to it is as long as the axis.
    """

    def __init__(
        self, columns: Mapping[str, Column], sizes: Mapping[str, int], pools: Mapping[str, RowPool] = _NONE
    ) -> None:
        self.columns = dict(columns)
        self.sizes = dict(sizes)
        self.size = 0
        self._pools = dict(pools)
        self._arrays: dict[str, NDArray[Any]] = {}  # of those with a pool what comes behind its rows
        self._held: dict[str, NDArray[np.int64]] = {}  # their numbers in it; -1 for none
        self._clear(FIRST_ROOM)

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.gathered(name).whole if name in self._pools else self._arrays[name][: self.size]

    def __setitem__(self, name: str, value: NDArray[Any]) -> None:
        """Replace a whole array; its axes may change length, its rows may not."""
        column = self.columns[name]
        self.sizes |= dict(zip(column.axes, value.shape[1:], strict=True))
        self._arrays[name] = self._empty(name, self._capacity())
        if name not in self._pools:
            self._arrays[name][: self.size] = value
            return
        for row, numbers in enumerate(value):
            self._hold(name, row, numbers)

    def gathered(self, name: str, rows: slice = slice(None)) -> Gathered:
        """Some rows of an array with a pool, put together when they are read; valid until they change."""
        numbers, more = self._held[name][: self.size], self._arrays[name][: self.size]
        return Gathered(self._pools[name], numbers[rows], more[rows])

    def row_bytes(self, sizes: Mapping[str, int]) -> int:
        """Memory of a row if named axes are at least so long, in bytes; as if there were no pools."""
        lengths = {axis: max(length, sizes.get(axis, 0)) for axis, length in self.sizes.items()}
        return sum(
            np.dtype(column.dtype).itemsize * math.prod(lengths[axis] for axis in column.axes)
            for column in self.columns.values()
        )

    def append(self, most: int = sys.maxsize) -> int:
        """Add a row, which is to be written; its number. There will never be more than `most` rows."""
        if self.size == self._capacity():
            self._rebuild(min(2 * self.size, max(most, self.size + 1)))
        self.size += 1
        return self.size - 1

    def write(self, row: int, values: Mapping[str, Any]) -> None:
        """Set all of a row's arrays, growing axes as needed; elements that a smaller value leaves get the fill."""
        known = self._arrays
        others: dict[str, NDArray[Any]] = {}
        for name, value in values.items():
            if name in self._pools:
                self._hold(name, row, value)
            elif getattr(value, "shape", ()) == known[name].shape[1:]:
                known[name][row] = value
            else:
                others[name] = np.asarray(value)
        if not others:
            return
        self._grow(others)
        for name, value in others.items():
            target = self._arrays[name]
            if value.shape != target.shape[1:]:
                target[row] = self.columns[name].fill
            place: tuple[Any, ...] = (row, *[slice(length) for length in value.shape])
            target[place] = value

    def keep(self, rows: NDArray[np.intp]) -> None:
        """Keep only these rows, in this order."""
        for name, pool in self._pools.items():
            held = self._held[name][: self.size]
            pool.release(np.delete(held, rows).tolist())
            held[: len(rows)], held[len(rows) :] = held[rows], -1
        for array in self._arrays.values():
            array[: len(rows)] = array[rows]
        self.size = len(rows)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON-able dictionary; arrays in base64, booleans packed eight to a byte."""
        packed = {name: _encode(self[name]) for name in self.columns}
        return {"size": self.size, "sizes": dict(self.sizes), "arrays": packed}

    def load(self, data: Mapping[str, Any]) -> None:
        """Restore what `to_dict` gave; the columns must be the same."""
        self.keep(np.empty(0, dtype=np.intp))  # pools are to know
        self.size, self.sizes = int(data["size"]), dict(data["sizes"])
        self._clear(max(FIRST_ROOM, self.size))
        for name, column in self.columns.items():
            shape = (self.size, *(self.sizes[axis] for axis in column.axes))
            self[name] = _decode(data["arrays"][name], np.dtype(column.dtype), shape)

    def __getstate__(self) -> dict[str, Any]:
        # Without room to grow, and what is small in one piece: arrays take microseconds each to serialise.
        used = [array[: self.size] for array in self._arrays.values()]
        small = b"".join([array.tobytes() for array in used if array.nbytes < LARGE])
        large = [array for array in used if array.nbytes >= LARGE]
        held = {name: numbers[: self.size] for name, numbers in self._held.items()}
        return self.__dict__ | {"_arrays": (small, large), "_held": held}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        small, large = state["_arrays"]
        self._clear(max(FIRST_ROOM, self.size))
        at, rest = 0, iter(large)
        for array in self._arrays.values():
            used = array[: self.size]
            if used.nbytes < LARGE:
                used[...] = np.frombuffer(small, used.dtype, used.size, at).reshape(used.shape)
                at += used.nbytes
            else:
                used[...] = next(rest)
        for name, numbers in state["_held"].items():
            self._held[name][: self.size] = numbers

    def _clear(self, capacity: int) -> None:
        """Have room for so many rows, of which none is written."""
        self._arrays = {name: self._empty(name, capacity) for name in self.columns}
        self._held = {name: np.full(capacity, -1, dtype=np.int64) for name in self._pools}

    def _hold(self, name: str, row: int, value: NDArray[np.float64]) -> None:
        """Set a row of an array with a pool."""
        pool, held = self._pools[name], self._held[name]
        self._arrays[name][row] = value[pool.width :]
        before, held[row] = int(held[row]), pool.hold(value[: pool.width])
        if before >= 0:
            pool.release((before,))

    def _capacity(self) -> int:
        return len(next(iter(self._arrays.values())))

    def _empty(self, name: str, capacity: int) -> NDArray[Any]:
        column = self.columns[name]
        shape = [self.sizes[axis] for axis in column.axes]
        if name in self._pools:
            shape = [shape[0] - self._pools[name].width]
        return np.full((capacity, *shape), column.fill, dtype=column.dtype)

    def _grow(self, values: Mapping[str, NDArray[Any]]) -> None:
        before = dict(self.sizes)
        for name, value in values.items():
            for axis, length in zip(self.columns[name].axes, value.shape, strict=True):
                self.sizes[axis] = max(self.sizes[axis], length)
        if self.sizes != before:
            self._rebuild(self._capacity())

    def _rebuild(self, capacity: int) -> None:
        for name, old in list(self._arrays.items()):
            new = self._empty(name, capacity)
            new[tuple(slice(min(a, b)) for a, b in zip(old.shape, new.shape, strict=True))] = old[:capacity]
            self._arrays[name] = new
        for name, held in self._held.items():
            self._held[name] = np.full(capacity, -1, dtype=np.int64)
            self._held[name][: self.size] = held[: self.size]


def _encode(array: NDArray[Any]) -> str:
    packed = np.packbits(array) if array.dtype == np.bool_ else array
    return base64.b64encode(np.ascontiguousarray(packed).tobytes()).decode("ascii")


def _decode(text: str, dtype: np.dtype[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    raw = base64.b64decode(text)
    if dtype == np.bool_:
        bits = np.unpackbits(np.frombuffer(raw, dtype=np.uint8), count=math.prod(shape))
        return bits.astype(np.bool_).reshape(shape)
    return np.frombuffer(raw, dtype=dtype).reshape(shape)
