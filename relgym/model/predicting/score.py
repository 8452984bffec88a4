"""How well a model predicts: size of errors, share explained, share right and share abstained, by target."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import groupby, islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import CACHED
from relgym.model.predicting.prediction import OUTCOMES, Outcome, ScenePrediction
from relgym.model.reports.text import Cell, table
from relgym.model.target.hindsight import WRONG
from relgym.scene.objects import ACTION, Float1D, Float2D, Scene, SceneLayout, Transition

if TYPE_CHECKING:
    from relgym.model.world_model import WorldModel

__all__ = ["Score", "TargetScore", "scored"]


@dataclass(slots=True)
class TargetScore:
    """How predictions of one property of one type of objects came out.

    Attributes
    ----------
    count
        Number of predictions.
    right
        Share of them that the model made, rather than abstained from, and that were right: off by at most 1e-9, or by
        what rounding of the observations explains.
    abstained
        Share from which the model abstained: no mode predicted them. Their fallback value counts in the errors below.
    rmse
        Root mean square error of one step, in units of the property.
    r2
        Coefficient of determination of the next value, as scikit-learn's `r2_score`: 1 - SSE / (sum of squares about
        the mean). A property that hardly changes from step to step gets an R² near 1 from any model: see `skill`.
    skill
        1 - SSE / (sum of squared changes): 1 is perfect, 0 as good as saying that nothing changes, below 0 worse.

    Notes
    -----
    Where a denominator is 0, `r2` and `skill` are 1 if there was no error at all, and else 0, as scikit-learn has it.
    Of angles, differences are taken the short way round. All are NaN as long as there are no predictions.
    """

    count: int = 0
    _right: int = 0
    _abstained: int = 0
    _squared: float = 0.0
    _changes: float = 0.0
    _mean: float = 0.0
    _about_mean: float = 0.0

    @property
    def right(self) -> float:
        """See above."""
        return self._share(self._right)

    @property
    def abstained(self) -> float:
        """See above."""
        return self._share(self._abstained)

    @property
    def rmse(self) -> float:
        """See above."""
        return math.sqrt(self._squared / self.count) if self.count else math.nan

    @property
    def r2(self) -> float:
        """See above."""
        return self._explained(self._about_mean)

    @property
    def skill(self) -> float:
        """See above."""
        return self._explained(self._changes)

    def add(
        self,
        was: Float1D,
        came: Float1D,
        said: Float1D,
        claimed: NDArray[np.bool_],
        right: NDArray[np.bool_],
        *,
        angle: bool,
    ) -> None:
        """Take in some predictions.

        Parameters
        ----------
        was, came, said
            Values before, after, and what was predicted, shape ``(n,)`` each.
        claimed, right
            Which of them the model predicted, rather than abstained, and which were right as well, shape ``(n,)``.
        angle
            Whether π and -π are the same place.
        """
        n = len(came)
        if not n:
            return
        errors, changes = _apart(came, said, angle), _apart(came, was, angle)
        self._right += int(np.count_nonzero(right))
        self._abstained += n - int(np.count_nonzero(claimed))
        self._squared += float(errors @ errors)
        self._changes += float(changes @ changes)
        # Sums of squares are united about their means (Chan et al. 1979): of large numbers, else, too little is left.
        about = self._mean if self.count else float(came[0])
        values = about + _apart(came, np.full(n, about), angle)
        mean, total = float(values.mean()), self.count + n
        deviations = values - mean
        self._about_mean += float(deviations @ deviations) + (mean - self._mean) ** 2 * self.count * n / total
        self._mean += (mean - self._mean) * n / total
        self.count = total

    def _share(self, part: int) -> float:
        return part / self.count if self.count else math.nan

    def _explained(self, total: float) -> float:
        if not self.count:
            return math.nan
        if total > 0.0:
            return 1.0 - self._squared / total
        return 1.0 if self._squared == 0.0 else 0.0


@dataclass(slots=True)
class Score:
    """How well a model predicted some transitions, one step each.

    Attributes
    ----------
    transitions
        How many there were.
    exact
        How many of them were predicted with every target right.
    targets
        By name, ``"ball.vx"``; objects of a type count together.
    missed
        Properties that are no targets, since they never changed while the model learned, and that changed here: how
        often, by name. The model keeps them as they are.

    Examples
    --------
    >>> score = Score()
    >>> score.targets["ball.vx"] = part = TargetScore()
    >>> was, came, said = (np.array(x) for x in ([0.0, 1.0], [1.0, 2.0], [1.0, 2.5]))
    >>> part.add(was, came, said, np.array([True, True]), came == said, angle=False)
    >>> part.right, part.rmse, part.r2, part.skill
    (0.5, 0.3535533905932738, 0.5, 0.875)
    """

    transitions: int = 0
    exact: int = 0
    targets: dict[str, TargetScore] = field(default_factory=dict)
    missed: dict[str, int] = field(default_factory=dict)

    @property
    def right(self) -> float:
        """Share of the predictions that the model made and that were right; NaN where there are none."""
        return self._share("right")

    @property
    def abstained(self) -> float:
        """Share of the predictions from which the model abstained; NaN where there are none."""
        return self._share("abstained")

    @property
    def r2(self) -> float:
        """Mean R² of the targets, as scikit-learn's uniform average; NaN where there are none."""
        return float(np.mean([t.r2 for t in self.targets.values()])) if self.targets else math.nan

    def _share(self, name: str) -> float:
        count = sum(t.count for t in self.targets.values())
        if not count:
            return math.nan
        return float(sum(getattr(t, name) * t.count for t in self.targets.values())) / count

    def add(self, prediction: ScenePrediction, transition: Transition, precision: float = 0.0) -> None:
        """Take in one prediction and what came; `precision` as of `scored`."""
        parts = prediction.parts
        self.add_batch(
            transition.before.layout,
            [(part.object, part.property) for part in parts],
            transition.before.vector[None],
            [transition.after],
            prediction.scene.vector[None],
            np.array([part.ok for part in parts], dtype=np.bool_)[None],
            precision,
        )

    def add_batch(
        self,
        layout: SceneLayout,
        parts: Sequence[tuple[str, str]],
        before: Float2D,
        after: Sequence[Scene],
        said: Float2D,
        claimed: NDArray[np.bool_],
        precision: float = 0.0,
    ) -> None:
        """Take in predictions for n scenes with the same objects.

        Parameters
        ----------
        layout
            Layout of the scenes before, and of what was predicted.
        parts
            Object and property of each target.
        before, said
            State vectors before and as predicted, shape ``(n, layout.width)``.
        after
            The n scenes that came; what has vanished from them isn't evaluated.
        claimed
            Which parts the model predicted, rather than abstained, shape ``(n, len(parts))``.
        precision
            As of `scored`.
        """
        came = _following(layout, before, after)
        exact = np.ones(len(before), dtype=np.bool_)
        for k, (name, prop) in enumerate(parts):
            index = layout.index(name)
            column, angle = layout.column(index, prop), prop in layout.types[index].angles
            there = ~np.isnan(came[:, column])
            now, next_, value = (rows[there, column] for rows in (before, came, said))
            right = claimed[there, k] & _equal(next_, value, precision, angle)
            target = self.targets.setdefault(f"{layout.types[index].name}.{prop}", TargetScore())
            target.add(now, next_, value, claimed[there, k], right, angle=angle)
            exact[there] &= right
        self._note_missed(layout, parts, before, came, said)
        self.transitions += len(before)
        self.exact += int(np.count_nonzero(exact))

    def _note_missed(
        self,
        layout: SceneLayout,
        parts: Sequence[tuple[str, str]],
        before: Float2D,
        came: Float2D,
        said: Float2D,
    ) -> None:
        """Count changes of properties that the model keeps as they are, and that no one declared exogenous."""
        for index, (name, kind) in enumerate(zip(layout.names, layout.types, strict=True)):
            for prop in kind.properties if name != ACTION else ():
                column = layout.column(index, prop)
                kept = (said[:, column] == before[:, column]).all()
                if (name, prop) in parts or prop in kind.exogenous or not kept:
                    continue
                changed = int(np.count_nonzero(np.abs(came[:, column] - before[:, column]) > WRONG))
                if changed:
                    label = f"{kind.name}.{prop}"
                    self.missed[label] = self.missed.get(label, 0) + changed

    def __str__(self) -> str:
        rows: list[Sequence[Cell]] = [
            [
                name,
                t.count,
                f"{t.right:.2%}",
                f"{t.abstained:.2%}",
                f"{t.rmse:.3g}",
                f"{t.r2:.6f}",
                f"{t.skill:.6f}",
            ]
            for name, t in self.targets.items()
        ]
        lines = [
            f"{self.exact:,} of {self.transitions:,} steps right in every target",
            table(["target", "predictions", "right", "abstained", "RMSE", "R²", "skill"], rows),
            *(
                f"{name} changed {n:,} times; it never did while the model learned"
                for name, n in self.missed.items()
            ),
        ]
        return "\n".join(lines)


