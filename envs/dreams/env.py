"""A learned model as a Gymnasium env: agents train and planners search inside what was learned."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from typing import Any, Literal

import gymnasium as gym
from gymnasium.error import ResetNeeded

from relgym.arguments import refusing
from relgym.envs.actions import without_action
from relgym.envs.arguments import (
    check_options,
    checked_action,
    checked_count,
    checked_function,
    checked_least,
    checked_options,
)
from relgym.envs.dreams.ends import Cause, explained, horizon_reached, parts_of
from relgym.envs.dreams.rewards import (
    SceneFunction,
    StepEvaluator,
    TaskFunctions,
    check_reward_functions,
    marked,
)
from relgym.envs.dreams.setting import Setting, check_knowledge
from relgym.envs.dreams.starts import Start
from relgym.envs.views import View
from relgym.errors import ConfigError
from relgym.model.predicting.prediction import ScenePrediction
from relgym.model.protocol import SceneLearner
from relgym.scene.objects import TASK, Scene
from relgym.scene.schema import SceneSchema

__all__ = ["LearnedModelEnv", "SceneFunction"]


class LearnedModelEnv(gym.Env[Any, Any]):
    """Dreams: the transitions are a learned model's predictions.

    Description
    -----------
    Has the spaces of the env that the model was learned in, and its schema if that has one. Every step asks the model
    for the next scene. Where it has no answer the episode is truncated and ``info["reason"]`` says why: a dream never
    goes on by guessing. Exogenous properties keep their values.

    The model is used as it is, live: what it learns later changes the dream; what steps are worth is settled anew
    at each reset. With ``snapshot=True`` the dream has a copy of its own, and stays as it was.

    Thousands of dreams at once: `LearnedModelVectorEnv`, which ``gym.make_vec`` makes of the same id.

    Action Space
    ------------
    The real env's; the action object gets the same physical units.

    Observation Space
    -----------------
    The real env's: ``Dict``, object name -> ``Box``.

    Rewards
    -------
    `reward` of (scene, action, next scene), or the task's; else what the model has learned of ``task.reward``; else
    0. Always 0 for a step that the model couldn't predict.

    Starting State
    --------------
    Reset option ``scene``: a `Scene`. Otherwise what `start` draws; otherwise a reset of `like`, which takes
    the seed and all other options, so that the dream begins as the real env would; otherwise one of the first
    scenes that the learner saw. A dream resets a copy of `like`: the real episode goes on undisturbed.

    Episode End
    -----------
    Terminated when `terminated` of (scene, action, next scene) is true, or the task says so; else when the model has
    learned ``task.terminated`` and predicts more than 0.5. Truncated when no mode can predict some property, when
    one is predicted by a margin below `min_margin`, or when the next scene lies outside the observation space: then
    the dream stays in the last scene that is known. Truncated too after `horizon` steps.

    Info
    ----
    ``info["prediction"]``: the model's `ScenePrediction`. If truncated, ``info["reason"]``: a sentence, and
    ``info["cause"]``: the name of the `Cause` in lower case. If the task tells success: ``info["is_success"]``. At
    reset ``info["scene"]``.

    Arguments
    ---------
    model
        A `WorldModel` or another learner of scenes, or the path of the file of one that a `ModelLearner` taught.
    like
        A real env whose scenes consist of types that the model knows: gives the spaces, first scenes, and its task
        if it has one. Numbers and names of objects may differ from those that the model was trained on. Wrappers
        around it are looked through; where the model was learned through a view, those outside the spaces that it
        was learned in. Or a `Scene`: its objects get the bounds of their types, and dreams begin with
        it. Not needed where a `ModelLearner` taught the model.
    view
        The view that the model was learned through (`relgym.envs.views`). Needed only for a `FunctionView`, which no
        file can hold. Reward and termination that were learned beside it are seen to.
    reward, terminated
        Functions of (scene, action, next scene), or ``"learned"``: as the model predicts ``task.reward`` and
        ``task.terminated``. None: see above.
    task
        An object with functions `reward` and `terminated`: the ``task`` of another env, say, or a
        `relgym.wrappers.sb3.LearnedRewardModel`. Default: that of `like`; a file holds none.
    start
        Function of a random generator that returns a start scene.
    horizon
        Longest episode in steps, >= 1; none: no limit.
    min_margin
        Predictions that lead the runners-up by less, in log-odds, aren't followed. Default 0: all are. Raising it
        makes dreams shorter and truer where modes are voted on; laws have no runners-up.
    snapshot
        Whether to dream of a copy of the model as it is now.
    render_mode
        ``None``, ``"rgb_array"`` or ``"human"``.

    Raises
    ------
    ConfigError
        No spaces are known, those of `like` don't fit the model, or an argument is out of its range.
    QueryError
        What is to be ``"learned"`` is no target of the model, or the model knows nothing at all: at once if it can't
        learn any more, else at reset.

    Version History
    ---------------
    * v0: initial version.
    """

    schema: SceneSchema
    """Of the scenes; only where observations are scenes."""

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # noqa: RUF012

    @refusing(ConfigError)
    def __init__(
        self,
        model: SceneLearner | str | os.PathLike[str],
        like: gym.Env[Any, Any] | Scene | None = None,
        *,
        view: View | None = None,
        reward: SceneFunction | Literal["learned"] | None = None,
        terminated: SceneFunction | Literal["learned"] | None = None,
        task: TaskFunctions | None = None,
        start: Start | None = None,
        horizon: int | None = None,
        min_margin: float = 0.0,
        snapshot: bool = False,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ConfigError(
                f"render_mode={render_mode!r}: expected None or one of {self.metadata['render_modes']}"
            )
        self._setting = place = Setting.of(model, like, view, snapshot=snapshot)
        self.model, self.render_mode = place.model, render_mode
        if place.scenic:  # else the dream has none, as the real env
            self.schema = place.schema
        self.observation_space, self.action_space = place.observation_space, place.action_space
        self.metadata = {**self.metadata, "render_fps": place.render_fps}
        self.task = place.task if task is None else task
        self.flat_spec = place.flat_spec
        check_reward_functions(reward, terminated, self.task, place.model, batched=False, at_once=snapshot)
        self._given = reward, terminated
        self._evaluator = StepEvaluator(None, None)  # settled when a dream begins
        self._start = checked_function("start", start, "random generator")
        self._horizon = None if horizon is None else checked_count("horizon", horizon, 1, 10**9)
        self._min_margin = checked_least("min_margin", min_margin, 0.0)
        self._scene: Scene | None = None
        self._steps = 0
        self._viewer: Any = None
        self._camera: Any = None

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
        QueryError
            The model knows none of its targets yet.
        """
        super().reset(seed=seed)
        check_knowledge(self.model)
        evaluator = StepEvaluator.of(*self._given, self.task, self.model)
        self._scene = self._first(seed, checked_options(options))
        self._evaluator = evaluator
        self._steps, self._camera = 0, None
        if self.render_mode == "human":
            self.render()
        return self._observation(), {"scene": self._scene}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Predict one step.

        Raises
        ------
        ActionError
            `action` lies outside the action space.
        ConfigError
            The reward or the termination is no finite number; the dream is where it was.
        """
        before = self.scene
        taken = checked_action(self.action_space, action)
        prediction = self.model.predict_one(self._setting.shown.acting(before, taken))
        after = without_action(prediction.scene)
        info: dict[str, Any] = {"prediction": prediction}
        if (end := self._end(prediction, after)) is not None:
            self._steps += 1
            return self._observation(), 0.0, False, True, {**info, **_told(*end)}
        reward, ended = self._evaluator(before, taken, after)
        if math.isnan(reward):
            self._steps += 1
            return (
                self._observation(),
                0.0,
                False,
                True,
                {**info, **_told(Cause.NO_REWARD, Cause.NO_REWARD.value)},
            )
        if self.task is not None and hasattr(self.task, "succeeded"):
            info["is_success"] = bool(self.task.succeeded(before, taken, after))
        self._scene, self._steps = self._onward(after), self._steps + 1
        late = self._horizon is not None and self._steps >= self._horizon
        if late:
            info |= _told(Cause.HORIZON, horizon_reached(self._horizon))
        if self.render_mode == "human":
            self.render()
        return self._observation(), reward, ended, late, info

    def render(self) -> Any:
        """Draw the scene: as an array of shape (height, width, 3), or in a window for ``"human"``."""
        from relgym.envs.rendering import Camera, SceneViewer

        if self.render_mode is None:
            raise ConfigError("nothing to render to: make the env with render_mode='rgb_array' or 'human'")
        if self._viewer is None:
            self._viewer = SceneViewer(self.render_mode, fps=self.metadata["render_fps"])
        if self._camera is None:
            self._camera = Camera()
        marks = marked(self.task, self.scene)
        return self._viewer.show(self.scene, self._camera.view(self.scene, marks), marks)

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

    # ------------------------------------------------------------------ helpers
    def _first(self, seed: int | None, options: Mapping[str, Any]) -> Scene:
        """The first scene."""
        place = self._setting
        if "scene" in options or self._start is not None or place.world is None:
            check_options(options, ("scene",))
        if "scene" in options:
            return place.fitted(options["scene"])
        if self._start is not None:
            return place.fitted(self._start(self.np_random))
        if place.world is not None:
            # A seed passes through, so that equal seeds begin equally; without one the dream's own draws decide.
            chosen = int(self.np_random.integers(2**31)) if seed is None else seed
            return place.real_start(chosen, options)
        return place.pool[int(self.np_random.integers(len(place.pool)))]

    def _end(self, prediction: ScenePrediction, after: Scene) -> tuple[Cause, str] | None:
        """Why a prediction can't be followed; None if it can."""
        if (told := explained(parts_of(prediction), self._min_margin, self._evaluator.overruled)) is not None:
            return told
        (left,) = self._setting.shown.outside(after.layout, after.vector[None])
        return (Cause.LEFT, left) if left else None

    def _onward(self, after: Scene) -> Scene:
        """The scene from which the dream goes on: what the next step will bring isn't known."""
        if TASK not in after:
            return after
        layout, vector = after.layout, after.vector.copy()
        vector[layout.slice(layout.index(TASK))] = 0.0
        return Scene(after.schema, layout, vector)

    def _observation(self) -> Any:
        return self._setting.shown.observation(self.scene)


def _told(cause: Cause, reason: str) -> dict[str, Any]:
    return {"reason": reason, "cause": cause.name.lower()}
