"""The wrapper that learns a model of an env while an agent acts in it (design §5)."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs

from relgym.config import ModelConfig
from relgym.envs.arguments import checked_action
from relgym.envs.model_files import EnvRecord
from relgym.errors import ConfigError
from relgym.model.storage import target_to_json
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene
from relgym.wrappers.follower import BadObservations, Follower
from relgym.wrappers.prequential import Prequential
from relgym.wrappers.settings import PlainTarget, config_of, model_of, target_of
from relgym.wrappers.study import NOTHING, Study
from relgym.wrappers.views import ViewLike, is_open, settled, view_of

__all__ = ["STARTS", "ModelLearner"]

STARTS = 16
"""How many first scenes of episodes a model file keeps, for dreams to start from."""


class ModelLearner(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Learns a `WorldModel` of the wrapped env, online; what the env returns stays as it is.

    At every step the model first predicts the next scene, then the env steps, then the model learns from what
    happened: errors are counted on predictions whose outcome the model hadn't seen. The report of a step is
    ``info["relgym"]``, a `StepReport`. Nothing is learned across the border of two episodes, nor from the
    pseudo-transition of an `Autoreset` inside.

    Parameters
    ----------
    env
        Any env with flat spaces, or whose observations are scenes (`relgym.envs.SceneEnv`), possibly in wrappers.
    view
        How its observations and actions become scenes: a view (`relgym.envs.views`), or a function of
        (observation space, action space) that makes one. Default: the env's own objects if it has a schema, else
        its numbers as one object, or one per key of a Dict.
    targets
        What to learn, in causal order: `Target`, or its name ``"ball.vx"``. Default: the schema's targets, and
        if it names none, every property that changes.
    config
        Free parameters of the model: a `ModelConfig`, or a dict of those that differ from the default
        (``{"seed": 1, "clustering": {"draws": 500}}``).
    learn
        Whether to learn from the start on; see `learning`.
    predict
        Whether to predict before each step. Default true; false saves the time, and then nothing is counted.
    learn_reward, learn_termination
        Whether these are learned too, as properties of a bodiless object `task`.
    bad_observations
        What to do with NaN, infinity, wrong lengths, unknown objects, objects that changed their type:
        ``"raise"`` (default) `ObservationError`, or ``"skip"`` them, counted in `skipped`.
    background
        Learn in a process of its own, behind a queue of at most this many transitions; steps then report nothing,
        and `model` and `prequential` are those of the last `catch_up`. What finds the queue full is left out, and
        counted in `dropped`. Default ``None``: learn in `step`.
    model
        A model file to go on from, instead of an empty model; it keeps its targets and config.
    window
        How many steps count as the latest in `prequential`.

    Attributes
    ----------
    view : View
        How observations and actions become scenes. Final after the first reset, where a pair of numbers looks like
        cosine and sine.

    Raises
    ------
    ConfigError
        A vector env, spaces that need a view of the user's, unknown parameters, or a model of another world.

    Notes
    -----
    Copies have models of their own, and so does what ``gym.make(env.spec)`` or a vector env makes of this one.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> env = ModelLearner(gym.make("relgym/TruckPush-v0", redraw="step"), targets=["truck.vx"])
    >>> _ = env.reset(seed=0)
    >>> _, _, _, _, info = env.step(env.action_space.sample())
    >>> info["relgym"].wrong  # nothing learned yet
    (('truck', 'vx'),)
    >>> env.model
    WorldModel(truck.vx: 0 modes; 1 transitions)
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        *,
        view: ViewLike = None,
        targets: Sequence[PlainTarget] | None = None,
        config: ModelConfig | Mapping[str, Any] | None = None,
        learn: bool = True,
        predict: bool = True,
        learn_reward: bool = False,
        learn_termination: bool = False,
        bad_observations: BadObservations = "raise",
        background: int | None = None,
        model: str | os.PathLike[str] | None = None,
        window: int = 1000,
    ) -> None:
        _refuse_vector_env(env)
        chosen = None if targets is None else [target_of(t) for t in targets]
        settings = None if config is None else config_of(config)
        # Plain data only: recorded arguments are deep-copied, and a learner among them would be forked.
        RecordConstructorArgs.__init__(
            self,
            view=view,
            targets=None if chosen is None else [target_to_json(t) for t in chosen],
            config=None if settings is None else settings.to_json(),
            learn=learn,
            predict=predict,
            learn_reward=learn_reward,
            learn_termination=learn_termination,
            bad_observations=bad_observations,
            background=background,
            model=None if model is None else os.fspath(model),
            window=window,
        )
        gym.Wrapper.__init__(self, env)
        self.view = view_of(env, view, reward=learn_reward, terminated=learn_termination)
        self._model_of = partial(model_of, config=settings, targets=chosen, path=model)
        self._study_of = partial(Study, learn=learn, predict=predict, window=window, background=background)
        self._follower = Follower(self.view, bad_observations)
        self._starts: list[Scene] = []
        self._study: Study | None = None
        if not is_open(self.view):
            self._open_study()

    # ------------------------------------------------------------------ the Gymnasium contract
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; `ObservationError` when its first observation is no scene (the model is unchanged)."""
        self._follower.forget()
        observation, info = self.env.reset(seed=seed, options=options)
        self._begin(observation, info)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Predict, step, learn.

        Raises
        ------
        ActionError
            An action outside the action space; model and env are unchanged.
        ObservationError
            The next observation is no scene of this world, and such aren't skipped. The env has stepped, the model
            is unchanged; `reset` begins anew.
        """
        checked = checked_action(self.env.action_space, action)
        follower = self._follower
        if follower.over:
            return self._step_over(action)
        before = follower.act(checked)
        prediction = None if self._study is None else self._study.expect(before)
        observation, reward, terminated, truncated, info = self.env.step(action)
        follower.over = bool(terminated or truncated)
        transition = follower.follow(
            before, prediction, observation, info, reward=float(reward), terminated=bool(terminated)
        )
        report = NOTHING if self._study is None else self._study.take_up(transition, prediction)
        return observation, reward, terminated, truncated, {**info, "relgym": report}

    def close(self) -> None:
        """Close the env, and end the background process if there is one, once it has learned all."""
        if self._study is not None:
            self._study.close()
        super().close()

    # ------------------------------------------------------------------ learning
    @property
    def model(self) -> WorldModel:
        """What was learned; through other wrappers: ``env.get_wrapper_attr("model")``."""
        return self.study.model

    @property
    def prequential(self) -> Prequential:
        """How many predictions were wrong, in total and lately."""
        return self.study.prequential

    @property
    def study(self) -> Study:
        """Who learns; `ResetNeeded` where the view wants to see a first observation."""
        if self._study is None:
            raise ResetNeeded(
                "whether pairs of numbers are cosine and sine of an angle is decided from the first observation: "
                "call reset() first, or pass view=FlatView(..., angles=...)"
            )
        return self._study

    @property
    def learning(self) -> bool:
        """Whether transitions are being learned from; `ConfigError` to ask it of a model without history."""
        return self.study.learning

    @learning.setter
    def learning(self, learn: bool) -> None:
        self.study.learning = learn

    def pause(self) -> None:
        """Stop learning; predictions go on and are counted. ``learning = True`` goes on."""
        self.learning = False

    @property
    def skipped(self) -> int:
        """How many bad observations were skipped."""
        return self._follower.skipped

    @property
    def dropped(self) -> int:
        """How many transitions found the queue to the background process full."""
        return self.study.dropped

    def catch_up(self) -> WorldModel:
        """Wait until the background process has learned all it was sent; the model as it then is."""
        return self.study.catch_up()

    @property
    def scene(self) -> Scene:
        """The current scene, without an action; `ResetNeeded` before the first reset or after a bad observation."""
        return self._follower.scene

    # ------------------------------------------------------------------ files
    @property
    def record(self) -> EnvRecord:
        """What a model file says of the env: spaces and the first scenes of the first episodes."""
        spec = self.env.spec
        known = {"env": None if spec is None else spec.id, "render_fps": self.env.metadata.get("render_fps")}
        metadata = {name: value for name, value in known.items() if value is not None}
        return EnvRecord(self.env.observation_space, self.env.action_space, tuple(self._starts), metadata)

    def save(self, path: str | os.PathLike[str], *, history: bool = False) -> None:
        """Write the model, the env's spaces and some first scenes to one file, atomically.

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
        model = self.catch_up()
        model.extra = self._extra()
        model.save(path, history=history)

    # ------------------------------------------------------------------ helpers
    def _open_study(self) -> None:
        self._study = self._study_of(self._model_of(self.view.schema))

    def _begin(self, observation: Any, info: dict[str, Any]) -> None:
        if self._study is None:
            self.view = self._follower.view = settled(self.view, [observation])
            self._open_study()
        scene = self._follower.begin(observation, info)
        if scene is not None and len(self._starts) < STARTS:
            self._starts.append(scene)
            # So that model.save, too, writes a file to dream from.
            self.model.extra = self._extra()

    def _extra(self) -> dict[str, Any]:
        return self.record.to_json() | {"view": self.view.to_json()}

    def _step_over(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """A step after an episode's end: an `Autoreset` inside resets, and the action means nothing."""
        self._follower.forget()
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._begin(observation, info)
        self._follower.over = bool(terminated or truncated)
        return observation, reward, terminated, truncated, {**info, "relgym": NOTHING}


def _refuse_vector_env(env: Any) -> None:
    if isinstance(env, gym.vector.VectorEnv):
        raise ConfigError(
            "expected a single env, got a vector env, whose envs a single learner can't follow; wrap each of them "
            "(gym.make_vec(id, num_envs=n, vectorization_mode='sync', wrappers=[ModelLearner])): each then has "
            "a model of its own"
        )
