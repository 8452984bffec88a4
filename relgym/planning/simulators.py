"""What planners search in: from n states and n actions to what follows, whoever knows it."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.arguments import array_of, refusing_calls
from relgym.envs.arguments import checked_count
from relgym.envs.base import SceneEnv
from relgym.envs.dreams.rewards import BatchStepEvaluator, TaskFunctions, check_reward_functions
from relgym.envs.dreams.setting import Setting
from relgym.envs.dreams.step import DreamStep
from relgym.envs.views import View
from relgym.errors import ConfigError, ObservationError, RelgymError
from relgym.model.world_model import WorldModel
from relgym.planning.guessing import Guessing
from relgym.scene.objects import Float1D, Float2D, Scene

__all__ = ["Correctable", "EnvSimulator", "ModelSimulator", "Simulator", "Steps"]


@dataclass(frozen=True, slots=True)
class Steps:
    """What n decisions led to; everything has a leading axis of length n.

    Attributes
    ----------
    states
        State vectors afterwards; where the outcome isn't known, the last ones that are.
    rewards
        Sum over the steps that a decision lasts.
    terminated
        Whether the episode is over.
    known
        Whether the simulator knows the outcome.
    """

    states: Float2D
    rewards: Float1D
    terminated: NDArray[np.bool_]
    known: NDArray[np.bool_]


@runtime_checkable
class Simulator(Protocol):
    """What a planner asks of a world: anything that can be set to many states at once and stepped."""

    @property
    def action_space(self) -> spaces.Space[Any]:
        """Space of one action."""
        ...

    @property
    def observation_space(self) -> spaces.Space[Any]:
        """Space of one observation."""
        ...

    def state(self, observation: Any) -> Float1D:
        """State vector that an observation (or a `Scene`) shows."""
        ...

    def prepare(self) -> None:
        """Take note of what was learned since; called before each search."""
        ...

    def step(self, states: Float2D, actions: NDArray[Any]) -> Steps:
        """Follow n actions from n states; the states are not changed."""
        ...


@runtime_checkable
class Correctable(Protocol):
    """A simulator that may err, and takes advice of how."""

    def corrected(self, error: Float1D | None, *, guesses: bool = False) -> Simulator:
        """The same simulator, with a correction.

        Parameters
        ----------
        error
            What is added to the state after each decision, shape ``(width,)``; None: nothing.
        guesses
            Whether it guesses where it knows no outcome, and says that it knows.
        """
        ...


@refusing_calls(ConfigError)
class ModelSimulator:
    """A learned model as a simulator; live, so that what it learns in the meantime counts.

    Parameters
    ----------
    model
        The model.
    like
        The real env, or one with the same spaces; default: what the model's file says of its env. Its `task` gives
        reward and termination unless `task` does.
    view
        The view through which the model sees observations; default: the one it was learned through.
    task
        Reward and termination: an object with functions `rewards` and `terminations` of arrays, such as an env's task
        or `relgym.wrappers.sb3.LearnedRewardModel`. Default: that of `like`, or what the model
        predicts of the object `task`.
    repeat
        Env steps that a decision lasts (`relgym.wrappers.ActionRepeat`).
    min_margin
        Least margin, in log-odds, of a prediction that counts as known.

    Raises
    ------
    ConfigError, QueryError
        As for `LearnedModelVectorEnv`.

    Notes
    -----
    Cost: one `WorldModel.predict_batch` for each env step, for all states together.
    """

    def __init__(
        self,
        model: WorldModel,
        like: gym.Env[Any, Any] | Scene | None = None,
        *,
        view: View | None = None,
        task: TaskFunctions | None = None,
        repeat: int = 1,
        min_margin: float = 0.0,
    ) -> None:
        self._setting = Setting.of(model, like, view, snapshot=False)
        self._task = self._setting.task if task is None else task
        check_reward_functions(None, None, self._task, model, batched=True, at_once=False)
        self.model = model
        self.repeat = checked_count("repeat", repeat, 1, 10**6)
        self._actions = self._setting.shown.deeds()
        self._margin = float(min_margin)
        self._error: Float1D | None = None
        self._guesses = False
        self.prepare()

    @property
    def action_space(self) -> spaces.Space[Any]:
        """Space of one action."""
        return self._setting.action_space

    @property
    def observation_space(self) -> spaces.Space[Any]:
        """Space of one observation."""
        return self._setting.observation_space

    def state(self, observation: Any) -> Float1D:
        """State vector that an observation (or a `Scene`) shows.

        Raises
        ------
        ObservationError
            Not an observation of the env that the model was learned in.
        """
        if isinstance(observation, Scene):
            return self._setting.fitted_vector(observation)
        view = self._setting.view
        try:
            scene = self._setting.schema.scene(observation) if view is None else view.scene(observation, {})
        except RelgymError as error:
            raise ObservationError(
                f"the planner can't read this observation ({error}): expected one of {self.observation_space}; "
                "round a wrapper that shows something else pass source=function from observation to scene"
            ) from None
        return self._setting.fitted_vector(scene)

    def prepare(self) -> None:
        """Settle who says what steps are worth; a live model may have learned it by now."""
        place = self._setting
        evaluates = BatchStepEvaluator.of(None, None, self._task, self.model, place.layout)
        corrects = None if self._error is None else self._correct
        self._within = DreamStep(
            place,
            evaluates,
            self._task,
            self._actions,
            None,
            self._margin,
            guesses=self._guesses,
            predicts=Guessing(self.model).predict_batch if self._guesses else None,
        )
        self._last = replace(self._within, corrected=corrects)
        self._low, self._high = self._limits()

    def corrected(self, error: Float1D | None, *, guesses: bool = False) -> ModelSimulator:
        """The same simulator, with a correction that ends at the model's limits; see `Correctable`.

        Of a decision of several steps only the state after the last one is corrected. What a limit cuts off, a truck
        that has come to rest, is as the limit says, and no correction leads beyond a limit: nothing of a state is
        corrected by a larger share than what meets its limit first.
        """
        found = copy.copy(self)
        found._error, found._guesses = error, guesses
        found.prepare()
        return found

    def _limits(self) -> tuple[Float1D, Float1D]:
        """The least and the most that the model knows of each column, shape ``(width,)``; infinite without a limit."""
        layout = self._setting.layout
        low, high = np.full(layout.width, -np.inf), np.full(layout.width, np.inf)
        for target in self.model.targets:
            known = self.model.property_model(target.type, target.property).limits
            for k in layout.of_type(target.type):
                column = layout.column(k, target.property)
                low[column], high[column] = known.least, known.most
        return low, high

    def _correct(self, states: Float2D) -> Float2D:
        """Predicted states with the error added, as far as limits allow."""
        assert self._error is not None, "asked only then"
        columns = np.flatnonzero(self._error)
        error, found = self._error[columns], states[:, columns]
        low, high = self._low[columns], self._high[columns]
        room = np.where(error < 0.0, low - found, high - found) / error
        room[(found <= low) | (found >= high)] = 0.0
        share = np.clip(room.min(axis=1, initial=1.0), 0.0, 1.0)
        corrected: Float2D = states + share[:, None] * self._error
        # To the last bit: whether something rests is asked of zero itself.
        corrected[:, columns] = np.clip(corrected[:, columns], low, high)
        return corrected

    def step(self, states: Float2D, actions: NDArray[Any]) -> Steps:
        """Follow n actions from n states."""
        states = array_of("states", states, (None, self._setting.layout.width), ConfigError)
        count = len(states)
        found, rewards = states.copy(), np.zeros(count)
        ended, known = np.zeros(count, dtype=np.bool_), np.ones(count, dtype=np.bool_)
        once = np.zeros(count, dtype=np.int64)
        acts = _actions(actions, count, self.action_space)
        for k in range(self.repeat):
            left = np.flatnonzero(known & ~ended)
            if not len(left):
                break
            going = left if len(left) < count else slice(None)  # which copies nothing
            follow = self._last if k == self.repeat - 1 else self._within
            stepped = follow(found[going], once[going], acts[going])
            found[going] = stepped.vectors
            rewards[going] += stepped.rewards
            ended[going], known[going] = stepped.terminated, ~stepped.truncated
        return Steps(found, rewards, ended, known)


@refusing_calls(ConfigError)
class EnvSimulator:
    """An exact env as a simulator, one state after another: the ceiling for what a model can do.

    Parameters
    ----------
    env
        An env of relgym's, whose state is its scene (`SceneEnv.set_state`); a copy of it is stepped.
    repeat
        Env steps that a decision lasts.

    Raises
    ------
    ConfigError
        Not such an env, or one without a task.

    Notes
    -----
    Cost: one step of the env for each state, some 30 µs; nothing is done at once.
    """

    def __init__(self, env: gym.Env[Any, Any], *, repeat: int = 1) -> None:
        inner = env.unwrapped
        if not isinstance(inner, SceneEnv) or inner.task is None:
            raise ConfigError(
                f"{env}: expected an env of relgym's with a task, whose state can be set; of any other learn a model "
                "and plan with ModelSimulator(model)"
            )
        self._env = copy.deepcopy(inner)
        self._env.reset(seed=0)
        self.repeat = checked_count("repeat", repeat, 1, 10**6)
        self._layout = self._env.scene.layout

    @property
    def action_space(self) -> spaces.Space[Any]:
        """Space of one action."""
        return self._env.action_space

    @property
    def observation_space(self) -> spaces.Space[Any]:
        """Space of one observation."""
        return self._env.observation_space

    def state(self, observation: Any) -> Float1D:
        """State vector that an observation (or a `Scene`) shows."""
        scene = observation if isinstance(observation, Scene) else self._env.schema.scene(observation)
        self._layout = scene.layout
        return scene.vector

    def prepare(self) -> None:
        """Nothing to do: an engine learns nothing."""

    def step(self, states: Float2D, actions: NDArray[Any]) -> Steps:
        """Follow n actions from n states, one after the other."""
        states = array_of("states", states, (None, self._layout.width), ConfigError)
        actions = _actions(actions, len(states), self.action_space)
        found, rewards = np.empty_like(states), np.zeros(len(states))
        ended = np.zeros(len(states), dtype=np.bool_)
        for k, (state, action) in enumerate(zip(states, actions, strict=True)):
            self._env.set_state(Scene(self._env.schema, self._layout, state.copy()))
            for _ in range(self.repeat):
                _, reward, over, _, _ = self._env.step(action)
                rewards[k] += float(reward)
                if over:
                    ended[k] = True
                    break
            found[k] = self._env.vector
        return Steps(found, rewards, ended, np.ones(len(states), dtype=np.bool_))


def _actions(actions: Any, count: int, space: spaces.Space[Any]) -> NDArray[Any]:
    """`count` actions as an array; `ConfigError` unless their shape is that of the space's."""
    acts = np.asarray(actions)
    if acts.shape != (count, *(space.shape or ())) or acts.dtype.kind not in "biuf":
        raise ConfigError(
            f"actions: expected {count} actions of {space}, got shape {acts.shape}, dtype {acts.dtype}"
        )
    return acts.astype(np.float64) if isinstance(space, spaces.Box) else acts
