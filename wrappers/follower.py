"""One env's stream of observations, followed through its episodes and turned into transitions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import gymnasium as gym
from gymnasium.error import ResetNeeded

from relgym.envs.views import View
from relgym.errors import ConfigError, ObservationError, ShapeError
from relgym.model.predicting.prediction import ScenePrediction
from relgym.scene.objects import Scene, Transition
from relgym.scene.sizes import check_sizes

__all__ = ["BadObservations", "Follower", "Look", "extrapolated", "scenes_of"]

BadObservations: TypeAlias = Literal["raise", "skip"]
"""What to do with an observation that shows no scene: raise `ObservationError`, or skip and count it."""


@dataclass(slots=True)  # not frozen: made in every step
class Look:
    """What an observation shows, before anything follows from it.

    Attributes
    ----------
    scene
        The scene; ``None`` where it shows none.
    outcome
        The scene with what the step brought (`View.with_outcome`).
    trouble
        Why one of the two is missing.
    """

    scene: Scene | None = None
    outcome: Scene | None = None
    trouble: ObservationError | ShapeError | None = None


class Follower:
    """Follows one env; nothing is learned across the border of two episodes, nor across a bad observation.

    Parameters
    ----------
    view
        How observations and actions become scenes.
    bad
        What to do with bad observations.
    name
        What errors call the env; empty where there is only one.

    Attributes
    ----------
    over : bool
        Whether the episode has ended, so that the next observation begins another one.
    skipped : int
        How many bad observations, and unreadable actions, were skipped.
    """

    def __init__(self, view: View, bad: BadObservations = "raise", *, name: str = "") -> None:
        if bad not in ("raise", "skip"):
            raise ConfigError(f"bad_observations={bad!r}: expected 'raise' or 'skip'")
        self.view = view
        self.over = False
        self.skipped = 0
        self._bad = bad
        self._name = name
        self._scene: Scene | None = None
        self._earlier: Scene | None = None
        self._between_views = False

    @property
    def scene(self) -> Scene:
        """The current scene, without an action; `ResetNeeded` before the first reset or after a bad observation."""
        if self._scene is None:
            raise ResetNeeded("no current scene: call reset() first")
        return self._scene

    def forget(self) -> None:
        """The env is about to begin an episode; what was seen so far is no longer current."""
        self._scene = self._earlier = None
        self._between_views = self.over = False

    def change_view(self, view: View) -> None:
        """See otherwise from the next observation on; until then there is no current scene, and no reset is needed."""
        self.view = view
        self._scene = self._earlier = None
        self._between_views = True

    # ------------------------------------------------------------------ looking changes nothing
    def look(self, observation: Any, info: Mapping[str, Any]) -> Look:
        """What the first observation of an episode shows."""
        return self._look(observation, info, None, None)

    def look_on(
        self,
        observation: Any,
        info: Mapping[str, Any],
        *,
        reward: Any,
        terminated: bool,
        prediction: ScenePrediction | None = None,
    ) -> Look:
        """What the observation after a step shows; arguments as of `follow`."""
        look = self._look(observation, info, self._scene, self._expected(prediction))
        if look.scene is None:
            return look
        try:
            return Look(look.scene, self.view.with_outcome(look.scene, reward, terminated))
        except ObservationError as error:
            return Look(look.scene, trouble=error)

    def check(self, look: Look) -> None:
        """Raise `ObservationError` where a look shows something bad that isn't to be skipped."""
        if look.trouble is not None and self._bad == "raise":
            raise ObservationError(
                f"{self._name}{look.trouble} (the env has moved on, the model is unchanged: call reset() to begin "
                "anew, or skip and count such observations with bad_observations='skip')"
            ) from look.trouble

    # ------------------------------------------------------------------ following
    def begin(self, observation: Any, info: Mapping[str, Any], look: Look | None = None) -> Scene | None:
        """Take up the first observation of an episode; ``None`` when it was bad and is skipped.

        Raises
        ------
        ObservationError
            It is no scene, and bad observations aren't skipped.
        """
        self.forget()
        return self.resume(observation, info, look)

    def resume(self, observation: Any, info: Mapping[str, Any], look: Look | None = None) -> Scene | None:
        """Take up an observation as if it were the first one, in the midst of an episode; see `begin`."""
        look = self.look(observation, info) if look is None else look
        self._between_views = False
        self._earlier, self._scene = None, look.scene
        self._heed(look)
        return self._scene

    def act(self, action: Any) -> Scene | None:
        """The current scene with an action in it.

        Parameters
        ----------
        action
            What the view can read (`relgym.wrappers.views.readable`), or ``None``.

        Returns
        -------
        ``None`` when the action can't be read, or the current observation was skipped.

        Raises
        ------
        ResetNeeded
            There is no current scene, and bad observations aren't skipped.
        """
        if self._scene is None and (self._bad == "skip" or self._between_views):
            return None
        scene = self.scene
        return None if action is None else self.view.with_action(scene, action)

    def follow(
        self,
        before: Scene | None,
        prediction: ScenePrediction | None,
        observation: Any,
        info: Mapping[str, Any],
        *,
        reward: Any,
        terminated: bool,
        look: Look | None = None,
    ) -> Transition | None:
        """Take up the observation after a step.

        Parameters
        ----------
        before
            What `act` returned.
        prediction
            What the model expected, if it was asked; helps to recognise objects that have no names.
        observation, info, reward, terminated
            What the env returned.
        look
            What `look_on` said of them, if it was asked already.

        Returns
        -------
        The transition; ``None`` when an observation on either side of it was skipped.

        Raises
        ------
        ObservationError
            It is no scene, and bad observations aren't skipped. There is no current scene then.
        """
        if look is None or self.view.matches:  # a match may depend on what was predicted
            look = self.look_on(
                observation, info, reward=reward, terminated=terminated, prediction=prediction
            )
        last, self._scene = self._scene, look.scene
        self._earlier = None if look.scene is None else last
        self._between_views = False
        self._heed(look)
        return None if before is None or look.outcome is None else Transition(before, look.outcome)

    def _expected(self, prediction: ScenePrediction | None) -> Scene | None:
        """Where things should be now: as far on as in the last step, or where modes predict or guess them."""
        if self._scene is None or not self.view.matches:
            return None
        scene = self._scene if self._earlier is None else extrapolated(self._earlier, self._scene)
        if prediction is None:
            return scene
        said = {(p.object, p.property): p.value for p in prediction.parts if p.informed and p.object in scene}
        return scene.replace(said) if said else scene

    def _look(
        self, observation: Any, info: Mapping[str, Any], last: Scene | None, expected: Scene | None
    ) -> Look:
        try:
            scene = self.view.scene(observation, info, last=last, expected=expected)
            if scene.layout.bodies:
                check_sizes(scene)
        except (ObservationError, ShapeError) as error:
            return Look(trouble=error)
        return Look(scene)

    def _heed(self, look: Look) -> None:
        self.check(look)
        self.skipped += look.trouble is not None


