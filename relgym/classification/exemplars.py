"""The bounded memory of classified examples that classifiers learn from.

Most time steps share a relational state, so a few examples per (mode, relational state) say as much as all of
them, as long as those near a threshold stay. Kept are: examples that contradicted a classifier, and a
deterministic reservoir of the others, weighted so that the weights of a state's examples add up to the number
seen.

Classifiers learn from few examples of a mode in each relational state, those first that contradicted them. Without
bodies there is one state, and 3,000 of a mode are kept. Of ``z' = 0.9 z + [x > y]`` (x and y drawn anew) 72 % of
fresh steps were predicted right after 5,000 with ten, 97 % with 300, 99 % with 3,000, which took a third more time
than ten. And where rare events can't be predicted, as on which step a lander's leg touches a ground whose height
nobody sees, few examples leave corners in which by chance only the rare ones lie: among 300, of two streams' 77
touches predicted 17 came true.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from heapq import heapify, heappop, heapreplace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.classification.columns import Column, Columns
from relgym.classification.examples import NOISE, Bools, Example, Floats, Vocabulary, check_example
from relgym.classification.rows import Gathered, RowPool
from relgym.config import ClassificationConfig
from relgym.config.constants import FIRST, LEAST_EXEMPLARS, MEBIBYTE
from relgym.mixing import GOLDEN, mixed_one

__all__ = ["COLUMNS", "Exemplars", "dyadic"]

_UNDEFINED: Final = float("nan")
COLUMNS: Final = {
    "table": Column("bool", ("R", "K", "K2")),
    "unary": Column("bool", ("U", "K")),
    "exists": Column("bool", ("K",)),
    "close": Column("bool", ("K",)),
    "approached": Column("bool", ("K",)),
    "pair": Column("float64", ("K", "F"), _UNDEFINED),
    "own": Column("float64", ("A",), _UNDEFINED),
    "target": Column("int64"),
    "row": Column("int64"),
    "assigned": Column("int64", (), NOISE),
    "hard": Column("bool"),
    "cell": Column("int64"),
    "fits": Column("bool", ("M",)),
    "values": Column("float64", ("M",), _UNDEFINED),
    "roles": Column("int64", ("P",), -1),
}
"""What is kept of every example; see `Exemplars.columns`."""


@dataclass(slots=True)
class _Cell:
    """All examples of one mode in one relational state: how many were seen, and the slots of those kept."""

    assigned: int
    key: bytes
    count: float = 0.0
    soft: list[int] = field(default_factory=list)
    hard: list[int] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.soft) + len(self.hard)

    @property
    def members(self) -> list[int]:
        """Slots, those of examples that contradicted a classifier last."""
        return self.soft + self.hard

    def keep(self, slot: int, hard: bool) -> None:
        """Have the example in a slot."""
        (self.hard if hard else self.soft).append(slot)

    def give_up(self) -> int:
        """Have an example no longer, one that isn't hard if there is any; its slot."""
        candidates = self.soft or self.hard
        return candidates.pop(_hash(self.key, self.count) % len(candidates))


