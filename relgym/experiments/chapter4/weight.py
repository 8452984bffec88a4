"""How much memory does a learner keep? The same yardstick for ours and for other libraries'."""

from __future__ import annotations

import pickle
from types import FunctionType
from typing import Any

__all__ = ["weight_of"]


class _Scales:
    """A file that is only weighed."""

    def __init__(self) -> None:
        self.bytes = 0

    def write(self, data: Any) -> int:
        """Count what would be written."""
        size = memoryview(data).nbytes
        self.bytes += size
        return size


class _Weigher(pickle.Pickler):
    """Pickles everything but functions and classes, which are code and not memory."""

    def reducer_override(self, obj: Any) -> Any:
        """Code weighs nothing, and what is local to a function couldn't be pickled."""
        return (str, ()) if isinstance(obj, FunctionType | type) and obj is not str else NotImplemented


def weight_of(learner: Any) -> int:
    """Bytes that a learner's state takes when it is pickled: parameters and whatever examples it remembers.

    Examples
    --------
    >>> import numpy as np
    >>> weight_of({"memory": np.zeros(1000), "how": lambda x: x}) // 1000
    8
    """
    scales = _Scales()
    _Weigher(scales, protocol=5).dump(learner)
    return scales.bytes
