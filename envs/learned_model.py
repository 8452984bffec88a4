"""A learned model as a Gymnasium env: agents train and planners search inside what was learned."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded

from relgym.envs.arguments import check_options, checked_action, physical_action
from relgym.envs.base import Observation
from relgym.envs.spaces_json import space_from_json
from relgym.errors import ConfigError
from relgym.model.world_model import WorldModel, with_action
from relgym.scene.objects import ACTION, Scene

__all__ = ["LearnedModelEnv"]

Judge: TypeAlias = Callable[[Scene, Any, Scene], float]
"""A function of the scene before, the action and the scene after."""

LEFT = "left the observation space"
"""`info["reason"]` when a predicted scene has no place among the observations."""


class LearnedModelEnv(gym.Env[Observation, Any]):
    """Dreams: the transitions are a learned model's predictions.

    Description
    -----------
    Has the spaces of the env that the model was learned in. Every step asks the model for the next scene. Where no
    mode can answer, the episode is truncated and ``info["reason"]`` says why: a dream never goes on by guessing.

    Action Space
    ------------
    The real env's.

    Observation Space
    -----------------
    The real env's.

    Rewards
    -------
    `reward` of (scene, action, next scene); 0 without one.

    Starting State
    --------------
    Reset option ``scene``: a `Scene`. Otherwise what `start` draws; otherwise a reset of `like`; otherwise one of the
    start scenes that the model's file holds.

    Episode End
    -----------
    Terminated when `terminated` of (scene, action, next scene) is true. Truncated when the model leaves what it knows
    or the observation space, with ``info["reason"]``.

    Arguments
    ---------
    model
        A `WorldModel` (used as it is, live: what it learns later changes the dream), or the path of a file written by
        `ModelLearner.save`.
    like
        A real env: gives the spaces, and start scenes. Not needed with a file.
    reward, terminated
        Functions of (scene, action, next scene).
    start
        Function of a random generator that returns a start scene.
    render_mode
        ``None``, ``"rgb_array"`` or ``"human"``.

    Version History
    ---------------
    v0: first version.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        model: WorldModel | str | os.PathLike[str],
        like: gym.Env[Any, Any] | None = None,
        *,
        reward: Judge | None = None,
        terminated: Judge | None = None,
        start: Callable[[np.random.Generator], Scene] | None = None,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ConfigError(
                f"render_mode={render_mode!r}: expected None or one of {self.metadata['render_modes']}"
            )
        extra: Mapping[str, Any] = {}
        if not isinstance(model, WorldModel):
            model, extra = WorldModel.load_with_extra(model)
        self.model = model
        self.schema = model.schema
        self.render_mode = render_mode
        self._like = like
        self._reward, self._terminated, self._start = reward, terminated, start
        self._starts = [self.schema.scene(values) for values in extra.get("starts", ())]
        self.observation_space, self.action_space = _spaces(like, extra)
        if like is None and start is None and not self._starts:
            raise ConfigError("where does a dream begin? pass like=env or start=function: the model holds no scenes")
        self._scene: Scene | None = None
        self._viewer: Any = None

    @property
    def scene(self) -> Scene:
        """The current scene."""
        if self._scene is None:
            raise ResetNeeded("the dream has not begun: call reset() first")
        return self._scene

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a dream; option ``scene``: where."""
        super().reset(seed=seed)
        check_options(options or {}, ("scene",))
        given = (options or {}).get("scene")
        self._scene = self._completed(given if given is not None else self._first(seed))
        if self.render_mode == "human":
            self.render()
        return self._observe(self._scene), {"scene": self._scene}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Predict one step; `ActionError` when `action` lies outside the action space."""
        taken = checked_action(self.action_space, action)
        before = self.scene
        if ACTION in before:
            before = with_action(before, physical_action(self.schema, taken))
        prediction = self.model.predict_one(before)
        after = prediction.scene
        info: dict[str, Any] = {}
        failed = next((part for part in prediction.parts if not part.ok), None)
        if failed is not None:
            info["reason"] = f"{failed.object}.{failed.property}: {failed.outcome.value}"
        elif not self.observation_space.contains(self._observe(after)):
            info["reason"] = LEFT
        if info:
            after = before  # the last scene that is known
        self._scene = after
        reward = 0.0 if self._reward is None else float(self._reward(before, action, after))
        ended = self._terminated is not None and bool(self._terminated(before, action, after))
        if self.render_mode == "human":
            self.render()
        return self._observe(after), reward, ended, bool(info), info

    def render(self) -> Any:
        """Draw the scene as the real env would."""
        from relgym.envs.rendering import SceneViewer

        if self.render_mode is None:
            raise ConfigError("nothing to render to: make the env with render_mode='rgb_array' or 'human'")
        if self._viewer is None:
            self._viewer = SceneViewer(self.render_mode, fps=self.metadata["render_fps"])
        return self._viewer.show(self.scene)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _first(self, seed: int | None) -> Scene:
        if self._start is not None:
            return self._start(self.np_random)
        if self._like is not None:
            self._like.reset(seed=int(self.np_random.integers(2**31)) if seed is None else seed)
            scene: Scene = self._like.get_wrapper_attr("scene")
            return scene
        return self._starts[int(self.np_random.integers(len(self._starts)))]

    def _completed(self, scene: Scene) -> Scene:
        """The scene with an action object, if the schema has one and it is missing."""
        if ACTION not in self.schema.order or ACTION in scene:
            return scene
        width = len(self.schema.type_of(ACTION).properties)
        return self.schema.scene({**scene.values(), ACTION: np.zeros(width)})

    def _observe(self, scene: Scene) -> Observation:
        return {o.name: o.values.copy() for o in scene if o.type.has_body}


def _spaces(
    like: gym.Env[Any, Any] | None, extra: Mapping[str, Any]
) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
    if like is not None:
        return like.observation_space, like.action_space
    if "observation_space" not in extra:
        raise ConfigError("the model holds no spaces: pass like=env, or save it with ModelLearner.save")
    return space_from_json(extra["observation_space"]), space_from_json(extra["action_space"])
