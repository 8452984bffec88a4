"""The learning half of every wrapper: predict, compare, learn; here or in a process of its own.

The model is told how its predictions came out while it learns: so it learns where modes explain the examples but their
conditions don't tell which of them holds (`relgym.model.target.hindsight`).
"""

from __future__ import annotations

from typing import Any

from relgym.errors import ConfigError
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.predicting.prediction import ScenePrediction
from relgym.model.predicting.prequential import Outcomes, Prequential, StepReport
from relgym.model.protocol import SceneLearner
from relgym.scene.objects import Scene, Transition
from relgym.wrappers.background import Background

__all__ = ["NOTHING", "Study"]

NOTHING = StepReport(None, {}, (), None)
"""The report of a step that taught nothing: a pseudo-transition, or a bad observation."""


class Study:
    """Test, then train.

    Parameters
    ----------
    model
        What learns.
    learn, predict
        Whether to learn, and whether to predict before.
    window
        How many steps count as the latest.
    precision
        Relative precision of what is observed; errors below it aren't counted as wrong.
    background
        Length of the queue to a process that learns in the background; ``None``: learn here.

    Attributes
    ----------
    model : SceneLearner
        What was learned; with a background process as of the last `catch_up`.
    prequential : Prequential
        Errors of predictions made before their outcome was learned; as of the last `catch_up`, too.
    """

    def __init__(
        self,
        model: SceneLearner,
        *,
        learn: bool = True,
        predict: bool = True,
        window: int = 1000,
        precision: float = 0.0,
        background: int | None = None,
    ) -> None:
        self.model = model
        self.prequential = Prequential(window)
        self._predict = predict
        self._precision = precision
        self.learning = learn
        self._background: Background | None = None
        self._dropped = 0
        if background is not None:
            self._background = Background(
                model, self.prequential if predict else None, precision=precision, queue=background
            )

    def __getstate__(self) -> dict[str, Any]:
        # A copy has a model of its own; a process can't be copied, so the copy learns here.
        self.catch_up()
        return self.__dict__ | {"_background": None}

    @property
    def learning(self) -> bool:
        """Whether transitions are being learned from; `ConfigError` to ask it of a model without history."""
        return self._learn

    @learning.setter
    def learning(self, learn: bool) -> None:
        if learn and self.model.frozen:
            raise ConfigError(
                "this model was loaded without its history and can only predict: save it with "
                "save(path, history=True), or pass learn=False"
            )
        self._learn = learn

    @property
    def dropped(self) -> int:
        """How many transitions found the queue full and weren't learned from; 0 if there never was a queue."""
        return self._dropped if self._background is None else self._background.dropped

    def expect(self, before: Scene | None) -> ScenePrediction | None:
        """What the model says will follow; ``None`` where it isn't asked."""
        if before is None or not self._predict or self._background is not None:
            return None
        return self.model.predict_one(before)

    def take_up(self, transition: Transition | None, prediction: ScenePrediction | None) -> StepReport:
        """Count the errors of a prediction, then learn from what happened."""
        if transition is None:
            return NOTHING
        if self._background is not None:
            if self._learn:
                self._background.put(transition)
            return NOTHING
        report = compare_and_learn(
            self.model, transition, prediction, precision=self._precision, learn=self._learn
        )
        if prediction is not None:
            outcomes = Outcomes.of(prediction, transition.before, report.residuals)
            self.prequential.count(report.residuals, report.wrong, outcomes)
        return report

    def catch_up(self) -> SceneLearner:
        """Wait until all that is queued was learned; the model as it then is."""
        if self._background is not None:
            extra = self.model.extra
            self.model, count = self._background.fetch()
            self.model.extra = extra
            self.prequential = self.prequential if count is None else count
        return self.model

    def discard(self) -> None:
        """End the background process, if there is one, without waiting for what it has yet to learn."""
        if self._background is not None:
            self._background.close()
            self._background = None

    def close(self) -> None:
        """Fetch what was learned and end the background process, if there is one; learning goes on here."""
        if self._background is not None:
            try:
                self.catch_up()
            finally:  # whatever became of the process, it is over
                self._dropped = self._background.dropped
                self.discard()
