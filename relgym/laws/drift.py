"""Whether what no free law explains is noise, or motion that goes on as it did: forces that nothing seen accounts for.

Noise is anew in every step. Of independent changes of velocity d the differences e of consecutive ones have twice the
variance; where noise is on positions, and so on two velocities each, 20/6 of it. Changes by a force that varies with
place or speed are nearly the same one step later, and their differences are small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ENOUGH
from relgym.scene.axes import WORLD

__all__ = ["Drift"]


@dataclass(slots=True)
class Drift:
    """Sums over the changes of velocity of a type's free objects.

    Attributes
    ----------
    count, pairs
        Changes, and consecutive ones of one object.
    total, squares, steps
        Sum of the changes, of their squares, and of the squares of differences of consecutive ones.
    """

    count: int = 0
    pairs: int = 0
    total: list[float] = field(default_factory=lambda: [0.0] * len(WORLD))
    squares: float = 0.0
    steps: float = 0.0
    _last: dict[str, tuple[list[float], list[float]]] = field(default_factory=dict)

    def add(self, name: str, now: NDArray[np.float64], after: NDArray[np.float64]) -> None:
        """Take up an object's velocity in a step, and the next one."""
        here, there = now.tolist(), after.tolist()
        change = [b - a for a, b in zip(here, there, strict=True)]
        self.count += 1
        for k, c in enumerate(change):
            self.total[k] += c
        self.squares += sum([c * c for c in change])
        last = self._last.get(name)
        if last is not None and last[0] == here:
            self.pairs += 1
            self.steps += sum([(c - d) * (c - d) for c, d in zip(change, last[1], strict=True)])
        self._last[name] = there, change

    def noisy(self) -> bool:
        """Whether changes are as little alike as noise is, as far as that is known."""
        if self.pairs < ENOUGH:
            return True
        variance = self.squares / self.count - sum([(t / self.count) * (t / self.count) for t in self.total])
        # The squares of e are none where changes are equal, and twice the variance where they are independent.
        return self.steps / self.pairs >= variance

    def to_json(self) -> list[float | int | list[float]]:
        """Plain data that `restore` reads back; a change begins a new run."""
        return [self.count, self.pairs, list(self.total), self.squares, self.steps]

    def restore(self, data: Sequence[float | int | list[float]]) -> None:
        """Take over what `to_json` wrote."""
        count, pairs, total, squares, steps = data
        self.count, self.pairs = int(count), int(pairs)  # type: ignore[arg-type]
        self.total = [float(t) for t in total]  # type: ignore[union-attr]
        self.squares, self.steps = float(squares), float(steps)  # type: ignore[arg-type]
