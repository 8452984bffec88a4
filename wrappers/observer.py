"""What all learning wrappers share: one view, one model, and the envs that it learns from."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeAlias

from gymnasium import spaces
from gymnasium.error import ResetNeeded

from relgym.config import ModelConfig
from relgym.envs.model_files import EnvRecord
from relgym.envs.views import Angle, NumbersView, TaskView, View
from relgym.errors import ConfigError, ObservationError, RelgymError
from relgym.model.files.storage import target_to_json
from relgym.model.predicting.prediction import ScenePrediction
from relgym.model.predicting.prequential import StepReport
from relgym.model.protocol import SceneLearner
from relgym.scene.objects import Scene
from relgym.wrappers.follower import BadObservations, Follower, Look
from relgym.wrappers.settings import PlainTarget, check_model, model_of, targets_of
from relgym.wrappers.study import NOTHING, Study
from relgym.wrappers.views import is_open, remembered, settled, upheld

__all__ = ["STARTS", "First", "Observer", "Step"]

First: TypeAlias = tuple[Any, Mapping[str, Any]]
"""First observation of an episode, and what info came with it."""

STARTS = 16
"""How many first scenes of episodes a model file keeps, for dreams to start from."""


@dataclass(frozen=True, slots=True)
class Step:
    """What one env was told to do, and what it returned.

    Attributes
    ----------
    action
        As `relgym.wrappers.views.readable` says.
    observation, info, reward, terminated
        The step's own, also where the next episode has begun already.
    """

    action: Any
    observation: Any
    info: Mapping[str, Any]
    reward: Any
    terminated: bool


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
        Final after the first observations, unless angles were guessed from them and a later one refutes the guess.
    withdrawn : tuple
        Guessed angles that were refuted. Their numbers are plain numbers since, and all was begun anew: the model, and
        what is counted of it. The step that refutes a guess teaches nothing.
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
        model: SceneLearner | str | os.PathLike[str] | None = None,
        learn: bool = True,
        predict: bool = True,
        window: int = 1000,
        background: int | None = None,
        bad_observations: BadObservations = "raise",
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        self._targets = targets_of(targets)
        self._config = None if config is None else ModelConfig.of(config)
        check_model(model)
        self._given = model
        self._learn = learn
        self._manner = (predict, window, background)
        self._spaces = (observation_space, action_space)
        self._metadata = {name: value for name, value in (metadata or {}).items() if value is not None}
        self._starts: list[Scene] = []
        self.view = view = view if model is None else remembered(view, model)
        names = [""] if envs == 1 else [f"env {k}: " for k in range(envs)]
        self.followers = [Follower(view, bad_observations, name=name) for name in names]
        self.withdrawn: tuple[Angle, ...] = ()
        self._study: Study | None = None
        if not is_open(view):
            self._study = self._begun(view)

    # ------------------------------------------------------------------ following
    def begin(self, firsts: Mapping[int, First]) -> None:
        """Take up first observations of episodes, with their infos, by the number of the env.

        Raises
        ------
        ObservationError
            One is no scene, and bad observations aren't skipped.
        """
        self._regard([observation for observation, _ in firsts.values()])
        for number, first in firsts.items():
            self._take_up_first(number, first, None)

    def expect(self, before: Scene | None) -> ScenePrediction | None:
        """What the model says will follow; ``None`` where it isn't asked."""
        return None if self._study is None else self._study.expect(before)

    def follow(
        self, number: int, before: Scene | None, prediction: ScenePrediction | None, step: Step
    ) -> StepReport:
        """Take up what a step of an env led to, and learn from it; see `Follower.follow`."""
        if self._regard([step.observation]):
            self.followers[number].resume(step.observation, step.info)
            return NOTHING
        return self._learned(number, before, prediction, step, None)

    def follow_all(self, steps: Mapping[int, Step], firsts: Mapping[int, First]) -> dict[int, StepReport]:
        """Take up what a step of several envs led to, one after the other: predict, compare, learn.

        All that they say is looked at before anything is learned, so that a bad observation leaves no half of them.

        Parameters
        ----------
        steps
            By the number of the env.
        firsts
            First observations of those that have begun an episode, after their step or instead of one.

        Raises
        ------
        ObservationError
            One is no scene, and bad observations aren't skipped. The model is unchanged, and no env has a current
            scene: all have stepped, and none may go on from what it saw last.
        """
        seen = [step.observation for step in steps.values()]
        if self._regard([*seen, *(observation for observation, _ in firsts.values())]):
            latest = {k: (step.observation, step.info) for k, step in steps.items()} | dict(firsts)
            for number, (observation, info) in latest.items():
                self.followers[number].resume(observation, info)
            return dict.fromkeys(steps, NOTHING)
        looks, first_looks = self._looked(steps, firsts)
        reports = {}
        for number in sorted({*steps, *firsts}):
            if number in steps:
                before = self.followers[number].act(steps[number].action)
                prediction = self.expect(before)
                reports[number] = self._learned(number, before, prediction, steps[number], looks[number])
            if number in firsts:
                self._take_up_first(number, firsts[number], first_looks[number])
        return reports

    def _looked(
        self, steps: Mapping[int, Step], firsts: Mapping[int, First]
    ) -> tuple[dict[int, Look], dict[int, Look]]:
        """What all envs show, by number: after a step, and at the beginning of an episode."""
        followers = self.followers
        try:
            looks = {
                k: followers[k].look_on(s.observation, s.info, reward=s.reward, terminated=s.terminated)
                for k, s in steps.items()
            }
            first_looks = {k: followers[k].look(*first) for k, first in firsts.items()}
            for number in sorted({*steps, *firsts}):
                for look in (looks.get(number), first_looks.get(number)):
                    followers[number].check(Look() if look is None else look)
        except ObservationError:
            for follower in followers:
                follower.forget()
            raise
        return looks, first_looks

    def _learned(
        self,
        number: int,
        before: Scene | None,
        prediction: ScenePrediction | None,
        step: Step,
        look: Look | None,
    ) -> StepReport:
        follower = self.followers[number]
        follower.skipped += step.action is None
        transition = follower.follow(
            before,
            prediction,
            step.observation,
            step.info,
            reward=step.reward,
            terminated=step.terminated,
            look=look,
        )
        return NOTHING if self._study is None else self._study.take_up(transition, prediction)

    def _take_up_first(self, number: int, first: First, look: Look | None) -> None:
        scene = self.followers[number].begin(*first, look)
        if scene is not None and len(self._starts) < STARTS:
            self._starts.append(scene)
            self.note()

    # ------------------------------------------------------------------ angles
    def _regard(self, observations: Sequence[Any]) -> bool:
        """Settle what first observations decide, and take back what these refute: whether all begins anew."""
        view = self.view
        if self._study is None:
            view = settled(view, observations)
            if is_open(view):  # nothing but bad observations so far
                return False
        for observation in observations:
            view = upheld(view, observation)
        return view is not self.view and self._adopt(view)

    def _adopt(self, view: View) -> bool:
        """See otherwise from now on, with a new model; false, and nothing done, where the old view was asked for."""
        first = self._study is None
        try:
            study = self._begun(view)
        except RelgymError:
            if first:
                raise
            return False  # a file, a target or a feature names the angle, so it is no mere guess
        if self._study is not None:
            self._study.discard()
        old, new = (_angles(v) for v in (self.view, view))
        self.withdrawn += tuple(angle for angle in old if angle not in new)
        self._starts = [view.scene(self.view.observation(scene)) for scene in self._starts]
        self.view, self._study = view, study
        if self._starts:
            self.note()
        for follower in self.followers:
            if first:
                follower.view = view
            else:
                follower.change_view(view)
        return not first

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
    def learning(self) -> bool:
        """Whether transitions are being learned from; `ConfigError` to ask it of a model without history."""
        return self._learn

    @learning.setter
    def learning(self, learn: bool) -> None:
        if self._study is not None:
            self._study.learning = learn
        self._learn = learn

    @property
    def dropped(self) -> int:
        """How many transitions found the queue to the background process full."""
        return 0 if self._study is None else self._study.dropped

    @property
    def skipped(self) -> int:
        """How many bad observations, and unreadable actions, were skipped."""
        return sum(follower.skipped for follower in self.followers)

    def close(self) -> None:
        """End the background process, if there is one, once it has learned all."""
        if self._study is not None:
            self._study.close()

    def _begun(self, view: View) -> Study:
        model = model_of(view.schema, config=self._config, targets=self._targets, given=self._given)
        predict, window, background = self._manner
        return Study(
            model,
            learn=self._learn,
            predict=predict,
            window=window,
            precision=view.precision,
            background=background,
        )

    # ------------------------------------------------------------------ files
    @property
    def arguments(self) -> dict[str, Any]:
        """Targets and config as plain data; the model as a path, or itself if it was given so."""
        return {
            "targets": None if self._targets is None else [target_to_json(t) for t in self._targets],
            "config": None if self._config is None else self._config.to_json(),
            "model": os.fspath(self._given) if isinstance(self._given, (str, os.PathLike)) else self._given,
        }

    @property
    def record(self) -> EnvRecord:
        """What a model file says of the env: spaces and the first scenes of the first episodes."""
        return EnvRecord(*self._spaces, tuple(self._starts), self._metadata)

    def extra(self) -> dict[str, Any]:
        """All that a model file says of the env: its record and its view."""
        return self.record.to_json() | {"view": self.view.to_json()}

    def note(self) -> None:
        """Tell the model of its env, so that its own `save`, too, writes a file to dream from.

        Of a space of somebody's own, which no file can hold, nothing is told.
        """
        with suppress(ConfigError):
            self.study.model.extra = self.extra()

    def save(self, path: str | os.PathLike[str], *, history: bool = False) -> None:
        """Write model, spaces, view and some first scenes to one file, atomically."""
        model = self.study.catch_up()
        model.extra = self.extra()
        model.save(path, history=history)


def _angles(view: View) -> tuple[Angle, ...]:
    state = view.view if isinstance(view, TaskView) else view
    return state.angles if isinstance(state, NumbersView) else ()
