"""Reward and termination of dreams: given functions, a task's, or properties of the `task` object that were learned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.envs.arguments import takes
from relgym.envs.tasks import RewardFunctions
from relgym.errors import ConfigError, QueryError
from relgym.model.protocol import SceneLearner
from relgym.scene.objects import TASK, Float1D, Float2D, Scene, SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = [
    "LEARNED",
    "BatchSceneFunction",
    "BatchStepEvaluator",
    "SceneFunction",
    "StepEvaluator",
    "TaskFunctions",
    "check_reward_functions",
    "in_batches",
    "marked",
]

SceneFunction: TypeAlias = Callable[[Scene, Any, Scene], float]
"""A function of the scene before, the action taken and the scene after; the scenes hold no action object."""

BatchSceneFunction: TypeAlias = Callable[[SceneLayout, Float2D, Any, Float2D], NDArray[Any]]
"""The same for n scenes: layout, state vectors before, actions, state vectors after; returns shape ``(n,)``."""

LEARNED: Final = "learned"
"""Stands for a reward or termination that the model predicts, as a property of the `task` object."""

_WORDS: Final = {"reward": "reward", "terminated": "termination"}

_ENDED = 0.5
"""A learned termination above this counts as true."""


class TaskFunctions(Protocol):
    """Reward and termination as pure functions, of one step and of n steps: what an env's ``task`` offers."""

    def reward(self, before: Scene, action: Any, after: Scene) -> float:
        """Reward of one step."""
        ...

    def terminated(self, before: Scene, action: Any, after: Scene) -> bool:
        """Whether a step ends the episode."""
        ...

    def rewards(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> Float1D:
        """Rewards of n steps."""
        ...

    def terminations(
        self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D
    ) -> NDArray[np.bool_]:
        """Which of n steps end their episodes."""
        ...


def check_reward_functions(
    reward: Any, terminated: Any, task: Any, model: SceneLearner, *, batched: bool, at_once: bool
) -> None:
    """Check functions and tasks before any dream begins.

    Parameters
    ----------
    reward, terminated, task
        As given.
    model
        The model of the dreams.
    batched
        Whether functions take n steps at once.
    at_once
        Whether the model has learned all that it ever will: else what it is to have ``"learned"`` is asked for when a
        dream begins.

    Raises
    ------
    ConfigError
        A task without functions; no function, or one of other arguments.
    QueryError
        The model won't learn what is to be ``"learned"``, or its scenes don't show it.
    """
    _functions(task, *(("rewards", "terminations") if batched else ("reward", "terminated")))
    for prop, given in (("reward", reward), ("terminated", terminated)):
        if isinstance(given, str) and given == LEARNED:
            shown = TASK in model.schema.order and prop in model.schema.type_of(TASK).properties
            if at_once or not (shown and model.discovers):
                _check_learned(model, prop)
        elif given is not None and not callable(given):
            raise ConfigError(f"{prop}={given!r}: expected a function, {LEARNED!r} or None")
        elif given is not None:
            _check_arguments(prop, given, batched=batched)


def _check_arguments(prop: str, function: Any, *, batched: bool) -> None:
    if not takes(function, 4 if batched else 3):
        told = (
            "(layout, vectors before, actions, vectors after); in_batches(schema, function) makes one of a function of "
            "scenes"
            if batched
            else "(scene before, action, scene after)"
        )
        raise ConfigError(f"{prop}: expected a function of {told}, got {function!r}")


def _has_learned(model: SceneLearner, prop: str) -> bool:
    if TASK not in model.schema.order:
        return False
    own = model.schema.type_of(TASK).name
    return any((t.type, t.property) == (own, prop) for t in model.targets)


def _check_learned(model: SceneLearner, prop: str) -> None:
    if not _has_learned(model, prop):
        raise QueryError(
            f"the model has not learned {TASK}.{prop}, it has the targets {[str(t) for t in model.targets]}: teach it "
            f"in scenes with a bodiless object {TASK!r} that has this property, or pass the function itself"
        )


def _chosen(given: Any, own: Any, model: SceneLearner, prop: str) -> Any:
    """A function, `LEARNED`, or None."""
    given = own if given is None else given
    if given is None:
        return LEARNED if _has_learned(model, prop) else None
    if isinstance(given, str):
        _check_learned(model, prop)
    return given


def _functions(task: Any, *names: str) -> list[Any]:
    """A task's functions; none each without a task."""
    if task is None:
        return [None for _ in names]
    if missing := [name for name in names if not callable(getattr(task, name, None))]:
        raise ConfigError(
            f"task={task!r}: expected an object with functions {' and '.join(names)}, such as an env's task (a "
            f"relgym.envs.Task); it has no {' and no '.join(missing)}"
        )
    return [getattr(task, name) for name in names]


def _at_once(task: Any) -> Any:
    """A task's function that gives rewards and terminations together, unless it has others of its own; None: none."""
    own = type(task)
    if not isinstance(task, RewardFunctions) or (own.rewards, own.terminations) != (
        RewardFunctions.rewards,
        RewardFunctions.terminations,
    ):
        return None
    return task.evaluate


def _doubts(task: Any) -> bool:
    """Whether a task is learned, so that NaN means that it doesn't know."""
    return bool(getattr(task, "learned", False))


@dataclass(frozen=True, slots=True)
class StepEvaluator:
    """Reward and termination of single steps: each a function, `LEARNED` (the next scene tells), or None.

    `doubts`: NaN is no error, but means that the reward is unknown.
    """

    reward: SceneFunction | Literal["learned"] | None
    terminated: SceneFunction | Literal["learned"] | None
    doubts: bool = False

    @classmethod
    def of(
        cls,
        reward: SceneFunction | Literal["learned"] | None,
        terminated: SceneFunction | Literal["learned"] | None,
        task: TaskFunctions | None,
        model: SceneLearner,
    ) -> StepEvaluator:
        """Settle whose rewards count: those given, else the task's, else what the model has learned by now, else none.

        Raises
        ------
        QueryError
            The model has not learned what is to be ``"learned"``.
        """
        own = _functions(task, "reward", "terminated")
        return cls(
            _chosen(reward, own[0], model, "reward"),
            _chosen(terminated, own[1], model, "terminated"),
            reward is None and _doubts(task),
        )

    @property
    def overruled(self) -> frozenset[tuple[str, str]]:
        """(object, property) pairs whose prediction isn't used, since a function gives them."""
        return _overruled(self.reward, self.terminated)

    def __call__(self, before: Scene, action: Any, after: Scene) -> tuple[float, bool]:
        """Reward of a step and whether it ends the episode; `ConfigError` where either is no finite number."""
        reward = _verdict("reward", self.reward, before, action, after, doubts=self.doubts)
        return reward, _verdict("terminated", self.terminated, before, action, after) > _ENDED


def _overruled(reward: Any, terminated: Any) -> frozenset[tuple[str, str]]:
    evaluator = {"reward": reward, "terminated": terminated}
    return frozenset((TASK, prop) for prop, function in evaluator.items() if callable(function))


def _verdict(
    prop: str,
    function: SceneFunction | Literal["learned"] | None,
    before: Scene,
    action: Any,
    after: Scene,
    *,
    doubts: bool = False,
) -> float:
    if function is None:
        return 0.0
    told = after[TASK][prop] if isinstance(function, str) else function(before, action, after)
    try:
        value = float(told)
    except (TypeError, ValueError, OverflowError):
        value = np.nan
    if not (np.isfinite(value) or (doubts and np.isnan(value))):
        what = _WORDS[prop]
        raise ConfigError(
            f"the {what} of a dreamed step is {told!r}: expected a finite number; fix the {what} function for "
            f"before={before.values()}, action={action}, after={after.values()}"
        )
    return value


@dataclass(frozen=True, slots=True)
class BatchStepEvaluator:
    """`StepEvaluator` of n steps at once."""

    layout: SceneLayout
    reward: BatchSceneFunction | Literal["learned"] | None
    terminated: BatchSceneFunction | Literal["learned"] | None
    doubts: bool = False
    both: Any = None
    """The task's function for both at once, where neither is anything else."""

    @classmethod
    def of(
        cls,
        reward: BatchSceneFunction | Literal["learned"] | None,
        terminated: BatchSceneFunction | Literal["learned"] | None,
        task: TaskFunctions | None,
        model: SceneLearner,
        layout: SceneLayout,
    ) -> BatchStepEvaluator:
        """As `StepEvaluator.of`."""
        own = _functions(task, "rewards", "terminations")
        return cls(
            layout,
            _chosen(reward, own[0], model, "reward"),
            _chosen(terminated, own[1], model, "terminated"),
            reward is None and _doubts(task),
            None if (reward, terminated) != (None, None) else _at_once(task),
        )

    @property
    def asks(self) -> bool:
        """Whether a function is asked, of which nobody knows what it does with steps that can't be followed."""
        return callable(self.reward) or callable(self.terminated)

    @property
    def evaluates(self) -> bool:
        """Whether steps may be worth anything, or end an episode."""
        return not (self.reward is None and self.terminated is None and self.both is None)

    @property
    def overruled(self) -> frozenset[tuple[str, str]]:
        """As of `StepEvaluator`."""
        return _overruled(self.reward, self.terminated)

    def __call__(self, before: Float2D, actions: Any, after: Float2D) -> tuple[Float1D, NDArray[np.bool_]]:
        """Rewards and ends of n steps, shape ``(n,)`` each.

        Raises
        ------
        ConfigError
            A reward is not finite, or a function returns another shape.
        """
        told: tuple[Any, Any] = self.reward, self.terminated
        if self.both is not None:
            outcome = self.both(self.layout, before, actions, after)
            told = (lambda *_: outcome.rewards), (lambda *_: outcome.terminated)
        rewards = self._verdicts("reward", told[0], before, actions, after, doubts=self.doubts)
        return rewards, self._verdicts("terminated", told[1], before, actions, after) > _ENDED

    def _verdicts(
        self,
        prop: str,
        function: BatchSceneFunction | Literal["learned"] | None,
        before: Float2D,
        actions: Any,
        after: Float2D,
        *,
        doubts: bool = False,
    ) -> Float1D:
        if function is None:
            return np.zeros(len(after))
        if isinstance(function, str):
            return after[:, self.layout.column(self.layout.index(TASK), prop)].copy()
        what = _WORDS[prop]
        told: Any = function(self.layout, before, actions, after)
        try:
            found = np.asarray(told, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):  # no numbers, or not as many in each row
            found = np.empty((0, 0))
        if found.shape != (len(after),):
            came = f"one of shape {told.shape}" if isinstance(told, np.ndarray) else repr(told)
            raise ConfigError(
                f"{what}: expected an array of {len(after)} numbers from a function of (layout, before, actions, "
                f"after), got {came}; in_batches(schema, function) makes one of a function of scenes"
            )
        fine = np.isfinite(found) | np.isnan(found) if doubts else np.isfinite(found)
        if not fine.all():
            row = int(np.flatnonzero(~fine)[0])
            raise ConfigError(
                f"the {what} of dreamed step {row} of {len(found)} is {found[row]}: expected a finite number; fix the "
                f"{what} function for before={before[row].tolist()}, after={after[row].tolist()} (objects "
                f"{list(self.layout.names)})"
            )
        return found


def marked(task: Any, scene: Scene) -> tuple[Any, ...]:
    """Regions that a picture marks, if the task names any."""
    regions = getattr(task, "regions", None)
    return () if regions is None else tuple(regions(scene))


def in_batches(schema: SceneSchema, function: SceneFunction) -> BatchSceneFunction:
    """Array version of a function of (scene, action, next scene): it goes through the scenes one by one.

    For convenience, not for speed: a function written for arrays is some hundred times as fast.
    """

    def evaluated(layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> Float1D:
        scenes = zip(before.copy(), actions, after.copy(), strict=True)
        told = [function(Scene(schema, layout, a), u, Scene(schema, layout, b)) for a, u, b in scenes]
        return np.array(told, dtype=np.float64)

    return evaluated
