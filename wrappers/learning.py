"""What wrappers that learn have in common: the model, how it does, and its file."""

from __future__ import annotations

import os

from relgym.envs.model_files import EnvRecord
from relgym.envs.views import View
from relgym.model.world_model import WorldModel
from relgym.wrappers.observer import Observer
from relgym.wrappers.prequential import Prequential

__all__ = ["Learning"]


class Learning:
    """The public face of an `Observer`, for wrappers of one env and of many."""

    _observer: Observer

    @property
    def view(self) -> View:
        """How observations and actions become scenes; final after the first reset, where angles are open."""
        return self._observer.view

    @property
    def model(self) -> WorldModel:
        """What was learned; through other wrappers: ``env.get_wrapper_attr("model")``."""
        return self._observer.study.model

    @property
    def prequential(self) -> Prequential:
        """How many predictions were wrong, in total and lately."""
        return self._observer.study.prequential

    @property
    def learning(self) -> bool:
        """Whether transitions are being learned from; `ConfigError` to ask it of a model without history."""
        return self._observer.study.learning

    @learning.setter
    def learning(self, learn: bool) -> None:
        self._observer.study.learning = learn

    def pause(self) -> None:
        """Stop learning; predictions go on and are counted. ``learning = True`` goes on."""
        self.learning = False

    @property
    def skipped(self) -> int:
        """How many bad observations were skipped."""
        return self._observer.skipped

    @property
    def dropped(self) -> int:
        """How many transitions found the queue to the background process full."""
        return self._observer.study.dropped

    def catch_up(self) -> WorldModel:
        """Wait until the background process has learned all it was sent; the model as it then is."""
        return self._observer.study.catch_up()

    # ------------------------------------------------------------------ files
    @property
    def record(self) -> EnvRecord:
        """What a model file says of the env: spaces and the first scenes of the first episodes."""
        return self._observer.record

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
