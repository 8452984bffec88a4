"""Learning a model from the rollouts of any Stable-Baselines3 algorithm."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, cast

from gymnasium import spaces
from gymnasium.error import ResetNeeded
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize, unwrap_vec_wrapper

from relgym.config import ModelConfig
from relgym.envs.arguments import checked_count
from relgym.envs.views import Angle
from relgym.errors import ConfigError
from relgym.model.predicting.prequential import Prequential
from relgym.model.world_model import WorldModel
from relgym.wrappers.follower import BadObservations
from relgym.wrappers.observer import First, Observer, Step
from relgym.wrappers.sb3.quality import log_quality
from relgym.wrappers.settings import PlainTarget
from relgym.wrappers.views import ViewLike, chosen_view, readable

__all__ = ["ModelCallback"]


class ModelCallback(BaseCallback):  # type: ignore[misc]
    """Watches an agent train, and learns one `WorldModel` from all envs of its VecEnv.

    Training goes on as without it: nothing that the algorithm sees is touched. Transitions end with the episode's
    true last observation (``infos[i]["terminal_observation"]``), never with the first one of the next. Observations
    and rewards are taken as they were before `VecNormalize`; an episode's last observation, which it doesn't keep, is
    turned back, exact up to rounding and to what was clipped.

    Parameters
    ----------
    view, targets, config, learn, predict, learn_reward, learn_termination, bad_observations, model, window
        As of `relgym.wrappers.ModelLearner`.
    background
        Learn in a process of its own, behind a queue of at most this many transitions: where learning takes longer
        than acting, the agent doesn't wait for it, and what finds the queue full is left out and counted. ``None``
        (default): learn at every step, before the agent goes on; then the model is reproducible.
    log_every
        Steps of the VecEnv between records in the algorithm's logger, >= 1.
    verbose
        As in Stable-Baselines3.

    Raises
    ------
    ConfigError
        When training begins: spaces that need a view of the user's, or unknown parameters.

    Notes
    -----
    Logged: ``relgym/transitions``, ``relgym/modes``, ``relgym/wrong`` (share of the latest steps with a wrong
    prediction), ``relgym/nrmse`` (size of the errors: 0 is exact, 1 as good as that nothing changes),
    ``relgym/calibration`` (share of errors within two of the stated standard deviations: 0.95 is right),
    ``relgym/coverage`` (share of predictions that the model claims; of all three see `Prequential`),
    ``relgym/skipped`` and, with a background process, ``relgym/dropped``; `transitions`, `modes` and what is said of
    errors are then those of the last `catch_up`.

    Examples
    --------
    >>> from stable_baselines3 import PPO  # doctest: +SKIP
    >>> watch = ModelCallback(background=4096)  # doctest: +SKIP
    >>> PPO("MlpPolicy", "CartPole-v1", n_steps=256).learn(10_000, callback=watch)  # doctest: +SKIP
    >>> print(watch.catch_up().describe())  # doctest: +SKIP
    """

    def __init__(
        self,
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
        log_every: int = 100,
        verbose: int = 0,
    ) -> None:
        super().__init__(verbose)
        self._view = view
        self._task = (learn_reward, learn_termination)
        self._arguments: dict[str, Any] = {
            "targets": targets,
            "config": config,
            "predict": predict,
            "bad_observations": bad_observations,
            "background": background,
            "model": model,
            "window": window,
        }
        self._learning = learn
        self._log_every = checked_count("log_every", log_every, 1, 10**9)
        self._observer: Observer | None = None
        self._normalised: VecNormalize | None = None

    # ------------------------------------------------------------------ Stable-Baselines3's callback
    def _on_training_start(self) -> None:
        env = self.training_env
        self._normalised = unwrap_vec_wrapper(env, VecNormalize)
        if self._observer is None:  # a second learn() goes on with what is known
            spaces_of = (_space(self._normalised, env.observation_space), env.action_space)
            reward, ended = self._task
            view = chosen_view(self._view, *spaces_of, schema=_schema(env), reward=reward, terminated=ended)
            self._observer = Observer(
                view, *spaces_of, envs=env.num_envs, learn=self._learning, **self._arguments
            )
        elif len(self._observer.followers) != env.num_envs:
            raise ConfigError(
                f"this callback has followed {len(self._observer.followers)} envs, now there are {env.num_envs}: "
                "make another one (model=path goes on from a file)"
            )
        seen, infos = self._single(self.model._last_obs), env.unwrapped.reset_infos
        self._observer.begin({k: (observation, infos[k]) for k, observation in enumerate(seen)})

    def _on_step(self) -> bool:
        dones, infos = self.locals["dones"], self.locals["infos"]
        actions = self.locals.get("clipped_actions", self.locals["actions"])
        rewards = self.locals["rewards"]
        if self._normalised is not None:
            rewards = self._normalised.get_original_reward()
        space, begun = self.training_env.action_space, self.training_env.unwrapped.reset_infos
        steps: dict[int, Step] = {}
        firsts: dict[int, First] = {}
        for k, seen in enumerate(self._single(self.locals["new_obs"])):
            done = bool(dones[k])
            last = self._last(infos[k]) if done else seen
            terminated = done and not infos[k].get("TimeLimit.truncated", False)
            steps[k] = Step(readable(space, actions[k]), last, infos[k], rewards[k], terminated)
            if done:
                firsts[k] = (seen, begun[k])
        self.observer.follow_all(steps, firsts)
        if self.n_calls % self._log_every == 0:
            self._log()
        return True

    def _on_training_end(self) -> None:
        self._log()

    def _last(self, info: dict[str, Any]) -> Any:
        """The episode's true last observation, as the env said it."""
        if "terminal_observation" not in info:
            raise ConfigError(
                "the VecEnv begins new episodes without infos['terminal_observation'], so the last transitions "
                "can't be told from leaps: use one of Stable-Baselines3's VecEnvs, or keep to that convention"
            )
        last = info["terminal_observation"]
        return last if self._normalised is None else self._normalised.unnormalize_obs(last)

    def _single(self, observations: Any) -> list[Any]:
        """Single observations, as the envs said them."""
        if self._normalised is not None:
            observations = self._normalised.get_original_obs()
        if isinstance(observations, Mapping):
            count = len(next(iter(observations.values())))
            return [{key: part[k] for key, part in observations.items()} for k in range(count)]
        return list(observations)

    # ------------------------------------------------------------------ what was learned
    @property
    def observer(self) -> Observer:
        """Who follows the envs; `ConfigError` before training began."""
        if self._observer is None:
            raise ConfigError("training has not begun: call algorithm.learn(..., callback=callback) first")
        return self._observer

    @property
    def world(self) -> WorldModel:
        """What was learned, as of the last `catch_up`; `model` is Stable-Baselines3's name of the algorithm."""
        return cast("WorldModel", self.observer.study.model)  # it was given none of another kind

    @property
    def prequential(self) -> Prequential:
        """How many predictions were wrong, in total and lately."""
        return self.observer.study.prequential

    @property
    def learning(self) -> bool:
        """Whether transitions are being learned from; as of `relgym.wrappers.ModelLearner`."""
        return self._learning

    @learning.setter
    def learning(self, learn: bool) -> None:
        if self._observer is not None:
            self._observer.learning = learn
        self._learning = learn

    def pause(self) -> None:
        """Stop learning, while training goes on; ``learning = True`` goes on."""
        self.learning = False

    @property
    def skipped(self) -> int:
        """How many bad observations, and steps with actions that can't be read, were left out."""
        return 0 if self._observer is None else self._observer.skipped

    @property
    def dropped(self) -> int:
        """How many transitions found the queue to the background process full; kept after `close`."""
        return 0 if self._observer is None else self._observer.dropped

    @property
    def withdrawn(self) -> tuple[Angle, ...]:
        """Guessed angles that were none, so that learning began anew; as of `relgym.wrappers.ModelLearner`."""
        return () if self._observer is None else self._observer.withdrawn

    def catch_up(self) -> WorldModel:
        """Wait until the background process has learned all it was sent; the model as it then is."""
        return cast("WorldModel", self.observer.study.catch_up())

    def save(self, path: str | os.PathLike[str], *, history: bool = False) -> None:
        """Write model, spaces, view and some first scenes to one file, as `ModelLearner.save`."""
        self.observer.save(path, history=history)

    def close(self) -> None:
        """End the background process, if there is one, once it has learned all."""
        self.observer.close()

    def _log(self) -> None:
        try:
            study = self.observer.study
        except ResetNeeded:  # nothing but bad observations so far
            return
        world = study.model
        modes = sum(len(world.modes(t.type, t.property)) for t in world.targets)
        self.logger.record("relgym/transitions", world.seen)
        self.logger.record("relgym/modes", modes)
        self.logger.record("relgym/skipped", self.observer.skipped)
        if study.prequential.steps:
            self.logger.record("relgym/wrong", study.prequential.recent)
            log_quality(self.logger, study.prequential)
        if self._arguments["background"] is not None:
            self.logger.record("relgym/dropped", study.dropped)


def _space(normalised: VecNormalize | None, space: spaces.Space[Any]) -> spaces.Space[Any]:
    """Space of what the envs themselves say."""
    return space if normalised is None else normalised.venv.observation_space


def _schema(env: Any) -> Any:
    """The envs' schema, if they have one."""
    try:
        return env.get_attr("schema", 0)[0]
    except AttributeError:
        return None
