"""The kernel that this process has, once it pays."""

from __future__ import annotations

import warnings
from threading import Lock, Thread
from typing import Final

from relgym.config.constants import REPAID
from relgym.errors import ConfigError, SlowWarning
from relgym.program.gpu import Card, CardError
from relgym.program.machine import Machine, make
from relgym.program.tape import Sizes

__all__ = ["KERNEL", "Kernel"]


class Kernel:
    """The compiled kernel, as this process has it: none before it pays.

    Once arrays have taken about as long as loading it takes (`REPAID`), it is loaded in a thread of its own; where no
    file holds it, another process compiles it first (`relgym.program.machine`). Arrays answer until it is there, with
    the same bits: no step ever waits. What arrays took is estimated from what was asked: of many scenes at once about
    so many take as long again as it takes to ask at all.

    Attributes
    ----------
    machine
        The kernel; None: not yet, or it can't be had.
    asked
        How often arrays were asked so far, or what took as long.
    """

    def __init__(self) -> None:
        self.machine: Machine | None = None
        self.asked = 0.0
        self._missing = ""  # why it can't be had
        self._warned = False
        self._loader: Thread | None = None
        self._card: Card | None = None
        self._turn = Lock()

    def after(self, scenes: int) -> Machine | None:
        """The kernel, if it is there, now that so many scenes more are asked."""
        if self.machine is None and not self._warned:
            self.asked += 1.0 + scenes / REPAID
            if self._missing:
                self._warn()
            elif self._loader is None and self.asked >= REPAID:
                self._loader = Thread(target=self._make, name="relgym's kernel", daemon=True)
                self._loader.start()
        return self.machine

    def load(self) -> Machine | None:
        """Have it now, whether it pays or not, compiled if need be."""
        self._make()
        if self._missing and not self._warned:
            self._warn()
        return self.machine

    def card(self, sizes: Sizes) -> Card:
        """A graphics card with a kernel for programs of some sizes, which takes seconds to compile.

        Raises
        ------
        ConfigError
            There is none.
        """
        with self._turn:
            if self._card is None or not self._card.fits(sizes):
                try:
                    self._card = Card(sizes)
                except CardError as error:
                    raise ConfigError(f"device='cuda': {error}") from None
            return self._card

    def _make(self) -> None:
        with self._turn:
            if self.machine is None and not self._missing:
                try:
                    self.machine = make()
                    self._missing = "" if self.machine else "it couldn't be compiled"
                except (ImportError, OSError, RuntimeError) as error:
                    self._missing = f"{type(error).__name__}: {error}; pip install llvmlite"

    def _warn(self) -> None:
        self._warned = True
        warnings.warn(
            f"models are run by arrays, some 30 times slower, since there is no kernel: {self._missing}",
            SlowWarning,
            stacklevel=2,
        )


KERNEL: Final = Kernel()
"""That of this process."""
