"""Thousands of dreams at once: a learned model as a Gymnasium vector env, stepped with array operations."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Literal, TypeAlias

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from relgym.arguments import refusing
from relgym.envs.arguments import (
    check_options,
    checked_count,
    checked_function,
    checked_least,
    checked_mask,
    checked_options,
)
from relgym.envs.dreams.infos import masked, told_of
from relgym.envs.dreams.rewards import (
    BatchSceneFunction,
    BatchStepEvaluator,
    TaskFunctions,
    check_reward_functions,
    marked,
)
from relgym.envs.dreams.setting import Setting, check_knowledge
from relgym.envs.dreams.starts import BatchStart, Drawn
from relgym.envs.dreams.step import DreamStep, Stepped
from relgym.envs.views import View
from relgym.errors import ConfigError, ObservationError
from relgym.model.predicting.prediction import BatchPrediction
from relgym.model.protocol import SceneLearner
from relgym.scene.objects import Float1D, Float2D, Scene
from relgym.scene.schema import SceneSchema

__all__ = ["LearnedModelVectorEnv"]

_Bools: TypeAlias = NDArray[np.bool_]
_Rows: TypeAlias = NDArray[np.intp]


class LearnedModelVectorEnv(VectorEnv[Any, Any, NDArray[Any]]):
    """`LearnedModelEnv`, many scenes at once: no loop over scenes, the same bits as single dreams.

    But for what a view shows one by one: all but those of scenes and of numbers (`relgym.envs.views.View`).

    Description
    -----------
    All scenes have the same objects. What `LearnedModelEnv` says of transitions, spaces, live models and ends of
    episodes holds here too; rewards, terminations and first scenes come from functions of arrays.

    Action Space, Observation Space
    -------------------------------
    The batched ones of a single dream: ``Dict``, object name -> ``Box`` of shape ``(num_envs, properties)``.

    Rewards
    -------
    As for a single dream; ``float64`` of shape ``(num_envs,)``.

    Starting State
    --------------
    As for a single dream. Reset options: ``scene`` (one for all), ``scenes`` (state vectors without an action, shape
    ``(k, width)``, or k scenes, for the k dreams that are reset), ``reset_mask`` (booleans of shape ``(num_envs,)``:
    which dreams to reset, the others go on), and those of `like`. Resets of `like` go one by one: where speed matters
    let `start` draw from arrays (`drawn_from`). Dream i gets the seed ``seed + i`` for its reset of `like`.

    Episode End
    -----------
    As for a single dream. What happens then is `autoreset_mode`'s matter: the dream begins anew in the next step,
    which ignores its action (``NEXT_STEP``), or in the same one, with the last observation in
    ``infos["final_obs"]`` and what was said of the last step in ``infos["final_info"]`` (``SAME_STEP``), or not at
    all until ``reset(options={"reset_mask": mask})`` (``DISABLED``).

    Info
    ----
    Where an episode was truncated ``infos["reason"]`` (a sentence) and ``infos["cause"]`` (the name of a `Cause` in
    lower case), each with its mask; ``infos["is_success"]`` if the task tells. The model's words about the last step
    are in `prediction`.

    Arguments
    ---------
    model, like, view, horizon, min_margin, snapshot, render_mode
        As for `LearnedModelEnv`.
    num_envs
        How many dreams, >= 1.
    reward, terminated
        Functions of (layout, vectors before, actions, vectors after) that return arrays of shape ``(n,)``; the layout
        and the vectors, shape ``(n, width)``, hold no action, and the actions are those of the action space, shape
        ``(n, …)``. `in_batches` makes one of a function of scenes. Or ``"learned"``.
    task
        An object with functions `rewards` and `terminations`. Default: that of `like`.
    start
        Function of a random generator and a number n that returns n state vectors without an action.
    max_episode_steps
        As `horizon`, under the name that ``gym.make_vec`` gives it; the shorter one counts.
    autoreset_mode
        An `AutoresetMode` or its value.

    Raises
    ------
    ConfigError, QueryError
        As for `LearnedModelEnv`.

    Notes
    -----
    Cost: *Running and exporting* has the figures (`docs/guides/running-and-exporting.md`). Memory: some 8 KB for each
    dream of seven objects.
    """

    schema: SceneSchema
    """Of the scenes; only where observations are scenes."""

    @refusing(ConfigError)
    def __init__(
        self,
        model: SceneLearner | str | os.PathLike[str],
        num_envs: int = 1,
        like: gym.Env[Any, Any] | Scene | None = None,
        *,
        view: View | None = None,
        reward: BatchSceneFunction | Literal["learned"] | None = None,
        terminated: BatchSceneFunction | Literal["learned"] | None = None,
        task: TaskFunctions | None = None,
        start: BatchStart | None = None,
        horizon: int | None = None,
        max_episode_steps: int | None = None,
        min_margin: float = 0.0,
        snapshot: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ConfigError(f"render_mode={render_mode!r}: expected None or 'rgb_array'")
        self._mode = _checked_mode(autoreset_mode)
        self._setting = place = Setting.of(model, like, view, snapshot=snapshot)
        self.num_envs = checked_count("num_envs", num_envs, 1, 10**7)
        self.model, self.render_mode = place.model, render_mode
        if place.scenic:  # else the dreams have none, as the real env
            self.schema = place.schema
        self.flat_spec = place.flat_spec
        self.single_observation_space, self.single_action_space = place.observation_space, place.action_space
        self.observation_space = batch_space(place.observation_space, self.num_envs)
        self.action_space = batch_space(place.action_space, self.num_envs)
        self.metadata = {
            "render_modes": ["rgb_array"],
            "render_fps": place.render_fps,
            "autoreset_mode": self._mode,
        }
        self.task = place.task if task is None else task
        check_reward_functions(reward, terminated, self.task, place.model, batched=True, at_once=snapshot)
        self._given = reward, terminated
        self._step = DreamStep(
            place,
            BatchStepEvaluator(place.layout, None, None),  # settled when dreams begin
            self.task,
            place.shown.deeds(),
            _shorter(horizon, max_episode_steps),
            checked_least("min_margin", min_margin, 0.0),
        )
        start = checked_function("start", start, "random generator", "count")
        self._start = start.fit(place.fitted_vector) if isinstance(start, Drawn) else start
        self._known: Drawn | None = None  # what is drawn from, once all of it is known to be allowed
        self._vectors: Float2D | None = None
        self._steps = np.zeros(self.num_envs, dtype=np.int64)
        self._over = np.zeros(self.num_envs, dtype=np.bool_)
        self._viewer: Any = None
        self._cameras: dict[int, Any] = {}
        self._last: tuple[BatchPrediction, _Bools | None] | None = None

    # ------------------------------------------------------------------ the Gymnasium contract
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin all dreams, or those that ``options["reset_mask"]`` marks; see *Starting State*.

        Raises
        ------
        ConfigError
            An unknown option, a mask of another shape, or nothing to begin with.
        ObservationError
            A first scene isn't one of this world, or lies outside the observation space.
        QueryError
            The model knows none of its targets yet.
        ResetNeeded
            A mask before the first reset of all.
        """
        super().reset(seed=seed)
        check_knowledge(self.model)
        evaluator = BatchStepEvaluator.of(*self._given, self.task, self.model, self._setting.layout)
        rest = dict(checked_options(options))
        mask = checked_mask(rest.pop("reset_mask", None), self.num_envs)
        if self._vectors is None and not mask.all():
            raise ResetNeeded("the dreams have not begun: call reset() without a mask first")
        rows = np.flatnonzero(mask)
        first = self._first(rows, seed, rest)
        if self._vectors is None:
            self._vectors = np.empty((self.num_envs, self._setting.layout.width))
        self._begin(rows, first)
        self._step = replace(self._step, evaluator=evaluator)
        return self._setting.shown.observations(self._vectors), {}

    def step(self, actions: Any) -> tuple[Any, Float1D, _Bools, _Bools, dict[str, Any]]:
        """Predict one step of every dream.

        Raises
        ------
        ActionError
            An action lies outside the action space.
        ConfigError
            A reward is NaN or infinite; the dreams are where they were.
        ResetNeeded
            Before the first reset, or with ``DISABLED`` for dreams that are over.
        """
        self.vectors  # noqa: B018 - raises before the first reset
        pending = self._over
        if pending.any() and self._mode is AutoresetMode.DISABLED:
            raise ResetNeeded(
                f"the episodes of {int(pending.sum())} dreams are over: call reset(options={{'reset_mask': mask}})"
            )
        taken = self._step.actions.checked(actions, self.num_envs)
        anew = np.flatnonzero(pending)
        # Those that begin anew are stepped, too, and what comes of it is left: cheaper than to pick the others.
        going = None if not len(anew) else ~pending
        stepped = self._stepped(taken, going)
        rewards, ended, cut = stepped.rewards, stepped.terminated, stepped.truncated
        infos = told_of(self._step, stepped, going)
        over = ended | cut
        same = self._mode is AutoresetMode.SAME_STEP and bool(over.any())
        begun = np.flatnonzero(over) if same else anew
        first = self._first(begun, None, {}) if len(begun) else None
        # Nothing can fail from here on; whatever did has left the dreams where they were.
        self._follow(stepped, going)
        if same:
            infos = self._ended(infos, over)
        self._over = over
        if first is not None:
            self._begin(begun, first, told=same)  # else nothing was told of those that began anew
        return self._setting.shown.observations(self.vectors), rewards, ended, cut, infos

    def render(self) -> tuple[Any, ...]:
        """Draw every dream: arrays of shape (height, width, 3)."""
        from relgym.envs.rendering import Camera, SceneViewer

        if self.render_mode is None:
            raise ConfigError("nothing to render to: make the envs with render_mode='rgb_array'")
        if self._viewer is None:
            self._viewer = SceneViewer(self.render_mode, fps=self.metadata["render_fps"])
        pictures = []
        for k, scene in enumerate(self.scenes):
            camera, marks = self._cameras.setdefault(k, Camera()), marked(self.task, scene)
            pictures.append(self._viewer.show(scene, camera.view(scene, marks), marks))
        return tuple(pictures)

    def close_extras(self, **kwargs: Any) -> None:
        """Give the viewer back, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    # ------------------------------------------------------------------ scenes
    @property
    def vectors(self) -> Float2D:
        """State vectors of the current scenes, without an action, shape ``(num_envs, layout.width)``; read-only."""
        if self._vectors is None:
            raise ResetNeeded("the dreams have not begun: call reset() first")
        view = self._vectors.view()
        view.flags.writeable = False
        return view

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The current scenes, without an action."""
        return tuple(self._scene(vector) for vector in self.vectors)

    def _scene(self, vector: Float1D) -> Scene:
        return Scene(self._setting.schema, self._setting.layout, vector.copy())

    # ------------------------------------------------------------------ beginning
    def _first(self, rows: _Rows, seed: int | None, options: Mapping[str, Any]) -> Float2D:
        """State vectors of first scenes for some of the dreams."""
        if seed is not None:
            checked_count("seed", seed, 0, 2**62)
        place, count = self._setting, len(rows)
        if "scene" in options or "scenes" in options or self._start is not None or place.world is None:
            check_options(options, ("reset_mask", "scene", "scenes"))
        if "scenes" in options:
            return self._checked_first(options["scenes"], count, "options['scenes']")
        if "scene" in options:
            return np.repeat(place.fitted_vector(options["scene"])[None], count, axis=0)
        if isinstance(self._start, Drawn):
            if self._known is None:
                every = self._start.vectors
                self._known = Drawn(self._checked_first(every, len(every), "start", each="scene"))
            return self._known(self.np_random, count)
        if self._start is not None:
            return self._checked_first(self._start(self.np_random, count), count, "start")
        if place.world is not None:
            seeds = self.np_random.integers(2**31, size=count) if seed is None else seed + rows
            return np.array([place.vector_of(place.real_start(int(s), options)) for s in seeds])
        drawn: Float2D = place.pool_vectors[self.np_random.integers(len(place.pool), size=count)]
        return drawn

    def _checked_first(self, given: Any, count: int, what: str, *, each: str = "dream") -> Float2D:
        place = self._setting
        if not isinstance(given, np.ndarray):
            if not isinstance(given, Iterable):
                raise ObservationError(
                    f"{what}: expected {count} first scenes, or an array of their state vectors, got {given!r}"
                )
            given = np.array([place.fitted_vector(scene) for scene in given])
        if given.shape != (count, place.layout.width):
            raise ObservationError(
                f"{what}: expected {count} first scenes, as state vectors of shape {(count, place.layout.width)} for "
                f"the objects {list(place.layout.names)}, got shape {given.shape}"
            )
        vectors: Float2D = np.array(given, dtype=np.float64)
        vectors[:, place.brought] = 0.0
        if not (inside := place.shown.inside(vectors)).all():  # false for NaN, too
            row = int(np.flatnonzero(~inside)[0])
            (left,) = place.shown.outside(place.layout, vectors[row : row + 1])
            raise ObservationError(f"{what}: {each} {row} can't begin here: {left}")
        return vectors

    def _begin(self, rows: _Rows, first: Float2D, *, told: bool = True) -> None:
        """Some dreams begin; `told`: what was said of their last step may still be asked for."""
        assert self._vectors is not None, "made by reset"
        if self._cameras:
            self._cameras = {k: camera for k, camera in self._cameras.items() if k not in set(rows.tolist())}
        if told and self._last is not None and np.may_share_memory(self._vectors, self._last[0].vectors):
            self._vectors = self._vectors.copy()  # what the model said stays as it is
        self._vectors[rows] = first
        self._steps[rows] = 0
        self._over[rows] = False

    # ------------------------------------------------------------------ stepping
    def _stepped(self, actions: Any, going: _Bools | None) -> Stepped:
        """A step of all dreams, which stay where they are."""
        assert self._vectors is not None, "checked by the caller"
        return self._step(self._vectors, self._steps + 1, actions, going)

    def _follow(self, stepped: Stepped, going: _Bools | None) -> None:
        """Go on to where a step has led."""
        self._vectors = stepped.vectors.view()  # the model's words, perhaps: nobody else may write there
        self._steps += 1
        self._last = stepped.prediction, going
        stepped.prediction.vectors.flags.writeable = False

    @property
    def prediction(self) -> BatchPrediction | None:
        """What the model said of the last step of those dreams that went on; None before the first one."""
        if self._last is None:
            return None
        told, going = self._last
        if going is None:
            return told
        columns = {name: getattr(told, name)[going] for name in ("vectors", "modes", "outcomes", "margins")}
        return replace(told, **columns)

    def _ended(self, infos: dict[str, Any], over: _Bools) -> dict[str, Any]:
        """Infos in which last observations and infos of what is over stand under ``final_…``."""
        final = np.full(self.num_envs, None, dtype=object)
        for k in np.flatnonzero(over).tolist():
            final[k] = self._setting.shown.observation(self._scene(self.vectors[k]))
        told = {
            "final_obs": final,
            "_final_obs": over.copy(),
            "final_info": masked(infos, over),
            "_final_info": over.copy(),
        }
        return told | masked(infos, ~over)


def _checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        raise ConfigError(
            f"autoreset_mode={mode!r}: expected one of {[m.value for m in AutoresetMode]}"
        ) from None


def _shorter(horizon: int | None, max_episode_steps: int | None) -> int | None:
    given = {"horizon": horizon, "max_episode_steps": max_episode_steps}
    counts = [checked_count(what, n, 1, 10**9) for what, n in given.items() if n is not None]
    return min(counts, default=None)
