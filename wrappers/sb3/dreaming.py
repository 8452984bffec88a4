"""Training in model roll-outs alone: a vector env for any algorithm, and check-ups in the real world."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from relgym.errors import ConfigError
from relgym.wrappers.dyna.config import DynaConfig, checked_config
from relgym.wrappers.dyna.imagination import Imagination
from relgym.wrappers.dyna.lens import Lens, Observations, picked
from relgym.wrappers.dyna.trainer import ModelTrainer, check_model

__all__ = ["DreamCheckup", "DreamVecEnv", "explore"]


def explore(trainer: ModelTrainer, env: gym.Env[Any, Any], steps: int, *, seed: int) -> None:
    """Let a model learn from random actions in the real env.

    Parameters
    ----------
    trainer
        The model and its stock of scenes; both learn.
    env
        The real env, with a `TransitionRecorder`.
    steps
        Decisions, at least 1.
    seed
        Of env and actions.

    Raises
    ------
    ConfigError
        Less than one step, or an env without a recorder.
    """
    if steps < 1:
        raise ConfigError(f"steps={steps!r}: expected at least 1")
    _check_recorded(env)
    if hasattr(trainer.reward_model, "adopt"):
        trainer.reward_model.adopt(Lens(env).acting)
    env.action_space.seed(seed)
    env.reset(seed=seed)
    for _ in range(steps):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
        for real in env.get_wrapper_attr("take")():
            trainer.take_up(real)
    trainer.catch_up()


class DreamVecEnv(VecEnv):  # type: ignore[misc]
    """Many model roll-outs (dreams) at once, as a vector env in which any algorithm of Stable-Baselines3 can train.

    Dreams begin in scenes that were seen, varied as `DynaConfig` says, and end like real episodes; or they are
    truncated, when the horizon is reached or the model makes no prediction.

    Parameters
    ----------
    trainer
        Model, reward model and stock. The stock must hold scenes (`explore`); the model is used live.
    like
        The env that the agent is to act in, in all its wrappers, a `TransitionRecorder` among them.
    num_envs
        Dreams at once, >= 1.
    config
        Free parameters: horizon, share of first scenes, permutations, seed.

    Raises
    ------
    ConfigError
        No scenes, or a model that doesn't fit the env.
    QueryError
        A model that knows none of its targets.
    """

    def __init__(
        self,
        trainer: ModelTrainer,
        like: gym.Env[Any, Any],
        *,
        num_envs: int = 64,
        config: DynaConfig | None = None,
    ) -> None:
        if num_envs < 1:
            raise ConfigError(f"num_envs={num_envs!r}: expected at least 1")
        self._lens = Lens(like)
        check_model(trainer.model, self._lens, at_once=True)
        self._trainer, self._config = trainer, checked_config(config)
        self._imagination = Imagination(trainer.model, self._lens, trainer.reward_model)
        self._rng = np.random.default_rng([self._config.seed, 3])
        self.render_mode = None
        super().__init__(num_envs, self._lens.observation_space, self._lens.action_space)
        self._layout, self._vectors = trainer.stock.draw(num_envs, from_start=1.0, rng=self._rng)
        self._steps = np.zeros(num_envs, dtype=np.int64)
        self._actions: Any = None

    # ------------------------------------------------------------------ Stable-Baselines3's vector env
    def reset(self) -> Observations:
        """Begin all dreams anew."""
        self._vectors = self._starts(self.num_envs)
        self._steps[:] = 0
        return self._seen()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Remember what is to be done."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Dream on by one decision; dreams that ended begin anew."""
        if self._imagination.model is not self._trainer.model:  # a replacement has taken its place
            self._imagination = Imagination(self._trainer.model, self._lens, self._trainer.reward_model)
        done = self._lens.actions(self._actions)
        after, rewards, ended, known = self._imagination.follow(self._layout, self._vectors, done)
        self._vectors = np.where(known[:, None], after, self._vectors)
        self._steps += 1
        late = ~ended & (~known | (self._steps >= self._config.horizon))
        over = np.flatnonzero(ended | late)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        seen = self._seen()
        for k in over.tolist():
            infos[k] = {"terminal_observation": picked(seen, k), "TimeLimit.truncated": bool(late[k])}
        if len(over):
            self._vectors[over] = self._starts(len(over))
            self._steps[over] = 0
            seen = self._seen()
        return seen, np.where(known, rewards, 0.0).astype(np.float32), ended | late, infos

    def close(self) -> None:
        """Nothing to close."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute, once per dream."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """All dreams share what they have: it can't be set for one."""
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method, once per dream."""
        return [getattr(self, method_name)(*args, **kwargs) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Dreams have no wrappers; `Lens` does what they would do."""
        return [False for _ in self._get_indices(indices)]

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed what dreams draw."""
        if seed is not None:
            self._rng = np.random.default_rng([seed, 3])
        return [seed] * int(self.num_envs)

    # ------------------------------------------------------------------ helpers
    def _starts(self, n: int) -> NDArray[np.float64]:
        stock, model = self._trainer.stock, self._trainer.model
        return stock.starts(n, model, self._config, rng=self._rng, layout=self._layout)[1]

    def _seen(self) -> Observations:
        return self._lens.observations(self._layout, self._vectors)


class DreamCheckup(BaseCallback):  # type: ignore[misc]
    """Tests an agent that trains in dreams in the real env now and then.

    The model predicts each real step, is compared with it and learns from it. Once it is rejected, training stops with
    a warning: what an agent learns in a wrong model is worth nothing.

    Parameters
    ----------
    trainer
        The trainer of the model.
    env
        The real env, in the wrappers that the dream imitates.
    every
        Dreamed steps between two check-ups, >= 1.
    episodes
        Real episodes of each, >= 1.
    seed
        Of the first real episode; later ones count on.

    Attributes
    ----------
    history : list of (int, int, float, float)
        Of every check-up: imagined steps, real steps so far, share of successes, the model's prequential error.

    Raises
    ------
    ConfigError
        A count below 1, an env without a recorder; or when training begins, a model that isn't accepted.

    Notes
    -----
    Logged: ``relgym/real_success``, ``relgym/real_return``, ``relgym/real_steps``, ``relgym/error``.
    """

    def __init__(
        self,
        trainer: ModelTrainer,
        env: gym.Env[Any, Any],
        *,
        every: int = 5_000,
        episodes: int = 10,
        seed: int = 0,
    ) -> None:
        super().__init__()
        for name, value in {"every": every, "episodes": episodes}.items():
            if value < 1:
                raise ConfigError(f"{name}={value!r}: expected at least 1")
        _check_recorded(env)
        self.trainer, self.env = trainer, env
        self.every, self.episodes = every, episodes
        self.history: list[tuple[int, int, float, float]] = []
        self._seed, self._real_steps, self._next = seed, 0, 0

    def _on_training_start(self) -> None:
        acceptance = self.trainer.acceptance
        if not acceptance.accepted:
            raise ConfigError(
                f"the model isn't accepted: its error is {acceptance.error:.3g}, it is accepted at "
                f"{acceptance.accept_at:g}, and it predicted {acceptance.known:.0%} of the latest real steps: let it "
                "learn from more of them (explore) before an agent trains in it"
            )
        if (
            self.history and self.num_timesteps < self.history[-1][0]
        ):  # another learn() that counts from 0 again
            self._next = self.num_timesteps

    def _on_step(self) -> bool:
        if self.num_timesteps < self._next:
            return True
        self._next = self.num_timesteps + self.every
        played = [self._play() for _ in range(self.episodes)]
        acceptance = self.trainer.acceptance
        success, returned = (float(np.mean(part)) for part in zip(*played, strict=True))
        self.history.append((self.num_timesteps, self._real_steps, success, acceptance.error))
        self.logger.record("relgym/real_success", success)
        self.logger.record("relgym/real_return", returned)
        self.logger.record("relgym/real_steps", self._real_steps)
        self.logger.record("relgym/error", acceptance.error)
        if not acceptance.accepted:
            warnings.warn(
                f"training stops after {self.num_timesteps} imagined steps: the model's error in the real world is "
                f"{acceptance.error:.3g}, and from {acceptance.reject_at:g} on it is rejected",
                stacklevel=2,
            )
        return acceptance.accepted

    def _play(self) -> tuple[bool, float]:
        """One real episode with the agent's best actions: whether it succeeded, and the sum of rewards."""
        seen, _ = self.env.reset(seed=self._seed)
        self._seed += 1
        total, over = 0.0, False
        info: dict[str, Any] = {}
        normalise = self.model.get_vec_normalize_env()
        while not over:
            shown = seen if normalise is None else normalise.normalize_obs(seen)
            action, _ = self.model.predict(shown, deterministic=True)
            seen, reward, terminated, truncated, info = self.env.step(action)
            total, over = total + float(reward), terminated or truncated
            for real in self.env.get_wrapper_attr("take")():
                self.trainer.take_up(real)
                self._real_steps += 1
        return bool(info.get("is_success", False)), total


def _check_recorded(env: gym.Env[Any, Any]) -> None:
    if not env.has_wrapper_attr("take"):
        raise ConfigError(
            f"{env} has no TransitionRecorder: put one directly round the bare env, inside all wrappers that change "
            "observations or actions"
        )
