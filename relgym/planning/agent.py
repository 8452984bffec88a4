"""An agent that learns a model, plans in it, and goes where the model is ignorant."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.envs.arguments import checked_count, checked_least
from relgym.envs.learned_model_rewards import TaskFunctions
from relgym.errors import ConfigError, QueryError
from relgym.model.world_model import WorldModel
from relgym.planning.exploration import Coverage
from relgym.planning.planner import Planner, PlannerState, States
from relgym.planning.rollouts import Objective
from relgym.planning.sequences import Search
from relgym.planning.simulators import ModelSimulator
from relgym.planning.tree import TreeSearch
from relgym.scene.objects import TASK, SceneLayout
from relgym.wrappers.action_repeat import ActionRepeat
from relgym.wrappers.sb3.config import DynaConfig
from relgym.wrappers.sb3.recorder import TransitionRecorder
from relgym.wrappers.sb3.stock import changing
from relgym.wrappers.sb3.trainer import ModelTrainer
from relgym.wrappers.views import ViewLike

__all__ = ["PlanningAgent"]


class PlanningAgent:
    """Learns a world's dynamics, reward and termination while it acts, and acts by planning in what it has learned.

    Parameters
    ----------
    env
        The env to learn in; any that `TransitionRecorder` takes.
    model
        The model to go on with; default: a new one.
    config
        Of the new model.
    task
        Reward and termination: ``"learned"``, ``"given"`` (the env's own `task`), or a task.
    view
        How observations become scenes, as for `TransitionRecorder`.
    search
        How to plan; default: `TreeSearch`.
    repeat
        Env steps that a decision lasts.
    random_steps
        Decisions at random at first, each action held for a while.
    exploration
        What a state that shows nothing but new pairs of values is worth while learning, in units of the largest reward
        that one step has paid so far (in absolute terms); 0: it does what the model says pays. Steps of unknown outcome
        count as entirely new.
    commit, tolerance, seed
        As for `Planner`.

    Attributes
    ----------
    trainer : ModelTrainer
        The model, how far it is to be trusted, and what has been learned of the task.
    coverage : Coverage or None
        What has been seen; made with the first step.
    steps : int
        Real env steps so far.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> from relgym.planning import CrossEntropy
    >>> agent = PlanningAgent(gym.make("relgym/TruckPush-v0"), search=CrossEntropy(candidates=16, rounds=1))
    >>> agent.learn(8).steps
    8
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        model: WorldModel | None = None,
        *,
        config: ModelConfig | None = None,
        task: Any = "learned",
        view: ViewLike = None,
        search: Search | None = None,
        repeat: int = 1,
        random_steps: int = 50,
        exploration: float = 0.3,
        commit: int | None = None,
        tolerance: float = 1e-6,
        seed: int = 0,
    ) -> None:
        self._recorder = TransitionRecorder(env, view=view)
        self.repeat = checked_count("repeat", repeat, 1, 10**6)
        self.env: gym.Env[Any, Any] = (
            ActionRepeat(self._recorder, self.repeat) if repeat > 1 else self._recorder
        )
        self.exploration = checked_least("exploration", exploration, 0.0)
        if model is None:
            model = WorldModel(self._recorder.view.schema, config)
        self.trainer = ModelTrainer(
            model, _task(task, env), DynaConfig(shuffle=0, seed=checked_count("seed", seed, 0, 2**31))
        )
        self.random_steps = checked_count("random_steps", random_steps, 0, 10**9)
        self.coverage: Coverage | None = None
        self.steps = 0
        self._like = env
        self._search = TreeSearch() if search is None else search
        self._options = {"commit": commit, "tolerance": tolerance, "seed": seed}
        self._rng = np.random.default_rng([seed, 5])
        self._largest = 0.0
        self._held: tuple[int, Any] = (0, None)
        self._thread: PlannerState | None = None
        self._observation: Any = None
        self._planner: Planner | None = None

    @property
    def model(self) -> WorldModel:
        """The model at work."""
        model = self.trainer.model
        assert isinstance(model, WorldModel), "made by the agent, or checked by the trainer"
        return model

    def planner(self, *, explores: bool = False) -> Planner:
        """A planner in what has been learned; it follows the model as that learns on.

        Parameters
        ----------
        explores
            Whether to look for what is new besides what pays.

        Raises
        ------
        QueryError
            The model knows none of its targets yet.
        """
        simulator = ModelSimulator(
            self.model,
            self._like,
            task=cast(TaskFunctions, self.trainer.reward_model),
            repeat=self.repeat,
        )
        objective = Objective()
        if explores and self.exploration > 0.0 and self.coverage is not None:
            weight = self.exploration * (self._largest or 1.0)
            objective = Objective(bonus=self.coverage.bonus(weight), curiosity=weight)
        return Planner(simulator, self._search, objective, **self._options)  # type: ignore[arg-type]

    def learn(
        self, total_steps: int, callback: Callable[[PlanningAgent], bool | None] | None = None
    ) -> PlanningAgent:
        """Act, explore and learn until the env has been stepped `total_steps` times in all, or a little longer.

        Parameters
        ----------
        total_steps
            Real env steps, those of earlier calls included.
        callback
            Called with the agent after each decision; false ends learning.
        """
        while self.steps < total_steps:
            if self._observation is None:
                self._observation, _ = self.env.reset(seed=int(self._rng.integers(2**31)))
                self._thread, self._held = PlannerState(), (0, None)
            action = self._choose(self._observation)
            self._observation, _, terminated, truncated, _ = self.env.step(action)
            for real in self._recorder.take():
                self.trainer.take_up(real)
                self.steps += 1
                self._largest = max(self._largest, abs(real.reward))
                self._cover(real.transition.after.layout).add(real.transition.after.vector)
            if terminated or truncated:
                self._observation = None
            if callback is not None and callback(self) is False:
                break
        return self

    def predict(
        self,
        observation: Any,
        state: States | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, States]:
        """Choose what pays; as `Planner.predict`."""
        if self._planner is None or self._planner.simulator.model is not self.model:  # type: ignore[attr-defined]
            self._planner = self.planner()
        return self._planner.predict(observation, state, episode_start, deterministic)

    def _choose(self, observation: Any) -> Any:
        """A random action at first and while nothing is known; then the first of a plan."""
        if self.steps >= self.random_steps:
            try:
                planner = self.planner(explores=True)
                assert self._thread is not None, "made with the episode"
                return planner.act(observation, self._thread)
            except QueryError:  # no target known yet
                pass
        left, action = self._held
        if left == 0:
            left, action = int(self._rng.integers(1, 9)), self._drawn()
        self._held = (left - 1, action)
        return action

    def _drawn(self) -> Any:
        space = self.env.action_space
        if isinstance(space, gym.spaces.Box):
            return self._rng.uniform(space.low, space.high).astype(space.dtype)
        space.seed(int(self._rng.integers(2**31)))
        return space.sample()

    def _cover(self, layout: SceneLayout) -> Coverage:
        """What is covered: the properties that may change, of objects of the first layout."""
        if self.coverage is None:
            moving = changing(self.model) if self.model.targets else None
            columns = [
                layout.column(index, prop)
                for index, t in enumerate(layout.types)
                if t.name != TASK
                for prop in t.properties
                if moving is None or (t.name, prop) in moving
            ]
            self.coverage = Coverage(columns)
        return self.coverage


def _task(task: Any, env: gym.Env[Any, Any]) -> Any:
    if isinstance(task, str) and task == "given":
        own = getattr(env.unwrapped, "task", None)
        if own is None:
            raise ConfigError(
                f"task='given': {env} has no task that says what steps are worth; pass task='learned'"
            )
        return own
    if isinstance(task, str) and task != "learned":
        raise ConfigError(f"task={task!r}: expected 'learned', 'given' or a task")
    return task
