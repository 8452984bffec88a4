"""What brings a model back when learning fails half way: a checkpoint, and what was done since (write-ahead logging).

Learning one transition changes many parts of a model. An error among them, be it a defect, a lack of memory or an
interrupt from the keyboard, would leave some changed and some not. Copying the model before each step would cost more
than learning; so a copy is taken now and then, and the steps since are kept. What was learned is a function of the
steps alone: to take them again leads to the same model, bit for bit.
"""

from __future__ import annotations

import copy
import gc
import io
import pickle
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import CHECKPOINT, LARGE, MORE_ROOM, MOST_BYTES

__all__ = ["Journal"]

Entry: TypeAlias = tuple[str, tuple[Any, ...]]
"""Name of the method that made a step, and what it was given."""


class Journal:
    """The last checkpoint of an object, and the steps that it made since.

    Notes
    -----
    Costs one serialised copy of the object in memory, the steps kept, and the time to serialise it once in `CHECKPOINT`
    steps: of a long history little more than what it takes to copy its bytes, some 0.25 ms a megabyte. For that a copy
    takes up the room of the last one: memory that is new to a process takes several times as long to write to, and what
    is freed and asked for in ever other sizes leaves gaps that nobody fills. What can't be serialised, such as a user's
    function that has no name of its own, is copied, in some five times the time.

    Steps that a checkpoint makes needless go two with each one that is added: never more are held than before it, and
    to free a thousand of them at once takes as long as to serialise the object.
    """

    def __init__(self) -> None:
        self._taken: tuple[Callable[[], Any], list[Entry]] | None = None
        self._needless: list[Entry] = []
        self._numbers = 0
        self._text, self._room = io.BytesIO(), np.empty(0, dtype=np.uint8)

    def prepare(self, whole: Callable[[], Any]) -> int:
        """Make ready for a step; what `drop` is to be given.

        Parameters
        ----------
        whole
            Gives all that steps change; called where a checkpoint is due.
        """
        full = self._numbers * np.float64().nbytes >= MOST_BYTES
        if self._taken is None or len(self._taken[1]) >= CHECKPOINT or full:
            if self._taken is not None:
                self._needless = self._taken[1]
            self._taken = None  # its copies are about to be overwritten
            self._taken = (self._copied(whole()), [])
            self._numbers = 0
        return len(self._taken[1])

    def add(self, name: str, arguments: tuple[Any, ...], numbers: int = 0) -> None:
        """Take note of a step that was made."""
        assert self._taken is not None, "prepared before"
        del self._needless[-2:]
        self._taken[1].append((name, arguments))
        self._numbers += numbers

    def drop(self, mark: int) -> None:
        """Forget the steps from a mark on."""
        if self._taken is not None:
            del self._taken[1][mark:]

    def forget(self) -> None:
        """Something else than steps has changed the object: the next step begins with a new checkpoint."""
        self._taken = None

    def replayed(self, step: Callable[[Any, str, tuple[Any, ...]], None]) -> Any:
        """The object as it was after the last step kept, anew; `step` makes one."""
        assert self._taken is not None, "prepared before"
        whole = self._taken[0]()
        for name, arguments in self._taken[1]:
            step(whole, name, arguments)
        return whole

    def _copied(self, whole: Any) -> Callable[[], Any]:
        """A function that gives the object as it is now."""
        large: list[NDArray[np.uint8]] = []

        def aside(buffer: pickle.PickleBuffer) -> bool:
            raw = buffer.raw()
            if raw.nbytes < LARGE:
                return True  # to be serialised with the rest
            large.append(np.frombuffer(raw, dtype=np.uint8))
            return False

        self._text.seek(0)
        collects = gc.isenabled()
        try:
            gc.disable()  # what is made here goes at once, and so many objects made would have it look through all
            pickle.Pickler(self._text, protocol=pickle.HIGHEST_PROTOCOL, buffer_callback=aside).dump(whole)
        except (AttributeError, TypeError, pickle.PicklingError):
            copied = copy.deepcopy(whole)
            return lambda: copy.deepcopy(copied)
        finally:
            if collects:
                gc.enable()
        self._text.truncate()
        ends = np.cumsum([content.nbytes for content in large], dtype=np.int64).tolist()
        places = [slice(end - content.nbytes, end) for content, end in zip(large, ends, strict=True)]
        if ends and ends[-1] > len(self._room):
            # In one piece and in one go: pages that are asked for one by one take five times as long.
            spare = np.zeros(int(MORE_ROOM * ends[-1]), dtype=np.uint8)
            pieces: list[Any] = [*large, spare]
            self._room = np.frombuffer(bytearray().join(pieces), dtype=np.uint8)
        else:
            for content, place in zip(large, places, strict=True):
                np.copyto(self._room[place], content)

        def again() -> Any:
            self._text.seek(0)
            return pickle.Unpickler(self._text, buffers=[bytearray(self._room[p]) for p in places]).load()

        return again
