"""Dyna (Sutton 1991) as a callback: off-policy algorithms learn from real and imagined transitions alike."""

from __future__ import annotations

import copy
import warnings
from time import perf_counter
from typing import Any, Final, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.utils import polyak_update
from stable_baselines3.common.vec_env import DummyVecEnv

from relgym.errors import ConfigError
from relgym.wrappers.dyna.config import DynaConfig, checked_config
from relgym.wrappers.dyna.imagination import Imagination, Imagined
from relgym.wrappers.dyna.lens import Lens, Observations
from relgym.wrappers.dyna.reward_models import RewardModel
from relgym.wrappers.dyna.stock import DreamModel
from relgym.wrappers.dyna.trainer import ModelTrainer, check_model, checked_reward_model
from relgym.wrappers.sb3.quality import log_quality
from relgym.wrappers.sb3.replay import MixedNStepReplayBuffer, Mixing

__all__ = ["Dyna", "check_algorithm", "lens_of", "reward_model_of"]

_SHORT: Final = 500
"""A model that isn't accepted after fewer steps may be yet."""


class Dyna(BaseCallback):  # type: ignore[misc]
    """Lets SAC, TD3 or DQN train in a model that learns while they act.

    Before each real step the model predicts what will follow; the prediction is compared with what happens, and then
    the model learns. While its prequential error is small (`ModelAcceptance`), the policy is rolled out in the model
    every few steps, from scenes that were seen, and the algorithm's batches mix imagined with real transitions. While
    it is large, the algorithm runs exactly as Stable-Baselines3 ships it.

    Parameters
    ----------
    model
        What to learn and dream in: a `WorldModel`, a `NeuralWorldModel`, anything with their methods.
    config
        Free parameters.
    reward_model
        Reward and termination of imagined steps; default: the env's own ``task``. ``"learned"``: a neural model
        predicts them itself, and beside any other model a `LearnedRewardModel` learns them.
    like
        An env in the same wrappers as those that the agent acts in; needed where these run in other
        processes.
    verbose
        As in Stable-Baselines3.

    Raises
    ------
    ConfigError
        When training begins: an algorithm that isn't off-policy, a replay buffer that can't mix or has another
        discount, an env without a `TransitionRecorder`, spaces or schemas that don't match, no reward function. While
        it goes on: a reward function that returns NaN.
    QueryError
        A frozen model that knows none of its targets.

    Notes
    -----
    Logged: ``relgym/error``; ``relgym/nrmse``, ``relgym/calibration`` and ``relgym/coverage`` (`Prequential`);
    ``relgym/accepted``, ``relgym/imagined`` (how many so far), ``relgym/dreams_known``, ``relgym/renewals`` (how often
    a replacement took the model's place: `ModelTrainer`), ``relgym/learning_seconds`` and ``relgym/dreaming_seconds``.

    A model that is replaced is left as it is: `world` is the one that is used now.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> from relgym.wrappers.sb3 import Dyna, TransitionRecorder, replay_options
    >>> from stable_baselines3 import SAC  # doctest: +SKIP
    >>> env = TransitionRecorder(gym.make("relgym/TruckPush-v0"))
    >>> model = relgym.WorldModel(env.get_wrapper_attr("schema"))
    >>> agent = SAC("MultiInputPolicy", env, **replay_options(env.observation_space))  # doctest: +SKIP
    >>> agent.learn(2_000, callback=Dyna(model))  # doctest: +SKIP
    """

    def __init__(
        self,
        model: DreamModel,
        config: DynaConfig | None = None,
        *,
        reward_model: RewardModel | Literal["learned"] | None = None,
        like: gym.Env[Any, Any] | None = None,
        verbose: int = 0,
    ) -> None:
        super().__init__(verbose)
        self._given = model
        self.config = checked_config(config)
        self.imagined = 0
        self.dreaming_seconds = 0.0
        self._reward_model = reward_model
        self._like = like
        self._rng = np.random.default_rng([self.config.seed, 0])
        self._dreamed_at = 0
        self._made_up = -1  # verdicts that were known when the agent was last trained in catch-up updates
        self._trained: Any = None  # the agent
        self._usual = 1  # its gradient steps
        self._lent: int | None = None  # those that it has in their place
        self._known = 0.0
        self._mixed: Any = None
        self._trainer: ModelTrainer | None = None
        self._imagination: Imagination | None = None

    @property
    def world(self) -> DreamModel:
        """The model in use: the one that was passed, until a replacement takes its place (`ModelTrainer`)."""
        return self._given if self._trainer is None else self._trainer.model

    @property
    def trainer(self) -> ModelTrainer:
        """The model's trainer: acceptance, stock of scenes, time spent; `ConfigError` before training began."""
        if self._trainer is None:
            raise ConfigError("training has not begun: call algorithm.learn(..., callback=dyna) first")
        return self._trainer

    # ------------------------------------------------------------------ Stable-Baselines3's callback
    def _init_callback(self) -> None:
        check_algorithm(self.model)
        lens = lens_of(self.training_env, self._like)
        _check_spaces(self.model, lens)
        check_model(self.world, lens)
        reward_model = reward_model_of(lens, self._reward_model, self.world)
        if self._trainer is None:  # a second learn() goes on with what is known
            precision = lens.recorder.view.precision
            self._trainer = ModelTrainer(self.world, reward_model, self.config, precision)
        if self._mixed is not self.buffer:  # another agent's, or one that was loaded
            self.buffer.hold(self.config.capacity)
            self._mixed = self.buffer
        again = self._trained is self.model
        if not again:
            self._trained, self._made_up = self.model, -1
        self.buffer.real_ratio = self.config.real_ratio
        self._imagination = Imagination(self.world, lens, self._trainer.reward_model)
        self._renewals = self._trainer.renewals
        self._repeat = lens.repeat
        if again and self.model.gradient_steps == self._lent:  # training was interrupted
            self.model.gradient_steps = self._usual
        self._usual, self._lent = int(self.model.gradient_steps), None
        self._dreamed_at = min(self._dreamed_at, int(self.model.num_timesteps))

    def _on_training_start(self) -> None:
        for steps in self.training_env.env_method("take"):  # made by somebody else, before; real all the same
            for real in steps:
                self.trainer.take_up(real)

    def _on_rollout_start(self) -> None:
        self._give_back()  # what callbacks save between here and the end is the agent's own

    def _on_step(self) -> bool:
        for steps in self.training_env.env_method("take"):
            # Of more than one episode others have made some: an evaluation in this env, a wrapper's reset.
            if len(steps) > self._repeat and not any(real.first for real in steps[1:]):
                raise ConfigError(
                    f"a decision lasted {len(steps)} env steps, but dreamed ones last {self._repeat}: let "
                    "relgym.wrappers.ActionRepeat or gymnasium.wrappers.RepeatAction repeat actions, or put what "
                    "does inside the TransitionRecorder"
                )
            for real in steps:
                self.trainer.take_up(real)
        if self.trainer.renewals != self._renewals:
            self._begin_anew()
        accepted = self.trainer.acceptance.accepted
        if (
            not accepted and self.buffer.imagined.size()
        ):  # what a model dreamed that is wrong is worth nothing
            self.buffer.hold(self.config.capacity)
        if accepted and not self._awake() and (self.buffer.imagined.size() == 0 or self._due()):
            self._dream()
        self.buffer.accepted = accepted
        self._catch_up(accepted)
        self._log()
        return True

    def _on_rollout_end(self) -> None:
        self._lent = self.model.gradient_steps = self._gradient_steps(self.buffer.accepted)

    def _on_training_end(self) -> None:
        self.trainer.catch_up()
        self._complain()
        self._give_back()
        self.buffer.accepted = False  # without this callback nobody refreshes what was dreamed

    def _begin_anew(self) -> None:
        """Use the replacement model from now on; what was imagined before belongs to another world."""
        assert self._imagination is not None, "made when training begins"
        self._imagination = Imagination(self.world, self._imagination.lens, self.trainer.reward_model)
        self._renewals, self._made_up = self.trainer.renewals, -1
        self.buffer.hold(self.config.capacity)

    def _give_back(self) -> None:
        self.model.gradient_steps, self._lent = self._usual, None

    def _complain(self) -> None:
        """Warn if the model was never accepted, and say which features it lacks: else it would go unnoticed."""
        acceptance = self.trainer.acceptance
        if acceptance.switches or self.num_timesteps < _SHORT:
            return
        parts: tuple[Any, ...] = (self.world, getattr(self.trainer.reward_model, "model", None))
        lacks = [f"{each.target}: {each}." for p in parts if hasattr(p, "advice") for each in p.advice()]
        warnings.warn(
            f"the model was never accepted in {self.num_timesteps:,} steps, and nothing was imagined: its error was "
            f"{acceptance.error:.2g}, to be accepted it must fall to {acceptance.accept_at:g}, and it predicted "
            f"{acceptance.known:.0%} of the latest steps. {' '.join(lacks) or 'Give it more steps.'} Features of the "
            "model are switched on in its ModelConfig, those of reward and termination in that of "
            "reward_model=LearnedRewardModel(...)",
            UserWarning,
            stacklevel=2,
        )

    # ------------------------------------------------------------------ dreams
    @property
    def buffer(self) -> Any:
        """The algorithm's replay buffer, a `Mixing` one."""
        return self.model.replay_buffer

    def _due(self) -> bool:
        return bool(self.num_timesteps - self._dreamed_at >= self.config.every)

    def _awake(self) -> bool:
        """Whether the algorithm is still collecting its first steps: what is imagined now would be stale before use."""
        return bool(self.num_timesteps + self.config.every < self.model.learning_starts)

    def _gradient_steps(self, accepted: bool) -> int:
        each = self.config.updates if accepted else self.config.updates_alone
        if each is None:
            return self._usual
        return each * int(self.training_env.num_envs * self.model.train_freq.frequency)

    def _catch_up(self, accepted: bool) -> None:
        """Catch-up updates: gradient steps made at once when the model is first accepted.

        And again when the reward model has learned a reward or an end that it didn't know: neither what was imagined
        before nor the policy trained on it knows of that.
        """
        if not accepted or self.num_timesteps <= self.model.learning_starts or not self.buffer.size():
            return
        known = getattr(self.trainer.reward_model, "verdicts", 0)
        if known <= self._made_up:
            return
        if self._made_up >= 0 and self.config.catch_up:
            self.buffer.hold(self.config.capacity)
        self._made_up = known
        each = self.config.updates * self.config.every  # per round of dreams, as later on
        for done in range(0, self.config.catch_up, each):
            self._dream()
            self.model.train(min(each, self.config.catch_up - done), batch_size=self.model.batch_size)
            self._aim()

    def _aim(self) -> None:
        """Let DQN's target net follow: Stable-Baselines3 does so per real step, and catch-up updates have none."""
        if isinstance(self.model, DQN):
            own, target = self.model.q_net, self.model.q_net_target
            polyak_update(own.parameters(), target.parameters(), self.model.tau)

    def _dream(self) -> None:
        started = perf_counter()
        config = self.config
        layout, vectors = self.trainer.stock.starts(config.dreams, self.world, config, rng=self._rng)
        assert self._imagination is not None, "made when training begins"
        found = self._imagination.dream(layout, vectors, self._act, horizon=config.horizon)
        self._keep(found)
        self._dreamed_at = self.num_timesteps
        self.dreaming_seconds += perf_counter() - started

    def _keep(self, found: Imagined | None) -> None:
        self._known = 0.0 if found is None else found.known
        if found is not None:
            self.buffer.imagine(found)
            self.imagined += len(found)

    def _act(self, seen: Observations) -> tuple[NDArray[Any], NDArray[Any]]:
        """The policy as it explores: actions for the env, and scaled to [-1, 1] for the buffer."""
        normalise = self.model.get_vec_normalize_env()
        shown = seen if normalise is None else normalise.normalize_obs(seen)
        actions, _ = self.model.predict(shown, deterministic=False)
        if not isinstance(self.model.action_space, gym.spaces.Box):
            return actions, actions
        scaled = self.model.policy.scale_action(actions)
        if self.model.action_noise is not None:
            draw = copy.deepcopy(self.model.action_noise)  # its state is that of the real exploration
            noise = np.stack([draw().ravel()[: scaled.shape[1]] for _ in scaled])
            scaled = np.clip(scaled + noise, -1.0, 1.0)
        return self.model.policy.unscale_action(scaled), scaled

    # ------------------------------------------------------------------ the log
    def _log(self) -> None:
        acceptance = self.trainer.acceptance
        record = self.logger.record
        record("relgym/error", acceptance.error)
        log_quality(self.logger, self.trainer.prequential)
        record("relgym/accepted", float(acceptance.accepted))
        record("relgym/imagined", self.imagined)
        record("relgym/dreams_known", self._known)
        record("relgym/renewals", self.trainer.renewals)
        record("relgym/learning_seconds", self.trainer.seconds)
        record("relgym/dreaming_seconds", self.dreaming_seconds)


