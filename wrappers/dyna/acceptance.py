"""Whether a model is good enough to train in: decided by its prequential error, with hysteresis."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

__all__ = ["ModelAcceptance", "Spread", "Verdict"]

Key: TypeAlias = tuple[str, str]
"""A type or the task, and a property."""


@dataclass(slots=True)
class Spread:
    """Running root mean square of how far a property moves in a step, in its units."""

    count: int = 0
    mean_square: float = 0.0

    def add(self, change: float) -> None:
        """Take up one change."""
        self.count += 1
        self.mean_square += (change * change - self.mean_square) / self.count

    @property
    def scale(self) -> float:
        """The root mean square; 0 before anything moved."""
        return float(self.mean_square**0.5)


@dataclass(frozen=True, slots=True)
class Verdict:
    """One real step: how far the prediction was off, and how much changed.

    Attributes
    ----------
    residuals
        Observed minus predicted value, by (type or task, property); the largest where several objects have it.
        Empty where the model made no prediction.
    changes
        Observed change of the same properties: the error of a model that predicts no change.
    """

    residuals: Mapping[Key, float]
    changes: Mapping[Key, float]


class ModelAcceptance:
    """Accepts a model when its prequential error is small, and rejects it when the error has grown large.

    The error of a step is the largest ratio, over all properties, of the prediction error to how much the property
    usually changes in a step, clipped at 1; `error` is its mean over the latest steps. A model that predicts no change
    scores about 1, an exact one 0. Steps that the model doesn't predict don't count: roll-outs end there.

    Parameters
    ----------
    accept_at, reject_at
        The model is accepted at an error of at most `accept_at` and rejected at one of at least `reject_at`; in between
        nothing changes.
    window
        How many of the latest steps count.
    least
        With fewer of them the model isn't accepted.

    Examples
    --------
    >>> acceptance = ModelAcceptance(accept_at=0.1, reject_at=0.5, window=4, least=2)
    >>> for off in (0.0, 0.0, 1.0, 1.0, 1.0):
    ...     acceptance.count(Verdict({("cart", "v"): off}, {("cart", "v"): 1.0}))
    ...     print(acceptance.error, acceptance.accepted)
    0.0 False
    0.0 True
    0.3333333333333333 True
    0.5 False
    0.75 False
    """

    def __init__(self, *, accept_at: float, reject_at: float, window: int, least: int) -> None:
        self.accept_at, self.reject_at, self.least = accept_at, reject_at, least
        self.accepted = False
        self.switches = 0
        self._errors: deque[float] = deque(maxlen=window)
        self._predicted: deque[bool] = deque(maxlen=window)
        self._spreads: dict[Key, Spread] = {}

    @property
    def error(self) -> float:
        """Mean error of the latest steps that the model predicted; 1 while there are none."""
        return sum(self._errors) / len(self._errors) if self._errors else 1.0

    @property
    def known(self) -> float:
        """Share of the latest steps that the model predicted."""
        return sum(self._predicted) / len(self._predicted) if self._predicted else 0.0

    def count(self, verdict: Verdict) -> None:
        """Count one real step; `accepted` is up to date afterwards."""
        for key, change in verdict.changes.items():
            self._spreads.setdefault(key, Spread()).add(change)
        self._predicted.append(bool(verdict.residuals))
        if verdict.residuals:
            self._errors.append(max(self.ratio(key, off) for key, off in verdict.residuals.items()))
        self._decide()

    def ratio(self, key: Key, off: float) -> float:
        """How far a prediction was off by how much the property usually changes, at most 1; of NaN 1."""
        scale = self._spreads[key].scale if key in self._spreads else 0.0
        if scale == 0.0:  # it never changed: any error counts as 1
            return float(abs(off) > 1e-9)
        return min(1.0, abs(off) / scale) if off == off else 1.0

    def _decide(self) -> None:
        enough = len(self._errors) >= self.least
        now = enough and (self.error <= self.accept_at or (self.accepted and self.error < self.reject_at))
        self.switches += now != self.accepted
        self.accepted = now
