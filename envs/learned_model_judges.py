"""Reward and termination of dreams: given functions, a task's, or properties of the `task` object that were learned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError, QueryError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import TASK, Float1D, Float2D, Scene, SceneLayout, SceneSchema

__all__ = [
    "LEARNED",
    "BatchJudge",
    "BatchJudges",
    "BatchStart",
    "Judge",
    "Judges",
    "Start",
    "TaskFunctions",
    "drawn_from",
    "in_batches",
    "learned_column",
]

Judge: TypeAlias = Callable[[Scene, Any, Scene], float]
"""A function of the scene before, the action taken and the scene after; the scenes hold no action object."""

BatchJudge: TypeAlias = Callable[[SceneLayout, Float2D, Any, Float2D], NDArray[Any]]
"""The same for n scenes: layout, state vectors before, actions, state vectors after; returns shape ``(n,)``."""

Start: TypeAlias = Callable[[np.random.Generator], Scene]
"""Draws a first scene."""

BatchStart: TypeAlias = Callable[[np.random.Generator, int], Float2D]
"""Draws the state vectors of n first scenes, shape ``(n, layout.width)``."""

LEARNED: Final = "learned"
"""Stands for a reward or termination that the model predicts, as a property of the `task` object."""

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


def learned_column(model: WorldModel, layout: SceneLayout, prop: str) -> int:
    """Column of a property of the `task` object in state vectors.

    Raises
    ------
    QueryError
        The model doesn't predict it.
    """
    if TASK in layout.names and any(
        (t.type, t.property) == (_task_type(layout), prop) for t in model.targets
    ):
        return layout.column(layout.index(TASK), prop)
    raise QueryError(
        f"the model has not learned {TASK}.{prop}, it has the targets {[str(t) for t in model.targets]}: teach it in "
        f"scenes with a bodiless object {TASK!r} that has this property, or pass the function itself"
    )


def _task_type(layout: SceneLayout) -> str:
    return layout.types[layout.index(TASK)].name


def _has_learned(model: WorldModel, layout: SceneLayout, prop: str) -> bool:
    try:
        learned_column(model, layout, prop)
    except QueryError:
        return False
    return True


def _chosen(given: Any, own: Any, model: WorldModel, layout: SceneLayout, prop: str) -> Any:
    """A function, the column of what was learned, or None."""
    if given is None:
        given = own
    if given is None and _has_learned(model, layout, prop):
        given = LEARNED
    if given == LEARNED:
        return learned_column(model, layout, prop)
    if given is not None and not callable(given):
        raise ConfigError(f"{prop}={given!r}: expected a function, {LEARNED!r} or None")
    return given


@dataclass(frozen=True, slots=True)
class Judges:
    """Reward and termination of single steps: each a function, a column of the next state vector, or None."""

    reward: Judge | int | None
    terminated: Judge | int | None

    @classmethod
    def of(
        cls,
        reward: Judge | Literal["learned"] | None,
        terminated: Judge | Literal["learned"] | None,
        task: TaskFunctions | None,
        model: WorldModel,
        layout: SceneLayout,
    ) -> Judges:
        """Settle who judges: what was given, else the task, else what the model has learned, else nobody."""
        own = (None, None) if task is None else (task.reward, task.terminated)
        return cls(
            _chosen(reward, own[0], model, layout, "reward"),
            _chosen(terminated, own[1], model, layout, "terminated"),
        )

    def __call__(self, before: Scene, action: Any, after: Scene) -> tuple[float, bool]:
        """Reward of a step and whether it ends the episode; `ConfigError` where the reward is not finite."""
        reward, ended = (_verdict(judge, before, action, after) for judge in (self.reward, self.terminated))
        if not np.isfinite(reward):
            raise ConfigError(
                f"the reward of a dreamed step is {reward}: expected a finite number; mend the reward function for "
                f"before={before.values()}, action={action}, after={after.values()}"
            )
        return reward, ended > _ENDED


def _verdict(judge: Judge | int | None, before: Scene, action: Any, after: Scene) -> float:
    if judge is None:
        return 0.0
    return float(after.vector[judge]) if isinstance(judge, int) else float(judge(before, action, after))


@dataclass(frozen=True, slots=True)
class BatchJudges:
    """`Judges` of n steps at once."""

    layout: SceneLayout
    reward: BatchJudge | int | None
    terminated: BatchJudge | int | None

    @classmethod
    def of(
        cls,
        reward: BatchJudge | Literal["learned"] | None,
        terminated: BatchJudge | Literal["learned"] | None,
        task: TaskFunctions | None,
        model: WorldModel,
        layout: SceneLayout,
    ) -> BatchJudges:
        """As `Judges.of`."""
        own = (None, None) if task is None else (task.rewards, task.terminations)
        return cls(
            layout,
            _chosen(reward, own[0], model, layout, "reward"),
            _chosen(terminated, own[1], model, layout, "terminated"),
        )

    def __call__(self, before: Float2D, actions: Any, after: Float2D) -> tuple[Float1D, NDArray[np.bool_]]:
        """Rewards and ends of n steps, shape ``(n,)`` each.

        Raises
        ------
        ConfigError
            A reward is not finite, or a function returns another shape.
        """
        rewards = self._verdicts("reward", self.reward, before, actions, after)
        ended = self._verdicts("terminated", self.terminated, before, actions, after)
        if not np.isfinite(rewards).all():
            row = int(np.flatnonzero(~np.isfinite(rewards))[0])
            raise ConfigError(
                f"the reward of dreamed step {row} of {len(rewards)} is {rewards[row]}: expected a finite number; "
                f"mend the reward function for before={before[row].tolist()}, after={after[row].tolist()} "
                f"(objects {list(self.layout.names)})"
            )
        return rewards, ended > _ENDED

    def _verdicts(
        self, what: str, judge: BatchJudge | int | None, before: Float2D, actions: Any, after: Float2D
    ) -> Float1D:
        if judge is None:
            return np.zeros(len(after))
        if isinstance(judge, int):
            return after[:, judge].copy()
        found = np.asarray(judge(self.layout, before, actions, after), dtype=np.float64)
        if found.shape != (len(after),):
            raise ConfigError(
                f"{what}: expected an array of shape {(len(after),)} from a function of (layout, before, actions, "
                f"after), got shape {found.shape}; in_batches(schema, function) makes one of a function of scenes"
            )
        return found


def in_batches(schema: SceneSchema, judge: Judge) -> BatchJudge:
    """Array version of a function of (scene, action, next scene): it goes through the scenes one by one.

    For convenience, not for speed: a function written for arrays is some hundred times as fast.
    """

    def judged(layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> Float1D:
        scenes = zip(before.copy(), actions, after.copy(), strict=True)
        told = [judge(Scene(schema, layout, a), u, Scene(schema, layout, b)) for a, u, b in scenes]
        return np.array(told, dtype=np.float64)

    return judged


def drawn_from(scenes: Sequence[Scene] | Float2D) -> BatchStart:
    """First scenes for `LearnedModelVectorEnv`, drawn uniformly from scenes with the same objects.

    Parameters
    ----------
    scenes
        Scenes without an action, or their state vectors, shape ``(m, layout.width)``.
    """
    vectors = scenes if isinstance(scenes, np.ndarray) else np.array([scene.vector for scene in scenes])
    if vectors.ndim != 2 or not len(vectors):
        raise ConfigError(
            f"expected some scenes with the same objects, got an array of shape {vectors.shape}"
        )

    def start(rng: np.random.Generator, count: int) -> Float2D:
        drawn: Float2D = vectors[rng.integers(len(vectors), size=count)]
        return drawn

    return start
