"""An agent that learns a model, plans in it, and goes where the model is ignorant."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing_calls
from relgym.config import ModelConfig
from relgym.envs.arguments import checked_count, checked_least
from relgym.envs.dreams.rewards import TaskFunctions
from relgym.errors import ConfigError, QueryError
from relgym.model.world_model import WorldModel
from relgym.numeric.changes import changed_at
from relgym.planning.doubts import DoubtedTask, OptimisticTask
from relgym.planning.exploration import Coverage, Familiar, NoTask, relative_columns
from relgym.planning.planner import Planner, PlannerState, States
from relgym.planning.review import learned_again, length, missed, mixed, off_by, right
from relgym.planning.rollouts import Objective
from relgym.planning.sequences import Search
from relgym.planning.simulators import ModelSimulator, Simulator
from relgym.planning.tree import TreeSearch
from relgym.scene.objects import Float1D, Scene, Transition
from relgym.wrappers.action_repeat import ActionRepeat
from relgym.wrappers.dyna.acceptance import Spread
from relgym.wrappers.dyna.config import DynaConfig
from relgym.wrappers.dyna.lens import Lens
from relgym.wrappers.dyna.recorder import Experience, TransitionRecorder
from relgym.wrappers.dyna.reward_models import LearnedRewardModel, RewardModel
from relgym.wrappers.dyna.stock import DreamModel, changing
from relgym.wrappers.dyna.trainer import ModelTrainer, check_model
from relgym.wrappers.views import ViewLike

__all__ = ["PlanningAgent"]

_GROWTH: Final = 1.1
"""Between two reviews the agent's experience grows by this factor: all of them together cost as much as to learn from
everything some ten times, for each order, but they only take place while the model is wrong."""

_IN_VAIN: Final = 2.0
"""The same after a review whose best model still misses more than half of what was seen: no exact law of the forms that
are looked for covers it, and as many orders of a few more steps won't find one."""

_ORDERS: Final = 6
"""Random orders that a review tries at most: of few steps one may miss what another finds. Two that come to the same
end it."""

_TASK_ORDERS: Final = 3
"""The same for reward and end, which are compared by a count of mistakes alone: two counts may agree by chance."""

_FIRST_REVIEW: Final = 100
"""Real steps before the first review, and after a change of the world before one by what came since."""

_REMEMBERED: Final = 5_000
"""Latest real steps that a review looks at."""

_HOLDS: Final = (1, 2, 4, 8)
"""Decisions that a random action may be held for: what is drawn anew each time tells the laws best, and what is held
leads somewhere."""

_SHARES: Final = tuple(1 / hold / sum(1 / each for each in _HOLDS) for hold in _HOLDS)
"""How often: as many different actions of each."""

_LENGTHS: Final = (1, 2, 4, 8, 16, 32, 64)
"""Decisions after which an episode of random actions may be cut short. What is drawn once an episode, such as a
friction or an order of objects, is one example of it, however long the episode; but limits and ends lie further on."""

_LENGTH_SHARES: Final = tuple(1 / length / sum(1 / each for each in _LENGTHS) for length in _LENGTHS)
"""How often: as many steps of each."""

_DIFFERENT: Final = 4
"""Different actions at least that are drawn for an episode that lasts so long. From rest an action that is held looks
as if every speed were twice the last one; few numbers say that, and it holds of many short episodes."""

_BANG: Final = 0.5
"""Share of the random actions whose every component is at one end of its range or the other, as where systems are
identified with binary noise: nothing excites a world more, and limits show where it is driven to them."""

_LATEST: Final = 50
"""Latest real steps by which the agent doubts its model."""