def lens_of(training_env: Any, like: gym.Env[Any, Any] | None) -> Lens:
    """What the agent sees and does, read from one of its envs.

    Raises
    ------
    ConfigError
        They run in other processes and none was given beside them, or have no `TransitionRecorder`.
    """
    if like is not None:
        return Lens(like)
    inner = training_env
    while hasattr(inner, "venv"):  # wrappers round vector envs
        inner = inner.venv
    if not isinstance(inner, DummyVecEnv):
        raise ConfigError(
            f"the envs of a {type(inner).__name__} can't be looked into: pass like=make_env(), one in the same "
            "wrappers"
        )
    return Lens(inner.envs[0])


def reward_model_of(
    lens: Lens, reward_model: RewardModel | Literal["learned"] | None, model: DreamModel
) -> RewardModel:
    """The reward model: the one given, a learned one, or else the env's own task."""
    if reward_model is not None:
        return checked_reward_model(reward_model, model, lens.recorder.view.schema, lens.acting)
    recorder = lens.recorder
    task = recorder.get_wrapper_attr("task") if recorder.has_wrapper_attr("task") else None
    if task is None:
        raise ConfigError(
            "imagined steps have no reward: pass reward_model='learned', or reward_model= an object with "
            "evaluate(layout, before, actions, after), or give the env a task"
        )
    return checked_reward_model(task, model, recorder.view.schema)


