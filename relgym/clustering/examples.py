"""The examples of one object type: regression rows shared by all targets of that type."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import SlotSignature

__all__ = ["ExampleTable"]


class ExampleTable:
    """Growing store of regression rows; rows are numbered from 0 and never move.

    Attributes
    ----------
    signatures
        The slot signatures seen, in order of appearance.
    """

    def __init__(self) -> None:
        self.signatures: list[SlotSignature] = []
        self._ids: dict[SlotSignature, int] = {}
        self._strata: dict[bytes, int] = {}
        self._x = np.zeros((256, 0))
        self._signature = np.zeros(256, dtype=np.int32)
        self._stratum = np.zeros(256, dtype=np.int32)
        self._size = 0

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

    def signature_id(self, signature: SlotSignature) -> int:
        """Number of the signature; a new one is taken up."""
        if (known := self._ids.get(signature)) is None:
            known = self._ids[signature] = len(self.signatures)
            self.signatures.append(signature)
            missing = len(signature.columns) - self._x.shape[1]
            if missing > 0:
                self._x = np.pad(self._x, ((0, 0), (0, missing)))
        return known

    def add(self, signature: SlotSignature, row: NDArray[np.float64], stratum: bytes) -> int:
        """Append one row and return its number; amortised O(width)."""
        number = self.signature_id(signature)
        if self._size == len(self._x):
            grow = ((0, len(self._x)), (0, 0))
            self._x = np.pad(self._x, grow)
            self._signature = np.pad(self._signature, grow[0])
            self._stratum = np.pad(self._stratum, grow[0])
        self._x[self._size, : len(row)] = row
        self._signature[self._size] = number
        self._stratum[self._size] = self._strata.setdefault(stratum, len(self._strata))
        self._size += 1
        return self._size - 1
