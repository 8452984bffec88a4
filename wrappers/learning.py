"""What wrappers that learn have in common: the model, how it does, and its file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, cast

from relgym.arguments import refusing
from relgym.envs.model_files import EnvRecord
from relgym.envs.views import Angle, View
from relgym.errors import ConfigError, ObservationError
from relgym.model.predicting.prediction import ScenePrediction
from relgym.model.predicting.prequential import Prequential
from relgym.model.world_model import WorldModel
from relgym.wrappers.observer import Observer

__all__ = ["Learning"]


class Learning:
    """The public face of an `Observer`, for wrappers of one env and of many."""

    _observer: Observer

    @property
    def view(self) -> View:
        """How observations and actions become scenes; where angles are guessed, see `withdrawn`."""
        return self._observer.view

    @property
    def withdrawn(self) -> tuple[Angle, ...]:
        """Pairs of numbers that were taken for angles until an observation showed that they are none.

        They are plain numbers since, and learning began anew then, with another `view` and another `model`. Angles that
        were declared (``NumbersView(..., angles=...)``) are never withdrawn.
        """
        return self._observer.withdrawn

    @property
    def model(self) -> WorldModel:
        """What was learned; through other wrappers: ``env.get_wrapper_attr("model")``.

        A learner of another kind that was given as `model` is what it is, whatever the annotation says.
        """
        return cast("WorldModel", self._observer.study.model)

    @refusing(ObservationError)
    def predict(
        self, observation: Any, action: Any, info: Mapping[str, Any] | None = None
    ) -> ScenePrediction:
        """What the model says would follow an observation and an action.

        Parameters
        ----------
        observation, action
            As the env gives and takes them; of a vector env those of one of its envs.
        info
            What came with the observation, for views that read it.

        Raises
        ------
        ObservationError
            It is no scene.
        """
        model, view = self.model, self.view
        return model.predict_one(view.with_action(view.scene(observation, info), action))

    @property
    def prequential(self) -> Prequential:
        """How many predictions were wrong, in total and lately."""
        return self._observer.study.prequential

    @property
    def learning(self) -> bool:
        """Whether transitions are being learned from; `ConfigError` to ask it of a model without history."""
        return self._observer.learning

    @learning.setter
    def learning(self, learn: bool) -> None:
        self._observer.learning = learn

    def pause(self) -> None:
        """Stop learning; ``learning = True`` goes on.

        Predictions go on and are counted, unless they are made by a background process: it is sent nothing then.
        """
        self.learning = False

    @property
    def skipped(self) -> int:
        """How many bad observations, and steps with actions that can't be read, were left out."""
        return self._observer.skipped

    @property
    def dropped(self) -> int:
        """How many transitions found the queue to the background process full; kept after `close`."""
        return self._observer.dropped

    def catch_up(self) -> WorldModel:
        """Wait until the background process has learned all it was sent; the model as it then is."""
        return cast("WorldModel", self._observer.study.catch_up())

    # ------------------------------------------------------------------ files
    @property
    def record(self) -> EnvRecord:
        """What a model file says of the env: spaces and the first scenes of the first episodes."""
        return self._observer.record

    @refusing(ConfigError)
    def save(self, path: str | os.PathLike[str], *, history: bool = False) -> None:
        """Write the model, the env's spaces and view and some first scenes to one file, atomically.

        ``gym.make("relgym/LearnedModel-v0", model=path)`` needs nothing else.

        Parameters
        ----------
        path
            Where to write.
        history
            Whether to keep what further learning needs (``ModelLearner(env, model=path)``).

        Raises
        ------
        ConfigError
            A space that can't be written.
        """
        self._observer.save(path, history=history)