def scored(model: WorldModel, transitions: Iterable[Transition], precision: float = 0.0) -> Score:
    """The score of a model that learns nothing meanwhile.

    Parameters
    ----------
    model
        Stays as it is.
    transitions
        Steps that it should not have learned from.
    precision
        Relative precision of what was observed: 0 for float64, 5e-7 for float32 (`View.precision`); errors below it
        count as right. Of numbers below 1 it is absolute.
    """
    score = Score()
    for layout, run in groupby(transitions, key=lambda t: t.before.layout):
        many = max(1, CACHED // max(1, layout.width))  # results don't depend on it
        while batch := list(islice(run, many)):
            before = np.stack([transition.before.vector for transition in batch])
            said = model.predict_batch(layout, before)
            claimed = said.outcomes == OUTCOMES.index(Outcome.PREDICTED)
            after = [transition.after for transition in batch]
            score.add_batch(layout, said.parts, before, after, said.vectors, claimed, precision)
    return score


def _following(layout: SceneLayout, before: Float2D, after: Sequence[Scene]) -> Float2D:
    """State vectors after the step in the layout before it; NaN where an object has vanished or changed its type."""
    came = np.full_like(before, np.nan)
    for row, scene in zip(came, after, strict=True):
        if scene.layout is layout:
            row[:] = scene.vector
            continue
        for index, (name, kind) in enumerate(zip(layout.names, layout.types, strict=True)):
            if name in scene and scene[name].type == kind:
                row[layout.slice(index)] = scene[name].values
    return came


def _apart(a: Float1D, b: Float1D, angle: bool) -> Float1D:
    """The difference; of angles the short way round."""
    difference: Float1D = a - b
    return np.arctan2(np.sin(difference), np.cos(difference)) if angle else difference


def _equal(came: Float1D, said: Float1D, precision: float, angle: bool) -> NDArray[np.bool_]:
    allowed = np.maximum(WRONG, precision * np.maximum(1.0, np.abs(came)))
    return np.asarray(np.abs(_apart(came, said, angle)) <= allowed)
