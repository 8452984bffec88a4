"""What lies between scenes and an agent: wrappers that show it observations and pass on its actions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, TypeAlias

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.envs.dreams.shown import Boxes, ViewDeeds, is_plain, shown_at_once
from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import Float2D, Scene, SceneLayout
from relgym.wrappers.dyna.acting import acting_all
from relgym.wrappers.dyna.recorder import TransitionRecorder

__all__ = ["Lens", "Observations", "picked"]

Observations: TypeAlias = NDArray[Any] | dict[str, NDArray[Any]]
"""n observations: an array, or for Dict spaces one per key, each with n rows."""

_REWARDING: Final = (gym.RewardWrapper, gym.wrappers.NormalizeReward)


class Lens:
    """Sees scenes as an agent does, and translates what it does into actions of the bare env.

    Parameters
    ----------
    env
        The env that the agent acts in, in all its wrappers, a `TransitionRecorder` among them. Wrappers that
        leave the spaces as they are (time limits, monitors) are looked through; of the others those count
        that are a `gymnasium.ObservationWrapper` or a `gymnasium.ActionWrapper`, whose functions are asked, and
        action repeats (an attribute ``repeat``, or ``num_repeats`` of a `gymnasium.wrappers.RepeatAction`).

    Attributes
    ----------
    recorder : TransitionRecorder
        The recorder.
    repeat : int
        Env steps that one decision of the agent lasts.

    Raises
    ------
    ConfigError
        No recorder; one of an env whose actions are a Dict or a Tuple; or outside it a wrapper that changes rewards,
        or a space in a way that can't be computed for predicted scenes, or that depends on earlier steps
        (`gymnasium.wrappers.DelayObservation`).
    """

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        self.observation_space, self.action_space = env.observation_space, env.action_space
        self.repeat = 1
        self._show: list[Any] = []
        self._do: list[Any] = []
        layer: Any = env
        while not isinstance(layer, TransitionRecorder):
            if not isinstance(layer, gym.Wrapper):
                raise ConfigError(
                    f"{env} has no TransitionRecorder: put one directly round the bare env, inside all wrappers "
                    "that change observations or actions"
                )
            self._take_up(layer)
            layer = layer.env
        self.recorder = layer
        if isinstance(layer.action_space, (spaces.Dict, spaces.Tuple)):
            raise ConfigError(
                f"the recorded env's actions are of {layer.action_space}, and predicted scenes take flat ones, many at "
                "once: put gymnasium.wrappers.TransformAction(env, function, space) inside the TransitionRecorder, "
                "where the space is flat and the function makes the env's action of one of its actions"
            )
        self._show.reverse()
        self._view, self._base = layer.view, layer.observation_space
        self._plain = is_plain(self._view)
        base: Any = (
            self._base if self._plain else spaces.Dict()
        )  # if plain, of Boxes, as the view has checked
        self._boxes = Boxes(base.spaces)

    def _take_up(self, layer: gym.Wrapper[Any, Any, Any, Any]) -> None:
        gymnasiums = isinstance(layer, getattr(gym.wrappers, "RepeatAction", ()))  # since 1.3
        own = vars(layer).get("num_repeats" if gymnasiums else "repeat")
        if isinstance(layer, _REWARDING):
            raise ConfigError(
                f"{type(layer).__name__} changes rewards outside the TransitionRecorder, where dreams would "
                "get other rewards: put it inside, and pass reward_model='learned' or a reward model that does the same"
            )
        if isinstance(own, int):
            self.repeat *= own
        elif isinstance(layer, gym.ObservationWrapper | gym.ActionWrapper):
            _refuse_memory(layer)
            (self._show if isinstance(layer, gym.ObservationWrapper) else self._do).append(layer)
        elif (layer.observation_space, layer.action_space) != (
            layer.env.observation_space,
            layer.env.action_space,
        ):
            raise ConfigError(
                f"{type(layer).__name__} changes a space, and a dream can't do the same: make it a "
                "gymnasium.ObservationWrapper or ActionWrapper, or put it inside the TransitionRecorder"
            )

    def observations(self, layout: SceneLayout, vectors: Float2D) -> Observations:
        """What the agent sees of n scenes, with the dtypes of its observation space."""
        batched = self._plain and self._show and hasattr(self._show[0], "flattener")
        seen = self._show[0].flattener(layout, vectors) if batched else self._raw(layout, vectors)
        with _still(self._show):
            for layer in self._show[1:] if batched else self._show:
                seen = _stacked([layer.observation(picked(seen, k)) for k in range(len(vectors))])
        return self._cast(seen)

    def acting(
        self, layout: SceneLayout, vectors: Float2D, actions: NDArray[Any]
    ) -> tuple[SceneLayout, NDArray[np.float64]]:
        """Layout and state vectors of n scenes with actions of the bare env in them, as that env understands these."""
        if self._plain:
            return acting_all(self._view.schema, layout, vectors, actions)
        deeds = ViewDeeds(self._view, layout, self.recorder.action_space)
        return deeds.layout, deeds.joined(vectors, actions)

    def actions(self, actions: NDArray[Any]) -> NDArray[Any]:
        """Actions of the bare env for n actions of the agent."""
        for layer in self._do:
            actions = np.stack([np.asarray(layer.action(action)) for action in actions])
        return actions

    def inside(self, layout: SceneLayout, vectors: Float2D) -> NDArray[np.bool_]:
        """Which of n scenes lie in the bare env's observation space."""
        if not self._plain:
            if (found := shown_at_once(self._view, layout, vectors)) is not None:
                return found[1]
            return np.array([self._shows(scene) for scene in self._scenes(layout, vectors)], dtype=np.bool_)
        return self._boxes.inside(layout, vectors)

    def _shows(self, scene: Scene) -> bool:
        try:
            return bool(self._base.contains(self._view.observation(scene)))
        except ObservationError:  # numbers that the space's dtype can't hold
            return False

    def _scenes(self, layout: SceneLayout, vectors: Float2D) -> Iterator[Scene]:
        return (Scene(self._view.schema, layout, vector.copy()) for vector in vectors)

    def _raw(self, layout: SceneLayout, vectors: Float2D) -> Observations:
        if not self._plain:
            found = shown_at_once(self._view, layout, vectors)
            if found is not None and isinstance(found[0], (np.ndarray, dict)):
                return found[0]
            return _stacked([self._view.observation(scene) for scene in self._scenes(layout, vectors)])
        return self._boxes.shown(layout, vectors)

    def _cast(self, seen: Observations) -> Observations:
        if isinstance(seen, dict):
            parts = self.observation_space.spaces if isinstance(self.observation_space, spaces.Dict) else {}
            return {key: seen[key].astype(part.dtype, copy=False) for key, part in parts.items()}
        return seen.astype(self.observation_space.dtype or seen.dtype, copy=False)


