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
    "marked",
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


def _doubts(task: Any) -> bool:
    """Whether a task is learned, so that a NaN of its says that it doesn't know."""
    return bool(getattr(task, "learned", False))


@dataclass(frozen=True, slots=True)
class Judges:
    """Reward and termination of single steps: each a function, a column of the next state vector, or None.

    `doubts`: NaN is no error, but says that nobody knows.
    """

    reward: Judge | int | None
    terminated: Judge | int | None
    doubts: bool = False

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
        own = _functions(task, "reward", "terminated")
        return cls(
            _chosen(reward, own[0], model, layout, "reward"),
            _chosen(terminated, own[1], model, layout, "terminated"),
            reward is None and _doubts(task),
        )

    @property
    def overruled(self) -> frozenset[tuple[str, str]]:
        """(object, property) pairs that another than the model judges, whatever it says of them."""
        return _overruled(self.reward, self.terminated)

    def __call__(self, before: Scene, action: Any, after: Scene) -> tuple[float, bool]:
        """Reward of a step and whether it ends the episode; `ConfigError` where either is no finite number."""
        reward = _verdict("reward", self.reward, before, action, after, doubts=self.doubts)
        return reward, _verdict("termination", self.terminated, before, action, after) > _ENDED


def _overruled(reward: Any, terminated: Any) -> frozenset[tuple[str, str]]:
    judges = {"reward": reward, "terminated": terminated}
    return frozenset((TASK, prop) for prop, judge in judges.items() if callable(judge))


def _verdict(
    what: str,
    judge: Judge | int | None,
    before: Scene,
    action: Any,
    after: Scene,
    *,
    doubts: bool = False,
) -> float:
    if judge is None:
        return 0.0
    told = after.vector[judge] if isinstance(judge, int) else judge(before, action, after)
    try:
        value = float(told)
    except (TypeError, ValueError):
        value = np.nan
    if not (np.isfinite(value) or (doubts and np.isnan(value))):
        raise ConfigError(
            f"the {what} of a dreamed step is {told!r}: expected a finite number; mend the {what} function for "
            f"before={before.values()}, action={action}, after={after.values()}"
        )
    return value


@dataclass(frozen=True, slots=True)
class BatchJudges:
    """`Judges` of n steps at once."""

    layout: SceneLayout
    reward: BatchJudge | int | None
    terminated: BatchJudge | int | None
    doubts: bool = False

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
        own = _functions(task, "rewards", "terminations")
        return cls(
            layout,
            _chosen(reward, own[0], model, layout, "reward"),
            _chosen(terminated, own[1], model, layout, "terminated"),
            reward is None and _doubts(task),
        )

    @property
    def overruled(self) -> frozenset[tuple[str, str]]:
        """As of `Judges`."""
        return _overruled(self.reward, self.terminated)

    def __call__(self, before: Float2D, actions: Any, after: Float2D) -> tuple[Float1D, NDArray[np.bool_]]:
        """Rewards and ends of n steps, shape ``(n,)`` each.

        Raises
        ------
        ConfigError
            A reward is not finite, or a function returns another shape.
        """
        rewards = self._verdicts("reward", self.reward, before, actions, after, doubts=self.doubts)
        return rewards, self._verdicts("termination", self.terminated, before, actions, after) > _ENDED

    def _verdicts(
        self,
        what: str,
        judge: BatchJudge | int | None,
        before: Float2D,
        actions: Any,
        after: Float2D,
        *,
        doubts: bool = False,
    ) -> Float1D:
        if judge is None:
            return np.zeros(len(after))
        if isinstance(judge, int):
            return after[:, judge].copy()
        told = judge(self.layout, before, actions, after)
        try:
            found = np.asarray(told, dtype=np.float64)
        except (TypeError, ValueError):
            found = np.empty(0)
        if found.shape != (len(after),):
            raise ConfigError(
                f"{what}: expected an array of {len(after)} numbers from a function of (layout, before, actions, "
                f"after), got {type(told).__name__} of shape {np.shape(told)}; in_batches(schema, function) makes one "
                "of a function of scenes"
            )
        fine = np.isfinite(found) | np.isnan(found) if doubts else np.isfinite(found)
        if not fine.all():
            row = int(np.flatnonzero(~fine)[0])
            raise ConfigError(
                f"the {what} of dreamed step {row} of {len(found)} is {found[row]}: expected a finite number; mend the "
                f"{what} function for before={before[row].tolist()}, after={after[row].tolist()} (objects "
                f"{list(self.layout.names)})"
            )
        return found


def marked(task: Any, scene: Scene) -> tuple[Any, ...]:
    """Regions that a picture marks, if the task names any."""
    regions = getattr(task, "regions", None)
    return () if regions is None else tuple(regions(scene))


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
