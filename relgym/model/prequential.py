"""Test, then train: errors of predictions made before their outcome was learned from (Dawid 1984)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from relgym.arguments import refusing
from relgym.config.checks import checked_count
from relgym.errors import ConfigError, ObservationError
from relgym.model.hindsight import WRONG
from relgym.model.learning import LearnReport
from relgym.model.prediction import ScenePrediction
from relgym.model.text import Cell, table
from relgym.scene.objects import Scene, Transition

__all__ = ["WRONG", "Key", "Prequential", "StepReport", "compared"]

Key: TypeAlias = tuple[str, str]
"""An object and one of its properties."""


@dataclass(frozen=True, slots=True)
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


class Prequential:
    """How often the model was wrong on steps that it hadn't seen, in total and lately.

    Parameters
    ----------
    window
        How many steps count as the latest, >= 1.

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
    def __init__(self, window: int = 1000) -> None:
        self.steps = 0
        self.predictions: dict[Key, int] = {}
        self.wrong: dict[Key, int] = {}
        self._window: deque[tuple[Key, ...]] = deque(maxlen=checked_count("window", window, 1, 10**9))

    @refusing(ObservationError)
    def count(self, predicted: Iterable[Key], wrong: Iterable[Key]) -> None:
        """Take in one step: what was predicted, and which of that was wrong."""
        self.steps += 1
        for key in predicted:
            self.predictions[key] = self.predictions.get(key, 0) + 1
            self.wrong.setdefault(key, 0)
        self._window.append(tuple(wrong))
        for key in self._window[-1]:
            self.wrong[key] += 1

    @property
    def recent(self) -> float:
        """Share of the latest steps with a wrong prediction; NaN before the first."""
        return sum(map(bool, self._window)) / len(self._window) if self._window else float("nan")

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
    layout = after.layout
    for part in () if prediction is None else prediction.parts:
        if part.object not in after:
            continue
        key = (part.object, part.property)
        column = layout.column(layout.index(part.object), part.property)
        came = float(after.vector[column])
        residuals[key] = came - part.value
        if part.property in after[part.object].type.angles:  # π and -π are the same place
            residuals[key] = math.remainder(residuals[key], 2.0 * math.pi)
        if not part.ok or not abs(residuals[key]) <= max(WRONG, precision * max(1.0, abs(came))):
            wrong.append(key)
    return residuals, tuple(wrong)