@refusing_calls(ConfigError)
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
        Reward and termination: ``"learned"``, ``"given"`` (the env's own `task`), or a task. None: no step is worth
        anything, and what the env pays is left out; the agent only learns how the world moves, and goes where it
        doesn't know that, with all its plans.
    view
        How observations become scenes, as for `TransitionRecorder`.
    search
        How to plan; default: `TreeSearch`.
    repeat
        Env steps that a decision lasts.
    random_steps
        Steps at random at first; in each episode actions are held for another number of decisions.
    restarts
        Whether it may begin a new episode when it likes: most of those at random are then short, and teach more of what
        differs between episodes. Leave it out where a reset is expensive; steps are counted, resets aren't.
    exploration
        What a state that shows nothing but new pairs of values is worth while learning, in units of what a step pays
        (root mean square so far); 0: it does what the model says pays. Steps of unknown outcome count as entirely new,
        and without a task as if all that follows were new, too.
    discount
        Of each decision: what comes sooner is surer, and episodes may be cut short.
    safe
        Whether `predict` stays where it has been: what no real step has shown counts as unknown (`Familiar`), and no
        action of unknown outcome is taken while there is another. `learn` explores all the same.
    commit, tolerance, seed
        As for `Planner`.
    simulator
        Function from what has been learned to where plans are searched for; default: a `ModelSimulator`, of a
        `WorldModel`. Other models need one.

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

    DISCOUNT: Final = 0.97
    """Of each decision, unless the user says otherwise: some thirty decisions ahead count."""

    def __init__(
        self,
        env: gym.Env[Any, Any],
        model: DreamModel | None = None,
        *,
        config: ModelConfig | None = None,
        task: Any = "learned",
        view: ViewLike = None,
        search: Search | None = None,
        repeat: int = 1,
        random_steps: int = 100,
        restarts: bool = True,
        exploration: float = 0.5,
        discount: float = DISCOUNT,
        safe: bool = False,
        commit: int | None = None,
        tolerance: float = 1e-6,
        seed: int = 0,
        simulator: Callable[[ModelTrainer], Simulator] | None = None,
    ) -> None:
        self._recorder = TransitionRecorder(env, view=view)
        self.repeat = checked_count("repeat", repeat, 1, 10**6)
        self.env: gym.Env[Any, Any] = (
            ActionRepeat(self._recorder, self.repeat) if repeat > 1 else self._recorder
        )
        self.exploration = checked_least("exploration", exploration, 0.0)
        if task is None and not self.exploration:
            raise ConfigError(
                "task=None, exploration=0.0: nothing to act for; expected a task, or exploration above 0"
            )
        self.discount, self.safe = Objective(discount=discount).discount, safe
        if model is None:
            model = WorldModel(self._recorder.view.schema, config)
        check_model(model, Lens(self._recorder))
        self._matters = getattr(model, "config", ModelConfig()).claim_error
        options = DynaConfig(shuffle=0, seed=checked_count("seed", seed, 0, 2**31))
        if isinstance(model, WorldModel):  # reviews replace it
            options = replace(options, renew=0)
        self.trainer = ModelTrainer(model, _task(task, env), options, self._recorder.view.precision)
        adopt = getattr(self.trainer.reward_model, "adopt", None)
        if adopt is not None:  # it is asked about actions as the env understands them
            adopt(Lens(self._recorder).acting)
        self.random_steps = checked_count("random_steps", random_steps, 0, 10**9)
        self.restarts = restarts
        self.coverage: Coverage | None = None
        self.steps = 0
        self._like, self._simulator = env, simulator
        self._search = TreeSearch() if search is None else search
        self._seed, self._doubted = seed, cast(DoubtedTask | None, None)
        self._options = {"commit": commit, "tolerance": tolerance, "seed": seed}
        self._rng = np.random.default_rng([seed, 5])
        self._history: deque[Experience] = deque(maxlen=_REMEMBERED)
        self._episodes: deque[int] = deque(maxlen=_REMEMBERED)
        self._begun = 0
        self._wrong: deque[bool] = deque(maxlen=_REMEMBERED)  # at all, since the model took over
        self._off: deque[bool] = deque(maxlen=_LATEST)  # by more than matters
        self._exact = isinstance(model, WorldModel)  # whether its laws are, as far as is known
        self._at_random = True
        self._next_review = self._next_after_change = _FIRST_REVIEW
        self._next_again = 0  # before that no other order is tried
        self._size = Spread()
        self._has_task = task is not None
        spec = env.spec
        self._limit: int | None = None
        if spec is not None and spec.max_episode_steps is not None:
            self._limit = -(-spec.max_episode_steps // self.repeat)
        self._hold, self._lasts = 1, cast(int | None, None)
        self._held: tuple[int, Any] = (0, None)
        self._thread: PlannerState | None = None
        self._observation: Any = None
        self._planners: dict[bool, tuple[Any, Any, Planner]] = {}

    @property
    def model(self) -> Any:
        """The model at work: a `WorldModel`, unless another one was passed."""
        return self.trainer.model

    @property
    def ready(self) -> bool:
        """Whether the steps at random are over and there is a model to plan in."""
        return self.steps >= self.random_steps and bool(self.model.targets)

    @property
    def doubt(self) -> float:
        """Share of the latest real steps of which the model predicted the next scene wrongly, or not at all.

        Where no exact laws are found (`_review`), and of models that have none, values count, and only what is off by
        more than a share of what usually changes (`ModelConfig.claim_error`): they will always be a little off.
        With a task so many episodes are spent on random actions: a plan in a model that is wrong is no better, and
        teaches less.
        """
        latest = list(self._wrong)[-_LATEST:] if self._exact else self._off
        return sum(latest) / len(latest) if latest else 1.0

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
        if self._simulator is not None:
            simulator: Simulator = self._simulator(self.trainer)
        else:
            task = cast(TaskFunctions, self._task(explores=explores))
            simulator = ModelSimulator(
                self.model, self._like, view=self._recorder.view, task=task, repeat=self.repeat
            )
        safe = self.safe and not explores
        if safe and self.coverage is not None:
            simulator = Familiar(simulator, self.coverage)
        objective, options = self._objective(explores=explores), {"safe": safe, "limit": self._limit}
        return Planner(simulator, self._search, objective, **options, **self._options)  # type: ignore[arg-type]

    def _task(self, *, explores: bool) -> Any:
        """What steps are worth in plans, as far as what was seen bears it out: in expectation, or at best."""
        own = self.trainer.reward_model
        if not isinstance(own, LearnedRewardModel):
            return own
        if self._doubted is None or self._doubted.model is not own:
            self._doubted = DoubtedTask(own, seed=self._seed)
        return OptimisticTask(self._doubted) if explores and self.exploration > 0.0 else self._doubted

    def _objective(self, *, explores: bool) -> Objective:
        objective = Objective(discount=self.discount)
        if not (explores and self.exploration > 0.0) or self.coverage is None:
            return objective
        weight = self.exploration * (self._size.scale or 1.0)
        curiosity = weight
        if not self._has_task:  # no plan that stays within what is known is worth as much
            curiosity *= self._search.horizon if self.discount == 1.0 else 1.0 / (1.0 - self.discount)
        return replace(objective, bonus=self.coverage.bonus(weight), curiosity=curiosity)

    def _at_work(self, *, explores: bool) -> Planner:
        """The planner for what has been learned by now; made anew only when another model takes over."""
        found, task = self._planners.get(explores), self.trainer.reward_model
        if found is None or found[0] is not self.model or found[1] is not task:
            found = self._planners[explores] = self.model, task, self.planner(explores=explores)
        planner = found[2]
        planner.objective, planner.limit = self._objective(explores=explores), self._limit
        return planner

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
        checked_count("total_steps", total_steps, 0, 10**9)
        if callback is not None and not callable(callback):
            raise ConfigError(f"callback={callback!r:.80}: expected a function of the agent, or None")
        while self.steps < total_steps:
            if self._observation is None:
                self._observation, _ = self.env.reset(seed=int(self._rng.integers(2**31)))
                self._thread, self._held = PlannerState(), (0, None)
                self._begun += 1
                # Who only wants to know plans with what little it knows: there is more to find where that ends.
                self._at_random = self.steps < self.random_steps or (
                    self._has_task and bool(self._rng.random() < self.doubt)
                )
                self._hold = int(self._rng.choice(_HOLDS, p=_SHARES))
                self._lasts = None
                if self._at_random and self.restarts:
                    self._lasts = int(self._rng.choice(_LENGTHS, p=_LENGTH_SHARES))
                    self._hold = min(self._hold, max(1, self._lasts // _DIFFERENT))
            assert self._thread is not None, "made with the episode"
            decisions = self._thread.decisions + 1  # planned or not
            action = self._choose(self._observation)
            self._thread.decisions = decisions
            self._observation, _, terminated, truncated, _ = self.env.step(action)
            for real in self._recorder.take():
                self._take_up(real)
            if truncated:  # so long, then, an episode may last
                self._limit = max(self._limit or 1, self._thread.decisions)
            if terminated or truncated or self._thread.decisions == self._lasts:
                self._observation = None
            if callback is not None and callback(self) is False:
                break
        return self

    def mistaken(self, steps: Sequence[Experience]) -> NDArray[np.bool_]:
        """Of which real steps it is wrong about reward or end, or knows nothing; shape ``(n,)``."""
        return self._missed(self.trainer.reward_model, steps)

    def predict(
        self,
        observation: Any,
        state: States | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, States]:
        """Choose what pays, or without a task what is new unless it is to be safe; as `Planner.predict`."""
        planner = self._at_work(explores=not self._has_task and not self.safe)
        return planner.predict(observation, state, episode_start, deterministic)

    def _choose(self, observation: Any) -> Any:
        """A random action at first and while nothing is known; then the next of a plan."""
        all_is_new = not self._has_task and self.doubt == 1.0  # and need not be looked for
        if self._at_random or all_is_new:
            return self._random()
        assert self._thread is not None, "made with the episode"
        try:
            action = self._at_work(explores=True).act(observation, self._thread)
        except QueryError:  # no target known yet
            return self._random()
        plan = self._thread.plan
        if plan is not None and not plan.known and len(plan) == 1:
            # Whatever it does now, it doesn't know what will happen: as at first.
            return self._random()
        return action

    def _random(self) -> Any:
        left, action = self._held
        if left == 0:
            left, action = self._hold, self._drawn()
        self._held = (left - 1, action)
        return action

    def _drawn(self) -> Any:
        space = self.env.action_space
        if isinstance(space, gym.spaces.Box):
            share = self._rng.random(space.shape)
            if self._rng.random() < _BANG:
                share = np.round(share)
            return (space.low + share * (space.high - space.low)).astype(space.dtype)
        space.seed(int(self._rng.integers(2**31)))
        return space.sample()

    def _take_up(self, real: Experience) -> None:
        """Learn from a real step."""
        if not self._has_task:
            real = replace(real, reward=0.0, terminated=False)
        surplus, _ = self._surplus(self.trainer.reward_model, [real])
        self.trainer.take_up(real)
        self.steps += 1
        self._size.add(real.reward)
        self._history.append(real)
        self._episodes.append(self._begun)
        after = real.transition.after
        if self.coverage is None:
            kinds = changing(self.model)
            if not kinds:  # none found yet: any may be
                kinds = {(t.name, prop) for t in after.layout.types for prop in t.properties}
            self.coverage = Coverage(relative_columns(after.layout, kinds), varying=True)
            self._layout = after.layout
        # A model that has found no target yet names no part.
        self._wrong.append(bool(self.trainer.wrong) or not self.model.targets)
        self._off.append(self._wrong[-1] and self.trainer.error > self._matters)
        if after.layout == self._layout:
            self.coverage.add(
                after.vector,
                before=real.start.vector,
                surprised=self._surprised(),
                surplus=float(surplus[0]),
                paid=real.reward,
            )
        if self.steps >= self._next_review:
            self._review()
        if self._wrong[-1] and self._replaceable and self.steps >= self._next_after_change:
            self._review_change()

    def _surprised(self) -> bool:
        """Whether the last step was not as predicted, its reward and end included."""
        verdict, least = self.trainer.verdict, max(float(self._options["tolerance"] or 0.0), 1e-6)
        assert verdict is not None, "of the step that was just taken up"
        return not verdict.residuals or any(
            not abs(off) <= least * max(1.0, abs(verdict.changes.get(key, 0.0)))
            for key, off in verdict.residuals.items()
        )

    @property
    def _replaceable(self) -> bool:
        """Whether another model may take over after a review."""
        return isinstance(self.model, WorldModel) and not self.model.frozen

    def _review(self) -> None:
        """Learn again from what was seen if the model was wrong lately; go on with the one that is wrong less often."""
        known = min(self.model.seen, self.steps) if self._replaceable else self.steps
        self._next_review = self.steps + int(known * _GROWTH) - known + 1
        if self._replaceable and any(list(self._wrong)[-_LATEST:]) and self.steps >= self._next_again:
            seen, episodes = self._learned_from()
            left = missed(self.model, seen, episodes)
            if (best := self._learned_again(seen, episodes, left + length(self.model))[0]) is not None:
                self._adopt(best, seen, episodes)
                left = missed(best, seen, episodes)
            self._exact = 2 * left <= len(seen)
            if not self._exact:
                self._next_again = self.steps + int(known * _IN_VAIN) - known
        if isinstance(self.trainer.reward_model, LearnedRewardModel):
            self._review_task(self.trainer.reward_model)

    def _review_change(self) -> None:
        """If the model has been wrong more often since some step, see if another one is due from there on.

        The world may have changed: old examples still count then, and nothing in a scene tells old from new. Or it
        went where it had never been, and what it learns there holds of what it saw before, too. So three are compared:
        the model at work, one that learns everything again, and two, each for its part. A new one for the second part
        begins as the first one did, after as many steps. What one model of everything says in few numbers it may say by
        conditions that tell old from new by chance, so it must foresee more of the latest steps, if not all of them.
        """
        began = changed_at(self._wrong)
        if began is None:
            return
        since = len(self._wrong) - began
        self._next_after_change = self.steps + max(_FIRST_REVIEW - since, int(since * _GROWTH) - since + 1)
        if since < _FIRST_REVIEW:
            return
        seen, episodes = self._learned_from()
        old, new = seen[:-since], seen[-since:]
        fresh, least = self._learned_again(new, episodes[-since:], missed(self.model, new, episodes[-since:]))
        if fresh is None:
            return
        apart = missed(self.model, old, episodes[:-since]) + length(self.model) + least
        whole = self._learned_again(seen, episodes, apart)[0]
        if whole is not None:
            all_foreseen, own = self._foreseen(seen, episodes), self._foreseen(new, episodes[-since:])
            whole = whole if all_foreseen > own or all_foreseen == 1.0 else None
        if whole is not None:
            self._adopt(whole, seen, episodes)
        else:
            self._adopt(fresh, new, episodes[-since:])

    def _foreseen(self, seen: Sequence[Transition], episodes: NDArray[np.intp]) -> float:
        """Share of some latest steps that a model foresees that learned the others."""
        count = _FIRST_REVIEW // 4
        known = learned_again(self.model, seen[:-count], rng=self._rng, episodes=episodes[:-count])
        return float(right(known, seen[-count:]).mean())

    def _learned_from(self) -> tuple[list[Transition], NDArray[np.intp]]:
        """What the model at work has learned from: one that took over after a change knows nothing from before."""
        seen = [real.transition for real in self._history][-self.model.seen :]
        return seen, np.array(self._episodes)[-len(seen) :]

    def _learned_again(
        self, seen: Sequence[Transition], episodes: NDArray[np.intp], least: float
    ) -> tuple[WorldModel | None, float]:
        """The best of some models that learned the same steps in other orders, if it costs less than so much.

        What they are compared by is how many values it takes to state the model, and what it misses of all that was
        seen (`length`, `missed`). New models have learned from that, and many numbers fit a few episodes exactly; but
        laws are short.
        """
        best = None
        for _ in range(_ORDERS):
            fresh = learned_again(self.model, seen, rng=self._rng, episodes=episodes)
            found = missed(fresh, seen, episodes) + length(fresh) if fresh.targets else np.inf
            if found == least:
                break
            if found < least:
                best, least = fresh, found
        return best, least

    def _adopt(self, best: WorldModel, seen: Sequence[Transition], episodes: NDArray[np.intp]) -> None:
        """Go on with a model that learned so many steps."""
        self.trainer.adopt(best)
        # It knows what it has learned from, and more than one does that hasn't learned the latest of it: what it
        # makes of the next steps lies in between.
        count = min(_LATEST, len(seen) // 2) // 2
        tested = learned_again(self.model, seen[:-count], rng=self._rng, episodes=episodes[:-count])
        parts = right(best, seen[-2 * count : -count]), right(tested, seen[-count:])
        self._wrong = deque((~np.concatenate(parts)).tolist(), maxlen=_REMEMBERED)
        ratio = self.trainer.acceptance.ratio
        off = off_by(best, seen[-2 * count : -count], ratio), off_by(tested, seen[-count:], ratio)
        self._off = deque((np.concatenate(off) > self._matters).tolist(), maxlen=_LATEST)

    def _review_task(self, own: LearnedRewardModel) -> None:
        """The same for reward and end."""
        seen = list(self._history)
        best, least = None, int(self._missed(own, seen).sum())
        for _ in range(_TASK_ORDERS):
            if not least:
                break
            fresh = own.untaught()
            for k in mixed(np.array(self._episodes), self._rng):
                fresh.learn_step(seen[k].transition, seen[k].reward, terminated=seen[k].terminated)
            fresh.model.finish()
            wrong = self._missed(fresh, seen)
            if wrong.sum() < least:
                best, least = fresh, int(wrong.sum())
        if best is not None:
            self.trainer.reward_model = best

    def _missed(self, task: RewardModel, seen: Sequence[Experience]) -> NDArray[np.bool_]:
        """Of which steps a reward model is wrong about reward or end."""
        found = np.zeros(len(seen), dtype=np.bool_)
        order = sorted(range(len(seen)), key=lambda k: seen[k].start.layout.names)
        for _, group in groupby(order, key=lambda k: seen[k].start.layout.names):
            rows = list(group)
            found[rows] = self._surplus(task, [seen[k] for k in rows])[1]
        return found

    def _surplus(self, task: RewardModel, seen: Sequence[Experience]) -> tuple[Float1D, NDArray[np.bool_]]:
        """What steps of one layout paid beyond what a reward model says, 0 where it says nothing; which were wrong."""
        told = task.evaluate(
            seen[0].start.layout,
            np.stack([real.start.vector for real in seen]),
            np.stack([np.asarray(real.action) for real in seen]),
            np.stack([_fitted(real.transition.after, real.start) for real in seen]),
        )
        surplus = np.array([real.reward for real in seen]) - told.rewards
        ended = np.array([real.terminated for real in seen])
        wrong = ~(np.abs(surplus) <= 1e-6) | (told.terminated != ended)
        return np.where(np.isfinite(surplus), surplus, 0.0), wrong


def _fitted(after: Scene, like: Scene) -> Float1D:
    """The next state vector with the objects of the last one; those that are gone stay as they were."""
    return np.concatenate([(after if name in after else like)[name].values for name in like.layout.names])


def _task(task: Any, env: gym.Env[Any, Any]) -> Any:
    if task is None:
        return NoTask()
    if isinstance(task, str) and task == "given":
        own = getattr(env.unwrapped, "task", None)
        if own is None:
            raise ConfigError(
                f"task='given': {env} has no task that says what steps are worth; pass task='learned'"
            )
        return own
    if isinstance(task, str) and task != "learned":
        raise ConfigError(f"task={task!r}: expected 'learned', 'given', a task or None")
    return task
