"""The wrapper that learns a model of an env while an agent acts in it (design §5)."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import gymnasium as gym
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs

from relgym.config import ClassificationConfig, ClusteringConfig, ModelConfig
from relgym.envs.arguments import checked_action
from relgym.envs.model_files import EnvRecord
from relgym.errors import ConfigError, ObservationError
from relgym.model.prediction import ScenePrediction
from relgym.model.storage import target_from_json, target_to_json
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, SceneSchema, Target, Transition
from relgym.wrappers.prequential import Prequential, StepReport, compared
from relgym.wrappers.views import view_of

__all__ = ["STARTS", "ModelLearner"]

STARTS = 16
"""How many first scenes of episodes a model file keeps, for dreams to start from."""

PlainTarget: TypeAlias = Target | str | Sequence[Any]
"""A target, its name (``"ball.vx"``), or ``(type, property)``."""


class ModelLearner(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Learns a `WorldModel` of the wrapped env, online; what the env returns stays as it is.

    At every step the model first predicts the next scene, then the env steps, then the model learns from what
    happened: errors are counted on predictions whose outcome the model hadn't seen. The report of a step is
    ``info["relgym"]``, a `StepReport`. Nothing is learned across the border of two episodes, nor from the
    pseudo-transition of an `Autoreset` inside.

    Parameters
    ----------
    env
        An env whose observations are scenes (`relgym.envs.SceneEnv`), possibly in wrappers that leave its
        observations and actions as they are.
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
    model
        A model file to go on from, instead of an empty model; it keeps its targets and config.
    window
        How many steps count as the latest in `prequential`.

    Attributes
    ----------
    model : WorldModel
        What was learned; through other wrappers: ``env.get_wrapper_attr("model")``.
    view : View
        How observations and actions become scenes.
    prequential : Prequential
        How many predictions were wrong, in total and lately.

    Raises
    ------
    ConfigError
        A vector env, an env without a schema, changed spaces, unknown parameters, or a model of another world.

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
        targets: Sequence[PlainTarget] | None = None,
        config: ModelConfig | Mapping[str, Any] | None = None,
        learn: bool = True,
        predict: bool = True,
        model: str | os.PathLike[str] | None = None,
        window: int = 1000,
    ) -> None:
        _refuse_vector_env(env)
        chosen = None if targets is None else [_target(t) for t in targets]
        settings = None if config is None else _config(config)
        # Plain data only: recorded arguments are deep-copied, and a learner among them would be forked.
        RecordConstructorArgs.__init__(
            self,
            targets=None if chosen is None else [target_to_json(t) for t in chosen],
            config=None if settings is None else settings.to_json(),
            learn=learn,
            predict=predict,
            model=None if model is None else os.fspath(model),
            window=window,
        )
        gym.Wrapper.__init__(self, env)
        self.view = view_of(env)
        self.prequential = Prequential(window)
        self.model = _model(self.view.schema, settings, chosen, model)
        self.learning = learn
        self._predict = predict
        self._scene: Scene | None = None
        self._over = False
        self._starts: list[Scene] = []

    # ------------------------------------------------------------------ the Gymnasium contract
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; `ObservationError` when its first observation is no scene (the model is unchanged)."""
        self._scene, self._over = None, False
        observation, info = self.env.reset(seed=seed, options=options)
        self._begin(observation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Predict, step, learn.

        Raises
        ------
        ActionError
            An action outside the action space; model and env are unchanged.
        ObservationError
            The next observation is no scene of this world. The env has stepped, the model is unchanged;
            `reset` begins anew.
        """
        checked = checked_action(self.env.action_space, action)
        if self._over:
            return self._step_over(action)
        before = self.view.with_action(self.scene, checked)
        prediction = self.model.predict_one(before) if self._predict else None
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._scene = None  # until the next observation proves sound
        after = self._seen(observation)
        report = self._take_up(before, prediction, after)
        self._scene, self._over = after, bool(terminated or truncated)
        return observation, reward, terminated, truncated, {**info, "relgym": report}

    # ------------------------------------------------------------------ learning
    @property
    def learning(self) -> bool:
        """Whether transitions are being learned from; `ConfigError` to ask it of a model without history."""
        return self._learn

    @learning.setter
    def learning(self, learn: bool) -> None:
        if learn and self.model.frozen:
            raise ConfigError(
                "this model was loaded without its history and can only predict: save it with "
                "save(path, history=True), or pass learn=False"
            )
        self._learn = learn

    def pause(self) -> None:
        """Stop learning; predictions go on and are counted. ``learning = True`` goes on."""
        self.learning = False

    @property
    def scene(self) -> Scene:
        """The current scene, without an action; `ResetNeeded` before the first reset or after a bad observation."""
        if self._scene is None:
            raise ResetNeeded("no current scene: call reset() first")
        return self._scene

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
        self.model.extra = self.record.to_json()
        self.model.save(path, history=history)

    # ------------------------------------------------------------------ helpers
    def _begin(self, observation: Any) -> None:
        self._scene = self._seen(observation)
        if len(self._starts) < STARTS:
            self._starts.append(self._scene)
            # So that model.save, too, writes a file to dream from.
            self.model.extra = self.record.to_json()

    def _seen(self, observation: Any) -> Scene:
        try:
            return self.view.scene(observation)
        except ObservationError as error:
            raise ObservationError(
                f"{error} (the env has moved on, the model is unchanged: call reset() to begin anew)"
            ) from error

    def _step_over(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """A step after an episode's end: an `Autoreset` inside resets, and the action means nothing."""
        self._scene, self._over = None, False
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._begin(observation)
        self._over = bool(terminated or truncated)
        return observation, reward, terminated, truncated, {**info, "relgym": StepReport(None, {}, (), None)}

    def _take_up(self, before: Scene, prediction: ScenePrediction | None, after: Scene) -> StepReport:
        residuals, wrong = compared(prediction, after)
        if prediction is not None:
            self.prequential.count(residuals, wrong)
        learned = self.model.learn_one(Transition(before, after)) if self._learn else None
        return StepReport(prediction, residuals, wrong, learned)


def _refuse_vector_env(env: Any) -> None:
    if isinstance(env, gym.vector.VectorEnv):
        raise ConfigError(
            "expected a single env, got a vector env, whose envs a single learner can't follow; wrap each of them "
            "(gym.make_vec(id, num_envs=n, vectorization_mode='sync', wrappers=[ModelLearner])): each then has "
            "a model of its own"
        )


def _target(given: PlainTarget) -> Target:
    if isinstance(given, Target):
        return given
    if not isinstance(given, str):
        return target_from_json([*given, []] if len(given) == 2 else list(given))
    type_name, dot, prop = given.rpartition(".")  # type names may hold dots
    if not (dot and type_name and prop):
        raise ConfigError(f"target {given!r}: expected 'ball.vx', ('ball', 'vx') or a Target")
    return Target(type_name, prop)


def _config(given: ModelConfig | Mapping[str, Any]) -> ModelConfig:
    if isinstance(given, ModelConfig):
        return given
    try:
        halves = {
            "clustering": ClusteringConfig(**given.get("clustering", {})),
            "classification": ClassificationConfig(**given.get("classification", {})),
        }
        return ModelConfig(**{**given, **halves})
    except TypeError as error:
        raise ConfigError(f"config={dict(given)!r}: {error}; see relgym.config.ModelConfig") from None


def _model(
    schema: SceneSchema,
    config: ModelConfig | None,
    targets: Sequence[Target] | None,
    path: str | os.PathLike[str] | None,
) -> WorldModel:
    if path is None:
        return WorldModel(schema, config, targets=targets)
    if config is not None or targets is not None:
        raise ConfigError("a loaded model keeps its targets and config: pass either model or those")
    model = WorldModel.load(path)
    if model.schema != schema:
        raise ConfigError(
            f"{path}: the model was learned in another world (objects {list(model.schema.order)}) than the env's "
            f"(objects {list(schema.order)}); make the env with the arguments it was learned with"
        )
    return model
