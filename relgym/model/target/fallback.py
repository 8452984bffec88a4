"""Fallback values where modes aren't used: guesses, within the range of what was seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.clusterer import ModeClusterer
from relgym.clustering.columns import SlotSignature
from relgym.clustering.mode import NOISE
from relgym.clustering.roles import Binding
from relgym.config.constants import ROUGH
from relgym.model.percepts.perception import Percept
from relgym.model.target.functions import BoundFunctions
from relgym.model.target.guess import Guess, Guesses
from relgym.model.target.scope import EVERYWHERE

__all__ = ["Fallback"]


class Fallback:
    """The guesses of one target, and how far they and its modes go.

    Parameters
    ----------
    clusterer
        Knows the modes.
    offered
        Whether non-linear features are offered.

    Attributes
    ----------
    guesses
        The best guess, where nothing is explained.
    scope
        Where modes are used, and how far guesses and approximations go.
    unexplained
        Whether there is no law, as far as is known by now.
    """

    def __init__(self, clusterer: ModeClusterer, *, offered: bool) -> None:
        self.clusterer = clusterer
        self.offered = offered
        self.guesses = Guesses()
        self.scope = EVERYWHERE
        self.unexplained = False
        self.bound = BoundFunctions()

    @property
    def inexact(self) -> bool:
        """Whether modes are approximations, or leave more than rounding explains, and nobody said that they would."""
        known = self.clusterer.population
        if known.approximate:
            return True
        return known.scale.sigma > ROUGH * self.clusterer.floor and known.config.noise_std == "auto"

    @property
    def lawless(self) -> bool:
        """Whether nothing is explained, or nothing exactly."""
        return self.unexplained or self.inexact

    @property
    def guessable(self) -> bool:
        """Whether guesses may stand in: features are offered, mostly more than regressions have room for."""
        return self.lawless and self.offered

    @property
    def guess(self) -> Guess | None:
        """The best guess, where it stands in for what isn't explained: nothing is, or nothing exactly."""
        return self.guesses.best if self.guessable else None

    @property
    def guess_beyond(self) -> Guess | None:
        """The guess used where approximations aren't, if it is better than the best guess of all."""
        return self.guesses.beyond if self.guessable and self.scope.tree is not None else None

    @property
    def guesses_something(self) -> bool:
        """Whether there is any guess that stands in."""
        known = self.guesses
        if known.best is None and (known.beyond is None or self.scope.tree is None):
            return False
        return self.guessable

    def guess_at(self, percept: Percept, index: int, following: NDArray[np.float64]) -> Guess | None:
        """The guess for one object of a single scene; arguments as of `predict_one`."""
        if self.guess_beyond is None:
            return self.guess
        x = percept.rows(index, following[None], ordered=False)[0].tolist()
        covered = self.scope.covers_one(x, percept.situation(index).signature)
        return self.guess if covered else self.guess_beyond

    def beyond(self, percept: Percept, index: int, following: NDArray[np.float64]) -> str:
        """Tests of the place where modes aren't used, if one object of a single scene lies in one; else empty."""
        row = percept.rows(index, following[None], ordered=False)[0].tolist()
        signature = percept.situation(index).signature
        return "" if self.scope.covers_one(row, signature) else self.scope.place(row, signature)

    def guessed(
        self, percept: Percept, index: int, following: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """What guesses say of one object of n scenes, shape ``(n,)``, NaN where there is none; None if there is none.

        Arguments as of `predict_batch`.
        """
        signature = percept.situation(index).signature
        whole, beyond = self.guessing(signature), self.guessing(signature, beyond=True)
        if whole is None and beyond is None:
            return None
        x = percept.rows(index, following, ordered=False)
        target = self.clusterer.target
        values = np.full(len(x), np.nan) if whole is None else whole.values(x)[:, 0]
        if beyond is not None:
            values = np.where(self.scope.covers(x, signature), values, beyond.values(x)[:, 0])
        return self.scope.within(values, signature, x, target)

    def guessing(self, signature: SlotSignature, *, beyond: bool = False) -> Binding | None:
        """A guess over a signature's columns: the best one of all, or that beyond the scope of approximations."""
        # In the place of a mode's id, -1: that beyond.
        best, key = (self.guess, NOISE) if not beyond else (self.guess_beyond, -1)
        if best is None:
            return None
        bound = self.bound.of(signature, key, best.mode)
        return None if bound is None or bound.open else bound

    def within(self, value: float, signature: SlotSignature, row: NDArray[np.float64]) -> float:
        """What a mode predicts for a row ``(1, d)``, or as far as approximations go."""
        if not self.clusterer.approximate:
            return value
        return float(self.scope.within(np.array([value]), signature, row, self.clusterer.target)[0])

    def all_within(
        self, values: NDArray[np.float64], signature: SlotSignature, x: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """`within` of rows ``(n, d)``, shape ``(n,)``."""
        if not self.clusterer.approximate:
            return values
        return self.scope.within(values, signature, x, self.clusterer.target)
