"""A learned model as a Gymnasium env: agents train and planners search inside what was learned."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from relgym.envs.actions import acting, check_action_space, without_action
from relgym.envs.arguments import check_options, checked_action, checked_count
from relgym.envs.model_files import EnvRecord, world_like
from relgym.errors import ConfigError, ObservationError
from relgym.model.prediction import ScenePrediction
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, Scene

__all__ = ["Judge", "LearnedModelEnv"]

Judge: TypeAlias = Callable[[Scene, Any, Scene], float]
"""A function of the scene before, the action taken and the scene after; the scenes hold no action object."""


class LearnedModelEnv(gym.Env[Any, Any]):
    """Dreams: the transitions are a learned model's predictions.

    Description
    -----------
    Has the spaces and the schema of the env that the model was learned in. Every step asks the model for the
    next scene. Where it has no answer the episode is truncated and ``info["reason"]`` says why: a dream never
    goes on by guessing. Exogenous properties keep their values.

    The model is used as it is, live: what it learns later changes the dream. For a snapshot pass
    ``copy.deepcopy(model)``.

    Action Space
    ------------
    The real env's; the action object gets the same physical units.

    Observation Space
    -----------------
    The real env's: ``Dict``, object name -> ``Box``.

    Rewards
    -------
    `reward` of (scene, action, next scene); 0 without one, and 0 for a step that the model couldn't predict.

    Starting State
    --------------
    Reset option ``scene``: a `Scene`. Otherwise what `start` draws; otherwise a reset of `like`, which takes
    the seed and all other options, so that the dream begins as the real env would; otherwise one of the first
    scenes that the learner saw. A dream resets a copy of `like`: the real episode goes on undisturbed.

    Episode End
    -----------
    Terminated when `terminated` of (scene, action, next scene) is true. Truncated when no mode can predict
    some property, or when the next scene lies outside the observation space: then the dream stays in the last
    scene that is known. Truncated too after `horizon` steps.

    Info
    ----
    ``info["prediction"]``: the model's `ScenePrediction`. ``info["reason"]``: a sentence, if truncated. At
    reset ``info["scene"]``.

    Arguments
    ---------
    model
        A `WorldModel`, or the path of the file of one that a `ModelLearner` taught.
    like
        A real env with the model's schema: gives the spaces, and start scenes. Wrappers around it are looked
        through. Not needed where a `ModelLearner` taught the model.
    reward, terminated
        Functions of (scene, action, next scene); none: 0 and false.
    start
        Function of a random generator that returns a start scene.
    horizon
        Longest episode in steps, >= 1; none: no limit.
    render_mode
        ``None``, ``"rgb_array"`` or ``"human"``.

    Version History
    ---------------
    * v0: initial version.
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
        horizon: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ConfigError(
                f"render_mode={render_mode!r}: expected None or one of {self.metadata['render_modes']}"
            )
        if not isinstance(model, WorldModel):
            model = WorldModel.load(model)
        self.model = model
        self.schema = model.schema
        self.render_mode = render_mode
        self._world = None if like is None else world_like(like, model.schema)
        record = _record(self._world, model)
        self.observation_space, self.action_space = record.observation_space, record.action_space
        self.metadata = {**self.metadata, "render_fps": record.metadata.get("render_fps", 50)}
        self._low, self._high = _bounds(record.observation_space)
        self._starts = record.starts
        self._reward, self._terminated, self._start = reward, terminated, start
        self._horizon = None if horizon is None else checked_count("horizon", horizon, 1, 10**9)
        self._scene: Scene | None = None
        self._steps = 0
        self._viewer: Any = None

    # ------------------------------------------------------------------ the Gymnasium contract
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin a dream; see *Starting State* for `options`.

        Raises
        ------
        ConfigError
            An unknown option, or nothing to begin with.
        ObservationError
            The start scene isn't one of this world, or lies outside the observation space.
        """
        super().reset(seed=seed)
        self._scene = self._fitted(self._first(seed, options or {}))
        self._steps = 0
        if self.render_mode == "human":
            self.render()
        return self._observation(), {"scene": self._scene}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Predict one step; `ActionError` when `action` lies outside the action space."""
        before = self.scene
        taken = checked_action(self.action_space, action)
        prediction = self.model.predict_one(acting(before, taken))
        after = without_action(prediction.scene)
        self._steps += 1
        info: dict[str, Any] = {"prediction": prediction}
        if (reason := self._failure(prediction, after)) is not None:
            return self._observation(), 0.0, False, True, {**info, "reason": reason}
        self._scene = after
        reward = 0.0 if self._reward is None else float(self._reward(before, taken, after))
        ended = self._terminated is not None and bool(self._terminated(before, taken, after))
        late = self._horizon is not None and self._steps >= self._horizon
        if late:
            info["reason"] = f"the horizon of {self._horizon} steps is reached"
        if self.render_mode == "human":
            self.render()
        return self._observation(), reward, ended, late, info

    def render(self) -> Any:
        """Draw the scene: as an array of shape (height, width, 3), or in a window for ``"human"``."""
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

    @property
    def scene(self) -> Scene:
        """The current scene, without an action."""
        if self._scene is None:
            raise ResetNeeded("the dream has not begun: call reset() first")
        return self._scene

    # ------------------------------------------------------------------ where dreams begin
    def _first(self, seed: int | None, options: Mapping[str, Any]) -> Scene:
        if "scene" in options or self._start is not None or self._world is None:
            check_options(options, ("scene",))
        if "scene" in options:
            given: Scene = options["scene"]
            return given
        if self._start is not None:
            return self._start(self.np_random)
        if self._world is not None:
            return self._real_start(seed, options)
        if not self._starts:
            raise ConfigError(
                "nothing says where a dream begins: pass options={'scene': scene} to reset, or start=function or "
                "like=env to the env"
            )
        return self._starts[int(self.np_random.integers(len(self._starts)))]

    def _real_start(self, seed: int | None, options: Mapping[str, Any]) -> Scene:
        assert self._world is not None, "asked only where there is a real env"
        # A seed passes through, so that equal seeds begin equally; without one the dream's own draws decide.
        chosen = int(self.np_random.integers(2**31)) if seed is None else seed
        observation, _ = self._world.reset(seed=chosen, options=dict(options))
        return self.schema.scene(observation)

    def _fitted(self, scene: Scene) -> Scene:
        """A copy of the scene without an action, checked against schema and observation space."""
        if not isinstance(scene, Scene):
            raise ObservationError(
                f"expected a start scene, got {type(scene).__name__}; take env.scene, or schema.scene(observation)"
            )
        # Through the model's own schema: scenes of an equal one, or of another with the same objects, do too.
        fitted = self.schema.scene({name: v for name, v in scene.values().items() if name != ACTION})
        names = sorted(self._boxes().spaces)
        if sorted(fitted.layout.names) != names:
            raise ObservationError(
                f"a dream can't begin here: expected the objects {names}, got {list(fitted.layout.names)}"
            )
        if outside := self._outside(fitted):
            raise ObservationError(f"a dream can't begin here: {outside}")
        return fitted

    # ------------------------------------------------------------------ helpers
    def _failure(self, prediction: ScenePrediction, after: Scene) -> str | None:
        """Why a prediction can't be followed; None if it can."""
        if not prediction.ok:
            parts = (part for part in prediction.parts if not part.ok)
            return "; ".join(f"{part.object}.{part.property}: {part.outcome.value}" for part in parts)
        return self._outside(after) or None

    def _outside(self, scene: Scene) -> str:
        """Which properties left the observation space, as a sentence; empty if none did."""
        layout = scene.layout
        low, high = (
            np.concatenate([ends[name] for name in layout.names]) for ends in (self._low, self._high)
        )
        inside = (low <= scene.vector) & (scene.vector <= high)
        if inside.all():
            return ""
        names = [f"{o.name}.{prop}" for o in scene for prop in o.type.properties]
        left = (
            f"{names[k]} = {scene.vector[k]:g} left the observation space [{low[k]:g}, {high[k]:g}]"
            for k in np.flatnonzero(~inside)
        )
        return "; ".join(left)

    def _boxes(self) -> spaces.Dict:
        assert isinstance(self.observation_space, spaces.Dict), "checked when made"
        return self.observation_space

    def _observation(self) -> dict[str, NDArray[Any]]:
        # In schema order, as the real env's; the Dict space sorts its keys.
        boxes = self._boxes().spaces
        return {o.name: o.values.astype(boxes[o.name].dtype) for o in self.scene}


def _record(world: gym.Env[Any, Any] | None, model: WorldModel) -> EnvRecord:
    """What is known of the real env, checked against the model's schema."""
    if world is not None:
        metadata = {"render_fps": world.metadata.get("render_fps", 50)}
        record = EnvRecord(world.observation_space, world.action_space, metadata=metadata)
    elif model.extra:
        record = EnvRecord.from_json(model.extra, model.schema)
    else:
        raise ConfigError(
            "the model holds no spaces: pass like=env, or learn it with a ModelLearner around an env"
        )
    check_action_space(model.schema, record.action_space)
    return record


def _bounds(space: spaces.Space[Any]) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """Smallest and largest values by object; `ConfigError` unless the space is a Dict of flat Boxes."""
    parts = space.spaces if isinstance(space, spaces.Dict) else {}
    boxes = {name: part for name, part in parts.items() if isinstance(part, spaces.Box)}
    if not boxes or len(boxes) != len(parts):
        raise ConfigError(
            f"expected a Dict observation space, object name -> Box, got {space}; wrap the dream as the env was"
        )
    return {name: box.low for name, box in boxes.items()}, {name: box.high for name, box in boxes.items()}