def check_algorithm(algorithm: Any) -> None:
    """Raise `ConfigError` unless an algorithm is off-policy and its replay buffer can mix."""
    if not isinstance(algorithm, OffPolicyAlgorithm):
        raise ConfigError(
            f"{type(algorithm).__name__} is not off-policy and has no replay buffer to mix: take SAC, TD3 or DQN, or "
            "train it in the dream itself (DreamCheckup)"
        )
    if not isinstance(algorithm.replay_buffer, Mixing):
        raise ConfigError(
            f"a {type(algorithm.replay_buffer).__name__} can't mix in what was imagined: make the algorithm with "
            f"{type(algorithm).__name__}(..., **replay_options(env.observation_space))"
        )
    buffer = algorithm.replay_buffer
    if isinstance(buffer, MixedNStepReplayBuffer) and buffer.gamma != algorithm.gamma:
        raise ConfigError(
            f"the buffer's n-step returns discount by {buffer.gamma}, the algorithm by {algorithm.gamma}: make it with "
            f"replay_options(..., n_steps={buffer.n_steps}, gamma={algorithm.gamma})"
        )
    if algorithm.train_freq.unit.value != "step":
        raise ConfigError(
            f"train_freq={tuple(algorithm.train_freq)}: expected steps, since updates are counted per real step"
        )


def _check_spaces(algorithm: Any, lens: Lens) -> None:
    for what in ("observation_space", "action_space"):
        own, seen = getattr(algorithm, what), getattr(lens, what)
        if own != seen:
            raise ConfigError(
                f"the algorithm's {what} is {own}, the env's {seen}: dream in the wrappers that the agent acts in"
            )