def extrapolated(earlier: Scene, now: Scene) -> Scene:
    """The scene to come if every number changed as it did in the last step; new objects stay as they are."""
    if earlier.layout is now.layout:
        return Scene(now.schema, now.layout, 2.0 * now.vector - earlier.vector)
    vector = now.vector.copy()
    for index, name in enumerate(now.layout.names):
        if name in earlier:
            vector[now.layout.slice(index)] += now[name].values - earlier[name].values
    return Scene(now.schema, now.layout, vector)


def scenes_of(env: gym.Env[Any, Any], view: View, steps: int, *, seed: int) -> Iterator[Scene]:
    """Scenes of an env under random actions, each with the action that is taken there.

    Parameters
    ----------
    env, view
        The env, and how it is looked at.
    steps
        How many.
    seed
        Of the first episode and of the actions.
    """
    follower = Follower(view)
    env.action_space.seed(seed)
    observation, info = env.reset(seed=seed)
    follower.begin(observation, info)
    for _ in range(steps):
        action = env.action_space.sample()
        scene = follower.act(action)
        assert scene is not None, "bad observations and actions raise"
        yield scene
        observation, reward, terminated, truncated, info = env.step(action)
        follower.follow(scene, None, observation, info, reward=reward, terminated=terminated)
        if terminated or truncated:
            observation, info = env.reset()
            follower.begin(observation, info)
