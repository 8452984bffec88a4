"""The examples of one object type: regression rows shared by all targets of that type."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import SlotSignature
from relgym.config.constants import FIRST_ROOM
from relgym.numeric.growing import grown, thin

__all__ = ["ExampleTable"]


class ExampleTable:
    """Growing store of regression rows, numbered from 0; they move only when `keep` drops some.

    Attributes
    ----------
    signatures
        The slot signatures seen, in order of appearance.
    seen
        Number of rows that ever came.
    """

    def __init__(self) -> None:
        self.signatures: list[SlotSignature] = []
        self._ids: dict[SlotSignature, int] = {}
        self._strata: dict[bytes, int] = {}
        self._x = np.zeros((FIRST_ROOM, 0))
        self._signature = np.zeros(FIRST_ROOM, dtype=np.int32)
        self._stratum = np.zeros(FIRST_ROOM, dtype=np.int32)
        self._bodies = np.zeros((FIRST_ROOM, 0), dtype=np.int16)
        self._serial = np.zeros(FIRST_ROOM, dtype=np.int64)
        self._size = 0
        self.seen = 0

    def __len__(self) -> int:
        return self._size

    @property
    def x(self) -> NDArray[np.float64]:
        """All rows, shape ``(n, widest)``; a row's columns beyond its signature's are zero."""
        return self._x[: self._size]

    @property
    def signature_ids(self) -> NDArray[np.int32]:
        """Index into `signatures` of every row, shape ``(n,)``."""
        return self._signature[: self._size]

    @property
    def strata(self) -> NDArray[np.int32]:
        """Number of every row's relational state, shape ``(n,)``: rows with the same number look alike."""
        return self._stratum[: self._size]

    @property
    def bodies(self) -> NDArray[np.int16]:
        """Number of the body in each slot of every row, shape ``(n, slots)``; -1 for bodiless objects."""
        return self._bodies[: self._size]

    @property
    def serials(self) -> NDArray[np.int64]:
        """The how-manieth each row was that came, shape ``(n,)``."""
        return self._serial[: self._size]

    def differences(self, rows: NDArray[np.intp]) -> NDArray[np.int64]:
        """In how many facts the relational states of some rows of one signature differ, shape ``(n, n)``.

        Cost O(states^2 * bytes of a key).
        """
        states, which = np.unique(self.strata[rows], return_inverse=True)
        known = self.stratum_keys
        keys = [known[state] for state in states.tolist()]
        width = max(map(len, keys))
        facts = np.stack([np.frombuffer(key.ljust(width, b"\0"), dtype=np.uint8) for key in keys])
        apart = np.stack([np.bitwise_count(facts ^ one).sum(axis=1, dtype=np.int64) for one in facts])
        found: NDArray[np.int64] = apart[np.ix_(which, which)]
        return found

    @property
    def stratum_keys(self) -> list[bytes]:
        """Key of each relational state, by its number in `strata`."""
        return list(self._strata)

    def keep(self, rows: NDArray[np.bool_]) -> None:
        """Forget all rows but these, shape ``(n,)``; those left are numbered anew, in their order."""
        n = int(rows.sum())
        names = ("_x", "_signature", "_stratum", "_bodies", "_serial")
        for name in names:
            thin(getattr(self, name), rows)
        self._size = n
        held = np.bincount(self.strata, minlength=len(self._strata)) > 0
        self._stratum[:n] = (np.cumsum(held, dtype=np.int32) - 1)[self.strata]
        self._strata = {key: k for k, key in enumerate(compress(self._strata, held.tolist()))}

    def signature_id(self, signature: SlotSignature) -> int:
        """Number of the signature; a new one is taken up."""
        if (
            self.signatures and self.signatures[-1] is signature
        ):  # most tables hold one, whose hash takes long
            return len(self.signatures) - 1
        if (known := self._ids.get(signature)) is None:
            known = self._ids[signature] = len(self.signatures)
            self.signatures.append(signature)
            missing = len(signature.columns) - self._x.shape[1]
            if missing > 0:
                self._x = np.pad(self._x, ((0, 0), (0, missing)))
            missing = len(signature.types) - self._bodies.shape[1]
            if missing > 0:
                self._bodies = np.pad(self._bodies, ((0, 0), (0, missing)), constant_values=-1)
        return known

    def add(
        self, signature: SlotSignature, row: NDArray[np.float64], stratum: bytes, bodies: Sequence[int]
    ) -> int:
        """Append one row and return its number; amortised O(width).

        Parameters
        ----------
        signature, row
            Types of the slots, and the columns they give.
        stratum
            Key of the relational state.
        bodies
            Number of the body in each slot; -1 for a bodiless object.
        """
        number = self.signature_id(signature)
        if self._size == len(self._x):
            self._x, self._bodies = grown(self._x), grown(self._bodies)
            self._signature, self._stratum = grown(self._signature), grown(self._stratum)
            self._serial = grown(self._serial)
        # What stood there before keep() is gone, behind the row as well: equal tables are equal bytes.
        self._x[self._size, len(row) :], self._bodies[self._size, len(bodies) :] = 0.0, -1
        self._x[self._size, : len(row)] = row
        self._signature[self._size] = number
        self._stratum[self._size] = self._strata.setdefault(stratum, len(self._strata))
        self._bodies[self._size, : len(bodies)] = bodies
        self._serial[self._size] = self.seen
        self._size += 1
        self.seen += 1
        return self._size - 1

    def to_json(self) -> dict[str, Any]:
        """Signatures and relational states; the rows are in `to_arrays`."""
        signatures = [[t.name for t in s.types] for s in self.signatures]
        return {"signatures": signatures, "strata": [key.hex() for key in self._strata], "seen": self.seen}

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The rows, their signatures and their strata."""
        return {
            "x": self.x,
            "signature": self.signature_ids,
            "stratum": self.strata,
            "bodies": self.bodies,
            "serial": self.serials,
        }

    def restore(
        self,
        data: dict[str, Any],
        arrays: dict[str, NDArray[Any]],
        signature_of: Callable[[tuple[str, ...]], SlotSignature],
    ) -> None:
        """Take over what `to_json` and `to_arrays` wrote; `signature_of` knows the signature of some types' names."""
        for names in data["signatures"]:
            self.signature_id(signature_of(tuple(names)))
        self._strata = {bytes.fromhex(key): k for k, key in enumerate(data["strata"])}
        self._x, self._size = arrays["x"].copy(), len(arrays["x"])
        self._signature, self._stratum = arrays["signature"].copy(), arrays["stratum"].copy()
        self._bodies, self._serial = arrays["bodies"].copy(), arrays["serial"].copy()
        self.seen = int(data["seen"])
