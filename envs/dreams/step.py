"""One step of many dreams, as a function of arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.envs.dreams.ends import CAUSES, Cause, causes, explained, horizon_reached, parts_of_row
from relgym.envs.dreams.rewards import BatchStepEvaluator, TaskFunctions
from relgym.envs.dreams.setting import Setting
from relgym.envs.dreams.shown import Deeds
from relgym.model.predicting.prediction import BatchPrediction
from relgym.scene.objects import Float1D, Float2D, SceneLayout

__all__ = ["DreamStep", "Stepped"]

_HORIZON, _NO_REWARD, _LEFT = (CAUSES.index(c) for c in (Cause.HORIZON, Cause.NO_REWARD, Cause.LEFT))


@dataclass(frozen=True, slots=True)
class Stepped:
    """What one step made of n dreams; everything has a leading axis of length n.

    Attributes
    ----------
    vectors
        State vectors after the step; those before it where the prediction could not be followed. They may be the
        prediction's own: who changes them copies them first.
    rewards, terminated, truncated
        As Gymnasium has them.
    causes
        Why an episode was truncated, as a position in `CAUSES`; -1 if it wasn't.
    success
        Whether the task succeeded; None if there is no task, or it doesn't tell.
    foreseen
        State vectors that the model predicted, followed or not.
    prediction
        The model's words.
    """

    vectors: Float2D
    rewards: Float1D
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    causes: NDArray[np.int8]
    success: NDArray[np.bool_] | None
    foreseen: Float2D
    prediction: BatchPrediction


@dataclass(frozen=True)
class DreamStep:
    """The step function of dreams: pure, so that whoever keeps the scenes keeps the state.

    Attributes
    ----------
    setting, evaluator, task
        Where it takes place, and what steps are worth.
    actions
        Puts actions into scenes.
    horizon
        Longest episode in steps; None: no limit.
    min_margin
        Least margin of a prediction that is followed.
    corrected
        What is made of predicted state vectors before they are evaluated; None: nothing.
    guesses
        Whether abstentions are followed, too: to what the model would have said, else as if nothing changed.
    predicts
        Who predicts, as `WorldModel.predict_batch`; None: the setting's model.
    """

    setting: Setting
    evaluator: BatchStepEvaluator
    task: TaskFunctions | None
    actions: Deeds
    horizon: int | None
    min_margin: float
    corrected: Callable[[Float2D], Float2D] | None = None
    guesses: bool = False
    predicts: Callable[[SceneLayout, Float2D], BatchPrediction] | None = None

    def __call__(
        self,
        before: Float2D,
        steps: NDArray[np.int64],
        actions: Any,
        among: NDArray[np.bool_] | None = None,
    ) -> Stepped:
        """Step n dreams.

        Parameters
        ----------
        before
            State vectors without an action, shape ``(n, width)``; not changed.
        steps
            How many steps the dreams have lasted, this one included, shape ``(n,)``.
        actions
            Checked actions, shape ``(n, …)``.
        among
            Which of them go on, shape ``(n,)``; what comes of the others means nothing. Default: all.

        Raises
        ------
        ConfigError
            A reward is NaN or infinite.
        """
        acting = self.actions.joined(before, actions)
        predicts = self.setting.model.predict_batch if self.predicts is None else self.predicts
        prediction = predicts(self.actions.layout, acting)
        after = self.actions.parted(prediction.vectors)
        if self.corrected is not None:
            after = self.corrected(after)
        inside = self.setting.shown.still_inside(after, prediction.parts)
        why = causes(prediction, inside, self.min_margin, self.evaluator.overruled)
        if self.guesses:
            why[inside & np.isfinite(after).all(axis=1)] = -1
        others = None if among is None else (~among).nonzero()[0]
        if others is not None:
            why[others] = _HORIZON  # neither followed nor evaluated
        rewards, ended, success = self._evaluated(before, actions, after, why < 0)
        if (doubted := np.isnan(rewards)).any():
            why[doubted], rewards[doubted], ended[doubted] = _NO_REWARD, 0.0, False
        if self.horizon is not None:
            why[((why < 0) & (steps >= self.horizon)).nonzero()[0]] = _HORIZON
        lost = (why >= 0) & (why != _HORIZON)
        if others is not None:
            why[others] = -1
        followed = after
        if len(rows := lost.nonzero()[0]):
            followed = after.copy()
            followed[rows] = before[rows]
        if len(self.setting.brought):
            followed = after.copy() if followed is after else followed
            followed[:, self.setting.brought] = 0.0  # what the next step will bring isn't known
        return Stepped(followed, rewards, ended, why >= 0, why, success, after, prediction)

    def _evaluated(
        self, before: Float2D, actions: Any, after: Float2D, good: NDArray[np.bool_]
    ) -> tuple[Float1D, NDArray[np.bool_], NDArray[np.bool_] | None]:
        """Rewards, ends and successes; a step that can't be followed has none of them."""
        tells = getattr(self.task, "successes", None)
        layout = self.setting.layout
        # Single dreams are frozen: a function that changes what it evaluates would change the dream.
        before, after = _read_only(before), _read_only(after)
        if tells is None and not self.evaluator.evaluates:
            return np.zeros(len(before)), np.zeros(len(before), dtype=np.bool_), None
        if tells is None and not self.evaluator.asks:
            rewards, ended = self.evaluator(before, actions, after)
            return np.where(good, rewards, 0.0), ended & good, None
        if good.all():
            success = (
                None if tells is None else np.asarray(tells(layout, before, actions, after), dtype=np.bool_)
            )
            return (*self.evaluator(before, actions, after), success)
        rewards, ended = np.zeros(len(before)), np.zeros(len(before), dtype=np.bool_)
        success = None if tells is None else ended.copy()
        if good.any():
            steps = _read_only(before[good]), actions[good], _read_only(after[good])
            rewards[good], ended[good] = self.evaluator(*steps)
            if tells is not None and success is not None:
                success[good] = tells(layout, *steps)
        return rewards, ended, success

    @property
    def out_of_time(self) -> str:
        """The sentence for those that have lasted as long as they may."""
        return horizon_reached(self.horizon)

    def reasons(self, stepped: Stepped, rows: NDArray[np.intp]) -> list[str]:
        """Why some dreams were truncated: for each a sentence that names objects and properties."""
        found, left = [""] * len(rows), []
        for k, row in enumerate(rows.tolist()):
            cause = int(stepped.causes[row])
            if cause == _HORIZON:
                found[k] = self.out_of_time
            elif cause == _NO_REWARD:
                found[k] = Cause.NO_REWARD.value
            elif cause == _LEFT:
                left.append(k)
            else:
                parts = parts_of_row(stepped.prediction, row)
                told = explained(parts, self.min_margin, self.evaluator.overruled)
                if told is None:
                    left.append(k)
                else:
                    found[k] = told[1]
        if left:
            beyond = self.setting.shown.outside(self.setting.layout, stepped.foreseen[rows[left]])
            for k, sentence in zip(left, beyond, strict=True):
                found[k] = sentence
        return found


def _read_only(vectors: Float2D) -> Float2D:
    view = vectors.view()
    view.flags.writeable = False
    return view
