"""Test, then train: errors of predictions made before their outcome was learned from (Dawid 1984)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from relgym.arguments import refusing
from relgym.config.checks import checked_count
from relgym.config.constants import MEMORY, MOST_STEPS
from relgym.errors import ConfigError, ObservationError
from relgym.html import html_table
from relgym.model.learning.transition import LearnReport
from relgym.model.predicting.prediction import Outcome, ScenePrediction
from relgym.model.reports.text import Cell, table
from relgym.model.target.hindsight import WRONG
from relgym.scene.objects import Scene, Transition

__all__ = ["WRONG", "Key", "Outcomes", "Prequential", "StepReport", "compared"]

_PREDICTED = Outcome.PREDICTED

Key: TypeAlias = tuple[str, str]
"""An object and one of its properties."""


@dataclass(slots=True)  # not frozen: made in every step
class StepReport:
    """What one step told the learner; ``info["relgym"]``.

    Attributes
    ----------
    prediction
        What the model had expected, before it saw the outcome; ``None`` when it wasn't asked.
    residuals
        Observed minus predicted value of every target, by (object, property), in units of the property;
        objects that vanished have none.
    wrong
        Those that were off by more than 1e-9 and what rounding explains, or that no mode predicted.
    learned
        What the transition taught; ``None`` when it wasn't learned from.
    transition
        What happened, as the model saw it; ``None`` where there was nothing to see.
    """

    # Gymnasium's checker asks that equally seeded episodes have equal infos. The env's are; what a learner thinks of
    # them depends on what it has learned by then, so it takes no part in comparisons.
    prediction: ScenePrediction | None = field(compare=False)
    residuals: Mapping[Key, float] = field(compare=False)
    wrong: tuple[Key, ...] = field(compare=False)
    learned: LearnReport | None = field(compare=False)
    transition: Transition | None = field(default=None, compare=False)

    def _repr_html_(self) -> str:
        told = () if self.prediction is None else self.prediction.parts
        said = {(part.object, part.property): part for part in told}
        rows = [
            (
                f"{key[0]}.{key[1]}",
                f"{said[key].value:.7g}",
                f"{off:.2g}",
                "wrong" if key in self.wrong else "right",
            )
            for key, off in self.residuals.items()
        ]
        return html_table(
            "Predicted, then observed", ("target", "predicted", "observed − predicted", ""), rows
        )


@dataclass(slots=True)  # not frozen: made in every step
class Outcomes:
    """How the predictions of one step came out, part by part.

    Attributes
    ----------
    parts
        The (object, property) of each.
    residuals
        Observed minus predicted value of each, in units of the property.
    changes
        Observed value minus the one before, which is what *nothing changes* would be off by.
    claimed
        Whether the model predicted it, rather than giving a fallback value.
    spreads
        Standard deviation that the model stated, in units of the property; NaN: none.
    """

    parts: tuple[Key, ...]
    residuals: tuple[float, ...]
    changes: tuple[float, ...]
    claimed: tuple[bool, ...]
    spreads: tuple[float, ...]

    @classmethod
    def of(cls, prediction: ScenePrediction, before: Scene, residuals: Mapping[Key, float]) -> Outcomes:
        """What became of a prediction; `residuals` are those of `compared`."""
        places, angles, now = before.layout.places, before.layout.angles, before.vector.item
        rows = []
        for part in prediction.parts:
            key = part.object, part.property
            off = residuals.get(key)
            if off is None:
                continue
            column = places[key]
            # Observed minus predicted plus predicted minus before; a turn is measured the short way, as its residual.
            moved = part.value - now(column)
            if angles and column in angles:
                moved = math.remainder(moved, 2.0 * math.pi)
            rows.append((key, off, off + moved, part.outcome is _PREDICTED, part.spread))
        return cls(*zip(*rows, strict=True)) if rows else cls((), (), (), (), ())


class Prequential:
    """How often the model was wrong on steps that it hadn't seen, and by how much, in total and lately.

    Parameters
    ----------
    window
        How many steps count as the latest, >= 1; by default as many as tell how right predictions are.

    Attributes
    ----------
    steps : int
        Steps with predictions.
    predictions, wrong : dict
        How many predictions were made, and how many were wrong, by (object, property).

    Examples
    --------
    >>> count = Prequential(window=2)
    >>> for wrong in ([("ball", "vx")], [("ball", "vx")], []):
    ...     count.count([("ball", "vx")], wrong)
    >>> count.wrong, count.recent_wrong, count.recent
    ({('ball', 'vx'): 2}, {('ball', 'vx'): 1}, 0.5)
    """

    @refusing(ConfigError)
    def __init__(self, window: int = MEMORY) -> None:
        self.steps = 0
        self.predictions: dict[Key, int] = {}
        self.wrong: dict[Key, int] = {}
        self._window: deque[tuple[Key, ...]] = deque(maxlen=checked_count("window", window, 1, MOST_STEPS))
        self._outcomes: deque[Outcomes] = deque(maxlen=self._window.maxlen)

    @refusing(ObservationError)
    def count(self, predicted: Iterable[Key], wrong: Iterable[Key], outcomes: Outcomes | None = None) -> None:
        """Take in one step: what was predicted, which of that was wrong, and by how much."""
        self.steps += 1
        if outcomes is not None:
            self._outcomes.append(outcomes)
        for key in predicted:
            if key not in self.wrong:
                self.predictions[key] = self.wrong[key] = 0
            self.predictions[key] += 1
        found = tuple(wrong)
        self._window.append(found)
        for key in found:
            self.wrong[key] += 1

    @property
    def recent(self) -> float:
        """Share of the latest steps with a wrong prediction; NaN before the first."""
        return sum(map(bool, self._window)) / len(self._window) if self._window else float("nan")

    @property
    def nrmse(self) -> float:
        """Normalised error size of the latest steps: 0 is exact, 1 as good as that nothing changes; NaN before any.

        The root mean square of what predictions were off by, fallback values included, divided by that of how far the
        property moved; of several targets the root mean square of their ratios. One that never moved counts as 0 while
        it is predicted exactly, else as 1.
        """
        squares: dict[Key, list[float]] = {}
        for told in self._outcomes:
            for key, off, change in zip(told.parts, told.residuals, told.changes, strict=True):
                sums = squares.setdefault(key, [0.0, 0.0])
                sums[0] += off**2
                sums[1] += change**2
        ratios = [off / moved if moved else float(off > 0.0) for off, moved in squares.values()]
        return math.sqrt(math.fsum(ratios) / len(ratios)) if ratios else math.nan

    @property
    def coverage(self) -> float:
        """Share of the latest predictions that the model claims, rather than abstains from; NaN before any."""
        claimed = [one for told in self._outcomes for one in told.claimed]
        return sum(claimed) / len(claimed) if claimed else math.nan

    @property
    def calibration(self) -> float:
        """Share of the latest claimed predictions that came within two of the standard deviations stated.

        Of normal errors whose spread is stated rightly some 95 % do; more: the model is too modest, fewer: too sure.
        What is off by no more than 1e-9 counts as within; NaN where no prediction with a spread was claimed.
        """
        within = [
            abs(off) <= max(2.0 * spread, WRONG)
            for told in self._outcomes
            for off, claimed, spread in zip(told.residuals, told.claimed, told.spreads, strict=True)
            if claimed and math.isfinite(spread)
        ]
        return sum(within) / len(within) if within else math.nan

    @property
    def recent_wrong(self) -> dict[Key, int]:
        """How many predictions of the latest steps were wrong, by (object, property)."""
        counts = dict.fromkeys(self.wrong, 0)
        for keys in self._window:
            for key in keys:
                counts[key] += 1
        return counts

    def __str__(self) -> str:
        lately = self.recent_wrong
        rows: list[list[Cell]] = [
            [f"{key[0]}.{key[1]}", self.predictions[key], self.wrong[key], lately[key]] for key in self.wrong
        ]
        latest = f"in the last {len(self._window):,}"
        return table(["target", "predictions", "wrong", latest], rows)


def compared(
    prediction: ScenePrediction | None, after: Scene, precision: float = 0.0
) -> tuple[dict[Key, float], tuple[Key, ...]]:
    """Residuals of a prediction, and which parts of it were wrong: see `StepReport`.

    Parameters
    ----------
    prediction
        What was said; ``None``: nothing.
    after
        What came.
    precision
        Relative precision of what came (`View.precision`); of numbers below 1 it is absolute.
    """
    residuals: dict[Key, float] = {}
    wrong: list[Key] = []
    places, angles, number = after.layout.places, after.layout.angles, after.vector.item
    for part in () if prediction is None else prediction.parts:
        key = (part.object, part.property)
        column = places.get(key)
        if column is None:
            if part.object not in after:
                continue
            column = after.layout.column(after.layout.index(part.object), part.property)
        came = number(column)
        off = came - part.value
        if angles and column in angles:  # π and -π are the same place
            off = math.remainder(off, 2.0 * math.pi)
        residuals[key] = off
        if part.outcome is not _PREDICTED or not (
            abs(off) <= WRONG or abs(off) <= precision * max(1.0, abs(came))
        ):
            wrong.append(key)
    return residuals, tuple(wrong)
