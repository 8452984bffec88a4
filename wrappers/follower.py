"""One env's stream of observations, followed through its episodes and turned into transitions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

from gymnasium.error import ResetNeeded

from relgym.envs.views import View
from relgym.errors import ConfigError, ObservationError
from relgym.model.prediction import ScenePrediction
from relgym.scene.objects import Scene, Transition

__all__ = ["BadObservations", "Follower", "extrapolated"]

BadObservations: TypeAlias = Literal["raise", "skip"]
"""What to do with an observation that shows no scene: raise `ObservationError`, or skip and count it."""


class Follower:
    """Follows one env; nothing is learned across the border of two episodes, nor across a bad observation.

    Parameters
    ----------
    view
        How observations and actions become scenes.
    bad
        What to do with bad observations.

    Attributes
    ----------
    over : bool
        Whether the episode has ended, so that the next observation begins another one.
    skipped : int
        How many bad observations were skipped.
    """

    def __init__(self, view: View, bad: BadObservations = "raise") -> None:
        if bad not in ("raise", "skip"):
            raise ConfigError(f"bad_observations={bad!r}: expected 'raise' or 'skip'")
        self.view = view
        self.over = False
        self.skipped = 0
        self._bad = bad
        self._scene: Scene | None = None
        self._earlier: Scene | None = None

    @property
    def scene(self) -> Scene:
        """The current scene, without an action; `ResetNeeded` before the first reset or after a bad observation."""
        if self._scene is None:
            raise ResetNeeded("no current scene: call reset() first")
        return self._scene

    def forget(self) -> None:
        """The env is about to begin an episode; what was seen so far is no longer current."""
        self._scene = self._earlier = None
        self.over = False

    def begin(self, observation: Any, info: Mapping[str, Any]) -> Scene | None:
        """Take up the first observation of an episode; ``None`` when it was bad and is skipped.

        Raises
        ------
        ObservationError
            It is no scene, and bad observations aren't skipped.
        """
        self.forget()
        self._scene = self._seen(observation, info, None, None)
        return self._scene

    def act(self, action: Any) -> Scene | None:
        """The current scene with a legal action in it; ``None`` when the current observation was skipped.

        Raises
        ------
        ResetNeeded
            There is no current scene, and bad observations aren't skipped.
        """
        if self._scene is None and self._bad == "skip":
            return None
        return self.view.with_action(self.scene, action)

    def follow(
        self,
        before: Scene | None,
        prediction: ScenePrediction | None,
        observation: Any,
        info: Mapping[str, Any],
        *,
        reward: float,
        terminated: bool,
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

        Returns
        -------
        The transition; ``None`` when an observation on either side of it was skipped.

        Raises
        ------
        ObservationError
            It is no scene, and bad observations aren't skipped. There is no current scene then.
        """
        last, expected = self._scene, self._expected(prediction)
        self._scene = None  # until the next observation proves sound
        after = self._seen(observation, info, last, expected)
        self._earlier, self._scene = (None if after is None else last), after
        if before is None or after is None:
            return None
        try:
            return Transition(before, self.view.with_outcome(after, reward, terminated))
        except ObservationError as error:
            self._complain(error)
            return None

    def _expected(self, prediction: ScenePrediction | None) -> Scene | None:
        """Where things should be now: as far on as in the last step, or where modes predict or guess them."""
        if self._scene is None or not self.view.matches:
            return None
        scene = self._scene if self._earlier is None else extrapolated(self._earlier, self._scene)
        if prediction is None:
            return scene
        said = {(p.object, p.property): p.value for p in prediction.parts if p.informed and p.object in scene}
        return scene.replace(said) if said else scene

    def _seen(
        self, observation: Any, info: Mapping[str, Any], last: Scene | None, expected: Scene | None
    ) -> Scene | None:
        try:
            return self.view.scene(observation, info, last=last, expected=expected)
        except ObservationError as error:
            self._complain(error)
            return None

    def _complain(self, error: ObservationError) -> None:
        if self._bad == "skip":
            self.skipped += 1
            return
        raise ObservationError(
            f"{error} (the env has moved on, the model is unchanged: call reset() to begin anew, or skip and count "
            "such observations with bad_observations='skip')"
        ) from error


def extrapolated(earlier: Scene, now: Scene) -> Scene:
    """The scene to come if every number changed as it did in the last step; new objects stay as they are."""
    if earlier.layout is now.layout:
        return Scene(now.schema, now.layout, 2.0 * now.vector - earlier.vector)
    vector = now.vector.copy()
    for index, name in enumerate(now.layout.names):
        if name in earlier:
            vector[now.layout.slice(index)] += now[name].values - earlier[name].values
    return Scene(now.schema, now.layout, vector)
