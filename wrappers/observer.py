"""What all learning wrappers share: one view, one model, and the envs that it learns from."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from gymnasium import spaces
from gymnasium.error import ResetNeeded

from relgym.config import ModelConfig
from relgym.envs.model_files import EnvRecord
from relgym.envs.views import View
from relgym.model.prediction import ScenePrediction
from relgym.model.storage import target_to_json
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene
from relgym.wrappers.follower import BadObservations, Follower
from relgym.wrappers.prequential import StepReport
from relgym.wrappers.settings import PlainTarget, config_of, model_of, target_of
from relgym.wrappers.study import NOTHING, Study
from relgym.wrappers.views import is_open, settled

__all__ = ["STARTS", "Observer"]

STARTS = 16
"""How many first scenes of episodes a model file keeps, for dreams to start from."""


class Observer:
    """Follows some envs alike and lets one model learn from all of them.

    Parameters
    ----------
    view
        How observations and actions become scenes.
    observation_space, action_space
        Spaces of a single env.
    envs
        How many envs there are.
    targets, config, model
        As of `ModelLearner`.
    learn, predict, window, background
        As of `Study`.
    bad_observations
        As of `Follower`.
    metadata
        Plain data of the env for people and renderers.

    Attributes
    ----------
    view : View
        Final after the first observations.
    followers : list
        One `Follower` per env.
    arguments : dict
        The arguments that wrappers record, as plain data.
    """

    def __init__(
        self,
        view: View,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        envs: int = 1,
        targets: Sequence[PlainTarget] | None = None,
        config: ModelConfig | Mapping[str, Any] | None = None,
        model: str | os.PathLike[str] | None = None,
        learn: bool = True,
        predict: bool = True,
        window: int = 1000,
        background: int | None = None,
        bad_observations: BadObservations = "raise",
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        self._targets = None if targets is None else [target_of(t) for t in targets]
        self._config = None if config is None else config_of(config)
        self._file = model
        self._manner = (learn, predict, window, background)
        self._spaces = (observation_space, action_space)
        self._metadata = {name: value for name, value in (metadata or {}).items() if value is not None}
        self._starts: list[Scene] = []
        self.view = view
        self.followers = [Follower(view, bad_observations) for _ in range(envs)]
        self._study: Study | None = None
        if not is_open(view):
            self._open()

    # ------------------------------------------------------------------ following
    def begin(self, firsts: Mapping[int, tuple[Any, Mapping[str, Any]]]) -> None:
        """Take up first observations of episodes, with their infos, by the number of the env.

        Raises
        ------
        ObservationError
            One is no scene, and bad observations aren't skipped.
        """
        if self._study is None:
            self.view = settled(self.view, [observation for observation, _ in firsts.values()])
            for follower in self.followers:
                follower.view = self.view
            self._open()
        for number, (observation, info) in firsts.items():
            scene = self.followers[number].begin(observation, info)
            if scene is not None and len(self._starts) < STARTS:
                self._starts.append(scene)
                # So that model.save, too, writes a file to dream from.
                self.study.model.extra = self.extra()

    def expect(self, before: Scene | None) -> ScenePrediction | None:
        """What the model says will follow; ``None`` where it isn't asked."""
        return None if self._study is None else self._study.expect(before)

    def follow(
        self,
        number: int,
        before: Scene | None,
        prediction: ScenePrediction | None,
        observation: Any,
        info: Mapping[str, Any],
        *,
        reward: Any,
        terminated: bool,
    ) -> StepReport:
        """Take up what a step of an env led to, and learn from it; see `Follower.follow`."""
        follower = self.followers[number]
        transition = follower.follow(
            before, prediction, observation, info, reward=float(reward), terminated=terminated
        )
        return NOTHING if self._study is None else self._study.take_up(transition, prediction)

    # ------------------------------------------------------------------ what was learned
    @property
    def study(self) -> Study:
        """Who learns; `ResetNeeded` where the view wants to see first observations."""
        if self._study is None:
            raise ResetNeeded(
                "whether pairs of numbers are cosine and sine of an angle is decided from the first observation: "
                "call reset() first, or pass view=NumbersView(..., angles=...)"
            )
        return self._study

    @property
    def skipped(self) -> int:
        """How many bad observations were skipped."""
        return sum(follower.skipped for follower in self.followers)

    def close(self) -> None:
        """End the background process, if there is one, once it has learned all."""
        if self._study is not None:
            self._study.close()

    def _open(self) -> None:
        model = model_of(self.view.schema, config=self._config, targets=self._targets, path=self._file)
        learn, predict, window, background = self._manner
        self._study = Study(
            model,
            learn=learn,
            predict=predict,
            window=window,
            precision=self.view.precision,
            background=background,
        )

    # ------------------------------------------------------------------ files
    @property
    def arguments(self) -> dict[str, Any]:
        """Targets, config and file as plain data."""
        return {
            "targets": None if self._targets is None else [target_to_json(t) for t in self._targets],
            "config": None if self._config is None else self._config.to_json(),
            "model": None if self._file is None else os.fspath(self._file),
        }

    @property
    def record(self) -> EnvRecord:
        """What a model file says of the env: spaces and the first scenes of the first episodes."""
        return EnvRecord(*self._spaces, tuple(self._starts), self._metadata)

    def extra(self) -> dict[str, Any]:
        """All that a model file says of the env: its record and its view."""
        return self.record.to_json() | {"view": self.view.to_json()}

    def save(self, path: str | os.PathLike[str], *, history: bool = False) -> None:
        """Write model, spaces, view and some first scenes to one file, atomically."""
        model: WorldModel = self.study.catch_up()
        model.extra = self.extra()
        model.save(path, history=history)