class Exemplars:
    """Classified examples of one target, in slots 0 .. len - 1.

    Parameters
    ----------
    vocabulary
        Names of what the examples hold.
    config
        Bounds.
    pool
        Holds the first own features of the examples, those of others of the same objects, too; default: one that nobody
        else uses.

    Attributes
    ----------
    modes
        Ids of the modes, in the order of the columns of ``columns["fits"]`` and ``columns["values"]``.
    columns
        The arrays: everything an `Example` holds, its restriction to the close objects (``close_...``),
        ``assigned`` (mode id or `NOISE`), ``fits`` (which modes' functions explain it), ``values`` (what they
        predict; NaN where a mode's roles can't be filled), ``roles`` (object playing each role of its mode;
        -1 for none).
    version
        Changes with every change of content.

    Notes
    -----
    Cost of `add`: O(R K^2), some 20 µs; memory at most `exemplar_memory`; no randomness: the
    reservoir's choices are hashes of key and count.
    """

    def __init__(
        self, vocabulary: Vocabulary, config: ClassificationConfig, pool: RowPool | None = None
    ) -> None:
        self.vocabulary = vocabulary
        self.config = config
        self.modes: tuple[int, ...] = ()
        lengths = {
            "R": vocabulary.relations,
            "U": vocabulary.unary,
            "F": vocabulary.pair,
            "A": vocabulary.own,
        }
        sizes = {name: len(names) for name, names in lengths.items()}
        pool = RowPool(sizes["A"]) if pool is None else pool
        self.columns = Columns(COLUMNS, sizes | {"K": 1, "K2": 1, "M": 0, "P": 0}, {"own": pool})
        self.version = 0
        self._cells: list[_Cell] = []
        self._index: dict[tuple[int, bytes], int] = {}
        self._room_for: tuple[tuple[int, ...], int] = (
            (),
            0,
        )  # examples that there is room for, by lengths of axes

    def __len__(self) -> int:
        return len(self.columns)

    @property
    def rows(self) -> NDArray[np.int64]:
        """History row of the example in each slot."""
        return self.columns["row"]

    @property
    def own(self) -> Gathered:
        """Own features of the example in each slot, put together when they are read; valid until they change."""
        return self.columns.gathered("own")

    @property
    def assigned(self) -> NDArray[np.int64]:
        """Mode that the example in each slot was assigned to."""
        return self.columns["assigned"]

    @property
    def cells(self) -> Iterator[tuple[int, bytes, list[int]]]:
        """What is remembered of each mode in each relational state: mode, state, slots."""
        return ((cell.assigned, cell.key, cell.members) for cell in self._cells)

    def add(
        self,
        example: Example,
        assigned: int,
        fits: Bools,
        values: Floats,
        *,
        hard: bool = False,
        roles: Sequence[int] = (),
        weight: float = 1.0,
    ) -> int | None:
        """Offer an example; its slot if it was kept.

        Parameters
        ----------
        example
            The example.
        assigned
            The mode it was assigned to, or `NOISE`.
        fits, values
            Which modes explain it, and what they predict, shape ``(len(modes),)``.
        hard
            Whether it contradicted a classifier; such examples are preferred.
        roles
            Object playing each role of the assigned mode.
        weight
            How many seen examples it stands for.
        """
        check_example(self.vocabulary, example)
        most = self._most(len(example.close))
        if len(self) > most:
            self._shed(most)
        cell = self._cells[number := self._cell(assigned, example.key)]
        cell.count += weight
        slot = self._room(cell, hard, most, weight)
        if slot is None:
            return None
        self.version += 1
        self.columns.write(
            slot,
            {
                "table": example.table,
                "unary": example.unary,
                "exists": np.ones(len(example.close), dtype=np.bool_),
                "close": example.close,
                "approached": example.struck,
                "pair": example.pair,
                "own": example.own,
                "target": example.target,
                "row": example.row,
                "assigned": assigned,
                "hard": hard,
                "cell": number,
                "fits": fits,
                "values": values,
                "roles": np.asarray(roles, dtype=np.int64),
            },
        )
        return slot

    def set_modes(
        self,
        modes: Sequence[int],
        assigned: NDArray[np.integer[Any]],
        fits: Bools,
        values: Floats,
        roles: NDArray[np.integer[Any]] | None = None,
    ) -> NDArray[np.intp]:
        """Re-label all exemplars after the modes changed.

        Parameters
        ----------
        modes
            Ids of the modes there are now.
        assigned
            New mode of each slot, shape ``(n,)``.
        fits, values
            Which modes explain it, and what they predict, shape ``(n, len(modes))``.
        roles
            Object playing each role of the new mode, -1 for none, shape ``(n, most roles)``; default: as
            before.

        Returns
        -------
        Which slots are left, by the numbers they had; a state's reservoir can overflow.
        """
        weights, keys = self.weights(), [self._cells[c].key for c in self.columns["cell"].tolist()]
        self.modes = tuple(modes)
        self.columns["fits"], self.columns["values"] = fits, values
        self.columns["assigned"] = np.asarray(assigned)
        if roles is not None:
            self.columns["roles"] = np.asarray(roles)
        self._cells, self._index = [], {}
        hard = self.columns["hard"].tolist()
        for slot, key in enumerate(keys):
            cell = self._cells[number := self._cell(int(assigned[slot]), key)]
            cell.keep(slot, hard[slot])
            cell.count += float(weights[slot])
            self.columns["cell"][slot] = number
        self.version += 1
        return self._trim()

    def key_of(self, slot: int) -> bytes:
        """Relational state of the example in a slot."""
        return self._cells[int(self.columns["cell"][slot])].key

    def own_of(self, slot: int) -> Floats:
        """Own features of the example in a slot."""
        return self.columns.gathered("own", slice(slot, slot + 1))[0]

    def widen(self, vocabulary: Vocabulary, own: Floats) -> None:
        """Other own features: their names, and their values for every slot, shape ``(n, len(vocabulary.own))``."""
        self.vocabulary = vocabulary
        self.columns["own"] = own
        self.version += 1

    def weights(self) -> Floats:
        """How many seen examples each slot stands for: 1 if hard, an equal share of the rest otherwise.

        Rounded to 64ths, so that sums of weights are exact in any order.
        """
        cell, hard = self.columns["cell"], self.columns["hard"]
        counts = np.array([c.count for c in self._cells])
        kept = np.bincount(cell, minlength=len(counts))
        hards = np.bincount(cell[hard], minlength=len(counts))
        soft = kept - hards
        share = np.where(soft > 0, (counts - hards) / np.maximum(soft, 1), counts / np.maximum(kept, 1))
        weights: Floats = np.where(hard & (soft[cell] > 0), 1.0, dyadic(share[cell]))
        return weights

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON-able dictionary of the whole content."""
        cells = [[c.assigned, c.key.hex(), c.count, c.members] for c in self._cells]
        return {"modes": list(self.modes), "columns": self.columns.to_dict(), "cells": cells}

    def load(self, data: dict[str, Any]) -> None:
        """Restore what `to_dict` gave."""
        self.modes = tuple(data["modes"])
        self.columns.load(data["columns"])
        hard = self.columns["hard"].tolist()
        self._cells = []
        for assigned, key, count, members in data["cells"]:
            self._cells.append(cell := _Cell(assigned, bytes.fromhex(key), count))
            for slot in members:
                cell.keep(slot, hard[slot])
        self._index = {(cell.assigned, cell.key): i for i, cell in enumerate(self._cells)}
        self.version += 1

    def _cell(self, assigned: int, key: bytes) -> int:
        number = self._index.setdefault((assigned, key), len(self._cells))
        if number == len(self._cells):
            self._cells.append(_Cell(assigned, key))
        return number

    def _cap(self, cell: _Cell) -> int:
        if cell.assigned == NOISE:
            return self.config.noise_per_state
        return self.config.exemplars_per_state if cell.key else self.config.exemplars_alone

    def _most(self, bodies: int) -> int:
        """How many examples are kept once they have columns for so many bodies."""
        shape = (bodies, *self.columns.sizes.values())
        if self._room_for[0] != shape:
            size = self.columns.row_bytes({"K": bodies, "K2": bodies})
            most = max(LEAST_EXEMPLARS, self.config.exemplar_memory * MEBIBYTE // size)
            self._room_for = shape, min(self.config.max_exemplars, most)
        return self._room_for[1]

    def _shed(self, most: int) -> None:
        """Give up examples, of the most crowded cells first: those of larger scenes to come take more memory."""
        crowded = [(-len(cell), number) for number, cell in enumerate(self._cells) if len(cell)]
        heapify(crowded)
        for _ in range(len(self) - most):
            _, number = crowded[0]
            cell = self._cells[number]
            cell.give_up()
            if len(cell):
                heapreplace(crowded, (-len(cell), number))
            else:
                heappop(crowded)
        self._compact()
        self.version += 1

    def _room(self, cell: _Cell, hard: bool, most: int, weight: float) -> int | None:
        """A slot for a new example of this cell, or none if the reservoir passes it over."""
        if len(cell) < self._cap(cell):
            if len(self) < most:
                cell.keep(slot := self.columns.append(most), hard)
                return slot
            sizes = [len(each.soft) + len(each.hard) for each in self._cells]
            crowded = self._cells[sizes.index(max(sizes))]
            if len(cell) < len(crowded):
                cell.keep(slot := crowded.give_up(), hard)
                return slot
        if hard:
            cell.keep(slot := cell.give_up(), hard)
            return slot
        # Algorithm R, with a hash for a random number: the k-th example enters with probability size / k, and one that
        # stands for several with as many times that.
        position = int(_hash(cell.key, cell.count) % max(int(cell.count) - len(cell.hard), 1) // weight)
        return cell.soft[position] if position < len(cell.soft) else None

    def _trim(self) -> NDArray[np.intp]:
        """Bring cells that grew by re-labelling (noise that became a mode) back to their bound; the slots left."""
        for cell in self._cells:
            while len(cell) > self._cap(cell):
                cell.give_up()
        return self._compact()

    def _compact(self) -> NDArray[np.intp]:
        """Number the slots anew that cells still have; the numbers they had."""
        kept = sorted(slot for cell in self._cells for slot in cell.members)
        left = np.array(kept, dtype=np.intp)
        if len(kept) < len(self):
            new = {slot: i for i, slot in enumerate(kept)}
            self.columns.keep(left)
            for cell in self._cells:
                cell.soft, cell.hard = ([new[slot] for slot in some] for some in (cell.soft, cell.hard))
        return left


def dyadic(weights: Floats) -> Floats:
    """Weights rounded to multiples of 1 / `FIRST`, a power of two, at least one: residues would pass for examples."""
    return np.maximum(np.round(weights * FIRST), 1.0) / FIRST


def _hash(key: bytes, count: float) -> int:
    """A number that looks random, the same in every process."""
    return mixed_one(zlib.crc32(key) + int(count) * GOLDEN)
