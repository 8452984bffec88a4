"""The wrapper that learns a model of an env while an agent acts in it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
from gymnasium.utils import RecordConstructorArgs

from relgym.arguments import refusing
from relgym.config import ModelConfig
from relgym.errors import ConfigError
from relgym.model.protocol import SceneLearner
from relgym.scene.objects import Scene
from relgym.wrappers.follower import BadObservations
from relgym.wrappers.learning import Learning
from relgym.wrappers.observer import STARTS, Observer, Step
from relgym.wrappers.settings import PlainTarget
from relgym.wrappers.study import NOTHING
from relgym.wrappers.views import ViewLike, metadata_of, readable, recordable, view_of

__all__ = ["STARTS", "ModelLearner"]


class ModelLearner(Learning, gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
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
        What to go on from, instead of an empty model: a `WorldModel`, which then learns here itself (with `background`
        a copy does), or the path of a model file. It keeps its targets and config. Or any other learner of scenes
        (`relgym.model.protocol.SceneLearner`), such as the thesis' own system (`relgym.thesis.model.ThesisModel`).
    window
        How many steps count as the latest in `prequential`.

    Raises
    ------
    ConfigError
        A vector env, spaces that need a view of the user's, a view of other actions, unknown parameters, or a model of
        another world.

    Notes
    -----
    Copies have models of their own, and so does what ``gym.make(env.spec)`` or a vector env makes of this one.
    ``env.spec.to_json()`` can hold all but views made of functions, and models that aren't files.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> env = ModelLearner(gym.make("relgym/TruckPush-v0", resample="step"), targets=["truck.vx"])
    >>> _ = env.reset(seed=0)
    >>> _, _, _, _, info = env.step(env.action_space.sample())
    >>> info["relgym"].wrong  # nothing learned yet
    (('truck', 'vx'),)
    >>> env.model
    WorldModel(truck.vx: 0 modes; 1 transitions)
    """

    @refusing(ConfigError)
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
        model: SceneLearner | str | os.PathLike[str] | None = None,
        window: int = 1000,
    ) -> None:
        _refuse_vector_env(env)
        self._observer = Observer(
            view_of(env, view, reward=learn_reward, terminated=learn_termination),
            env.observation_space,
            env.action_space,
            targets=targets,
            config=config,
            model=model,
            learn=learn,
            predict=predict,
            window=window,
            background=background,
            bad_observations=bad_observations,
            metadata=metadata_of(env),
        )
        # Recorded arguments are deep-copied: what a spec makes goes on from a copy of the model as it now is.
        RecordConstructorArgs.__init__(
            self,
            **self._observer.arguments,
            view=recordable(view),
            learn=learn,
            predict=predict,
            learn_reward=learn_reward,
            learn_termination=learn_termination,
            bad_observations=bad_observations,
            background=background,
            window=window,
        )
        gym.Wrapper.__init__(self, env)

    # ------------------------------------------------------------------ the Gymnasium contract
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; `ObservationError` when its first observation is no scene (the model is unchanged)."""
        self._observer.followers[0].forget()
        observation, info = self.env.reset(seed=seed, options=options)
        self._observer.begin({0: (observation, info)})
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Predict, step, learn.

        Whether an action is legal is for the env to say. One that lies outside its space, and that the env takes all
        the same, is learned from as it was given; nothing is learned from one that can't be read (NaN, another shape,
        a choice that there isn't), and it is counted in `skipped`.

        Raises
        ------
        ObservationError
            The next observation is no scene of this world, and such aren't skipped. The env has stepped, the model
            is unchanged; `reset` begins anew.
        """
        observer, follower = self._observer, self._observer.followers[0]
        if follower.over:
            return self._step_over(action)
        known = readable(self.env.action_space, action)
        before = follower.act(known)
        prediction = observer.expect(before)
        observation, reward, terminated, truncated, info = self.env.step(action)
        follower.over = bool(terminated or truncated)
        step = Step(known, observation, info, reward, bool(terminated))
        report = observer.follow(0, before, prediction, step)
        return observation, reward, terminated, truncated, {**info, "relgym": report}

    def _step_over(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """A step after an episode's end: an `Autoreset` inside resets, and the action means nothing."""
        follower = self._observer.followers[0]
        follower.forget()
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._observer.begin({0: (observation, info)})
        follower.over = bool(terminated or truncated)
        return observation, reward, terminated, truncated, {**info, "relgym": NOTHING}

    def close(self) -> None:
        """Close the env, and end the background process if there is one, once it has learned all.

        Raises
        ------
        RelgymError
            The background process had ended before; all is closed nevertheless.
        """
        try:
            self._observer.close()
        finally:
            super().close()

    # ------------------------------------------------------------------ learning
    @property
    def scene(self) -> Scene:
        """The current scene, without an action; `ResetNeeded` before the first reset or after a bad observation."""
        return self._observer.followers[0].scene


def _refuse_vector_env(env: Any) -> None:
    if isinstance(env, gym.vector.VectorEnv):
        raise ConfigError(
            "expected a single env, got a vector env: VectorModelLearner(env) learns one model from all of its envs, "
            "and gym.make_vec(id, num_envs=n, vectorization_mode='sync', wrappers=[ModelLearner]) one from each"
        )