def _refuse_memory(layer: gym.Wrapper[Any, Any, Any, Any]) -> None:
    """Raise `ConfigError` for a wrapper that keeps what happens in an episode: it would mix up dreams and the world.

    A wrapper without memory needs no `reset` of its own.
    """
    base = gym.ObservationWrapper if isinstance(layer, gym.ObservationWrapper) else gym.ActionWrapper
    if type(layer).reset is not base.reset:
        raise ConfigError(
            f"{type(layer).__name__} keeps count of the real episode (it has a reset of its own), and a dream "
            "can't do the same: put it inside the TransitionRecorder"
        )


def picked(seen: Observations, which: Any) -> Any:
    """The observation of that number; with an array of numbers, those observations."""
    if isinstance(seen, dict):
        return {key: part[which] for key, part in seen.items()}
    return seen[which]


def _stacked(seen: list[Any]) -> Observations:
    if isinstance(seen[0], Mapping):
        return {key: np.stack([np.asarray(one[key]) for one in seen]) for key in seen[0]}
    return np.stack([np.asarray(one) for one in seen])


@contextmanager
def _still(layers: list[Any]) -> Iterator[None]:
    """Keep wrappers that learn from observations, such as NormalizeObservation, from learning from imagined ones."""
    learning = [layer for layer in layers if getattr(layer, "update_running_mean", False)]
    for layer in learning:
        layer.update_running_mean = False
    try:
        yield
    finally:
        for layer in learning:
            layer.update_running_mean = True
