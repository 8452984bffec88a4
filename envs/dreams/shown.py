"""What dreams show of their scenes, and how actions come into them: as the env that the model was learned in."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import concatenate, create_empty_array
from numpy.typing import NDArray

from relgym.envs.actions import BatchActions, acting
from relgym.envs.agents import AgentsSpace
from relgym.envs.arguments import checked_actions
from relgym.envs.views import SceneView, TaskView, View
from relgym.envs.views.base import in_batches_too, is_whole, limits_of
from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import ACTION, TASK, Float1D, Float2D, Scene, SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = ["Boxes", "BoxesShown", "Deeds", "Shown", "ViewShown", "checked_boxes", "is_plain", "shown_at_once"]


class Deeds(Protocol):
    """Puts the actions of n dreams into their scenes."""

    @property
    def layout(self) -> SceneLayout:
        """Layout of the scenes with what is done in them."""
        ...

    def checked(self, actions: Any, count: int) -> Any:
        """Actions as an array of shape ``(count, …)``; `ActionError` unless all lie in the space."""
        ...

    def joined(self, vectors: Float2D, actions: Any) -> Float2D:
        """State vectors with the actions in them, shape ``(n, layout.width)``."""
        ...

    def parted(self, vectors: Float2D) -> Float2D:
        """State vectors without the actions."""
        ...


class Shown(Protocol):
    """How scenes become observations.

    Attributes
    ----------
    layout
        Layout of the scenes of a batch, without an action.
    """

    layout: SceneLayout

    def acting(self, scene: Scene, action: Any) -> Scene:
        """The scene with a checked action in it."""
        ...

    def deeds(self) -> Deeds:
        """The same for batches."""
        ...

    def observation(self, scene: Scene) -> Any:
        """What an agent sees of a scene."""
        ...

    def observations(self, vectors: Float2D) -> Any:
        """What an agent sees of n scenes: arrays of their own."""
        ...

    def inside(self, vectors: Float2D) -> NDArray[np.bool_]:
        """Which of n scenes lie in the observation space, shape ``(n,)``."""
        ...

    def still_inside(self, vectors: Float2D, parts: tuple[tuple[str, str], ...]) -> NDArray[np.bool_]:
        """Which of n scenes lie there that did one step before; (object, property) pairs may have changed since."""
        ...

    def outside(self, layout: SceneLayout, vectors: Float2D) -> list[str]:
        """What of each of n scenes lies outside the observation space, as a sentence; empty if nothing does."""
        ...


def is_plain(view: View) -> bool:
    """Whether a view shows scenes as they are, so that arrays do."""
    return isinstance(view.view if isinstance(view, TaskView) else view, SceneView)


def shown_at_once(view: View, layout: SceneLayout, vectors: Float2D) -> tuple[Any, NDArray[np.bool_]] | None:
    """Observations of n scenes, and which lie in the observation space; None where a view shows them one by one."""
    told = isinstance(view, TaskView)
    inner = view.view if isinstance(view, TaskView) else view
    if (found := in_batches_too(inner, "observations", "observation")) is None:
        return None
    bare = inner.schema.layout(name for name in layout.names if not (told and name == TASK))
    seen, inside = found(bare, vectors[:, : bare.width])  # `task` stands last
    return seen, np.asarray(inside)


class Boxes:
    """The numbers of objects as Boxes show them: in their dtypes, within their limits.

    Parameters
    ----------
    boxes
        By object; what an object that isn't there shows, is in no space.
    """

    def __init__(self, boxes: Mapping[str, spaces.Box]) -> None:
        self._dtypes = {name: np.dtype(box.dtype) for name, box in boxes.items()}
        self._low: dict[str, NDArray[Any]] = {}
        self._high: dict[str, NDArray[Any]] = {}
        for name, box in boxes.items():
            # What is infinite, or would be in the space's dtype, has left a space without bounds, too.
            least, most = limits_of(box.dtype)
            self._low[name], self._high[name] = np.maximum(box.low, least), np.minimum(box.high, most)
        self._whole = frozenset(name for name, dtype in self._dtypes.items() if is_whole(dtype))
        self._places: tuple[SceneLayout, list[tuple[str, slice]]] | None = None
        self._last: tuple[SceneLayout, tuple[Float1D, Float1D]] | None = None
        self._as_they_are = all(dtype == np.float64 for dtype in self._dtypes.values())

    def shown(self, layout: SceneLayout, vectors: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
        """Property vectors by object, of one state vector or of n: arrays that nobody else has."""
        if self._as_they_are:
            own = vectors.copy()
            return {name: own[..., place] for name, place in self._slices(layout)}
        rounded = self.rounded(layout, vectors)
        return {name: rounded[..., place].astype(self._dtypes[name]) for name, place in self._slices(layout)}

    def _slices(self, layout: SceneLayout) -> list[tuple[str, slice]]:
        """The objects shown, and where each one's numbers lie; those of the last layout are kept."""
        if self._places is None or self._places[0] is not layout:
            there = [(name, layout.slice(k)) for k, name in enumerate(layout.names) if name in self._dtypes]
            self._places = layout, there
        return self._places[1]

    def inside(self, layout: SceneLayout, vectors: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of n state vectors lie within the limits, shape ``(n,)``; not those with NaN."""
        low, high = self.limits(layout)
        rounded = self.rounded(layout, vectors)
        return np.asarray(((low <= rounded) & (rounded <= high)).all(axis=-1))

    def inside_at(
        self, layout: SceneLayout, vectors: NDArray[np.float64], columns: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Which of n state vectors lie within the limits of some columns, shape ``(n,)``; not those with NaN."""
        if self._whole:
            return self.inside(layout, vectors)
        low, high = self.limits(layout)
        some = vectors.T[columns]  # column by column: few long rows are compared sooner than many short ones
        fits = (some >= low[columns, None]) & (some <= high[columns, None])
        return np.ones(len(vectors), dtype=np.bool_) if fits.all() else np.asarray(fits.all(axis=0))

    def limits(self, layout: SceneLayout) -> tuple[Float1D, Float1D]:
        """Smallest and largest element of each column; those of the last layout are kept."""
        if self._last is None or self._last[0] is not layout:
            low, high = np.full(layout.width, -np.inf), np.full(layout.width, np.inf)
            for k, name in enumerate(layout.names):
                if name in self._low:
                    low[layout.slice(k)], high[layout.slice(k)] = self._low[name], self._high[name]
            self._last = layout, (low, high)
        return self._last[1]

    def rounded(self, layout: SceneLayout, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """State vectors with whole numbers where only those are shown."""
        if not self._whole:
            return vectors
        found = vectors.copy()
        for k, name in enumerate(layout.names):
            if name in self._whole:
                found[..., layout.slice(k)] = np.rint(found[..., layout.slice(k)])
        return found


class BoxesShown:
    """Scenes as they are: ``Dict``, object name -> ``Box``; no loop over scenes anywhere.

    Parameters
    ----------
    schema
        The scenes' schema.
    observation_space, action_space
        Spaces of one dream.

    Raises
    ------
    ConfigError
        The observation space isn't a Dict of such Boxes.
    """

    def __init__(
        self, schema: SceneSchema, observation_space: spaces.Space[Any], action_space: spaces.Space[Any]
    ) -> None:
        seen = checked_boxes(observation_space, schema)
        self._schema, self._action_space, self._boxes = schema, action_space, Boxes(seen)
        self._changing: dict[tuple[tuple[str, str], ...], NDArray[np.intp]] = {}
        self._columns: tuple[SceneLayout, list[tuple[str, str]]] | None = None
        self.layout = schema.layout([*seen, *(name for name in (TASK,) if name in schema.order)])

    def acting(self, scene: Scene, action: Any) -> Scene:
        """The scene with a checked action in it."""
        return acting(scene, action)

    def deeds(self) -> Deeds:
        """The same for batches."""
        return BatchActions(self._schema, self.layout, self._action_space)

    def observation(self, scene: Scene) -> dict[str, NDArray[Any]]:
        """Property vectors by object."""
        return self._boxes.shown(scene.layout, scene.vector)

    def observations(self, vectors: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
        """Property vectors by object, of n state vectors."""
        return self._boxes.shown(self.layout, vectors)

    def inside(self, vectors: Float2D) -> NDArray[np.bool_]:
        """Which of n scenes lie in the observation space, shape ``(n,)``."""
        return self._boxes.inside(self.layout, vectors)

    def still_inside(self, vectors: Float2D, parts: tuple[tuple[str, str], ...]) -> NDArray[np.bool_]:
        """Which of n scenes lie there that did one step before: only what a step may change is looked at."""
        if parts not in self._changing:
            layout = self.layout
            pairs = {(layout.index(name), prop) for name, prop in parts if name in layout.names}
            pairs |= {(i, law.property) for law in self._schema.derivations for i in layout.of_type(law.type)}
            columns = {layout.column(*pair) for pair in pairs}
            low, high = self._boxes.limits(layout)
            turns = {layout.column(i, prop) for i, t in enumerate(layout.types) for prop in t.angles}
            # Angles are wrapped to -π to π: where all of that is allowed nothing can leave.
            columns |= {c for c in turns if low[c] > -np.pi or high[c] < np.pi}
            self._changing[parts] = np.array(sorted(columns), dtype=np.intp)
        return self._boxes.inside_at(self.layout, vectors, self._changing[parts])

    def outside(self, layout: SceneLayout, vectors: Float2D) -> list[str]:
        """Which properties lie outside the observation space."""
        (low, high), numbers = self._boxes.limits(layout), self._boxes.rounded(layout, vectors)
        told: list[list[str]] = [[] for _ in vectors]
        rows, columns = (~((low <= numbers) & (numbers <= high))).nonzero()
        known = self._told(layout)
        for row, k, number in zip(
            rows.tolist(), columns.tolist(), numbers[rows, columns].tolist(), strict=True
        ):
            name, limits = known[k]
            told[row].append(f"{name} = {number:g} left the observation space {limits}")
        return ["; ".join(each) for each in told]

    def _told(self, layout: SceneLayout) -> list[tuple[str, str]]:
        """Name and limits of each column; those of the last layout are kept."""
        if self._columns is None or self._columns[0] is not layout:
            pairs, (low, high) = zip(layout.names, layout.types, strict=True), self._boxes.limits(layout)
            names = [f"{name}.{p}" for name, t in pairs for p in t.properties]
            limits = [f"[{a:g}, {b:g}]" for a, b in zip(low.tolist(), high.tolist(), strict=True)]
            self._columns = layout, list(zip(names, limits, strict=True))
        return self._columns[1]


class ViewShown:
    """Scenes through a view (`relgym.envs.views`): whatever the env's observations are.

    One scene at a time, but for views that offer more (`View`): those of numbers.

    Parameters
    ----------
    view
        Turns scenes into observations and actions into objects.
    observation_space, action_space
        Spaces of one dream.
    """

    def __init__(
        self, view: View, observation_space: spaces.Space[Any], action_space: spaces.Space[Any]
    ) -> None:
        self._view, self._space, self._action_space = view, observation_space, action_space
        self._schema = view.schema
        self.layout = self._schema.layout(name for name in self._schema.order if name != ACTION)

    def acting(self, scene: Scene, action: Any) -> Scene:
        """The scene with a checked action in it."""
        return self._view.with_action(scene, action)

    def deeds(self) -> Deeds:
        """The same for batches."""
        return ViewDeeds(self._view, self.layout, self._action_space)

    def observation(self, scene: Scene) -> Any:
        """The observation that shows a scene."""
        return self._view.observation(scene)

    def observations(self, vectors: Float2D) -> Any:
        """Observations of n scenes, batched as Gymnasium batches them."""
        if (found := shown_at_once(self._view, self.layout, vectors)) is not None:
            return found[0]
        seen = [self.observation(self._scene(vector)) for vector in vectors]
        empty: Any = create_empty_array(self._space, len(seen))
        return concatenate(self._space, seen, empty)

    def inside(self, vectors: Float2D) -> NDArray[np.bool_]:
        """Which of n scenes lie in the observation space, shape ``(n,)``."""
        if (found := shown_at_once(self._view, self.layout, vectors)) is not None:
            return found[1]
        return np.array([not left for left in self.outside(self.layout, vectors)], dtype=np.bool_)

    def still_inside(self, vectors: Float2D, parts: tuple[tuple[str, str], ...]) -> NDArray[np.bool_]:
        """Which of n scenes lie in the observation space; views may show anything of what changed."""
        return self.inside(vectors)

    def outside(self, layout: SceneLayout, vectors: Float2D) -> list[str]:
        """The observations, where they lie outside the observation space."""
        return [self._outside(Scene(self._schema, layout, vector.copy())) for vector in vectors]

    def _outside(self, scene: Scene) -> str:
        try:
            observation = self.observation(scene)
        except ObservationError as error:  # numbers that the space's dtype can't hold
            return str(error)
        if self._space.contains(observation):
            return ""
        return f"the observation {observation} left the observation space {self._space}"

    def _scene(self, vector: Float1D) -> Scene:
        return Scene(self._schema, self.layout, vector.copy())


class ViewDeeds:
    """`Deeds` through a view: of all actions at once where it can tell (`View`), else each distinct one once.

    Parameters
    ----------
    view
        Turns actions into objects.
    layout
        Layout of the scenes without an action.
    space
        Action space of one scene.
    """

    def __init__(self, view: View, layout: SceneLayout, space: spaces.Space[Any]) -> None:
        if isinstance(space, (spaces.Dict, spaces.Tuple)):
            whose = "of several agents" if isinstance(space, AgentsSpace) else f"with actions of {space}"
            raise ConfigError(
                f"dreams {whose} are dreamt one at a time: gym.make('relgym/LearnedModel-v0', ...), or "
                "gym.vector.SyncVectorEnv of such; to search among actions, learn from an env with flat ones, which "
                "gymnasium.wrappers.TransformAction(env, function, space) makes of yours"
            )
        self._view, self._space, self._bare = view, space, layout

    @cached_property
    def layout(self) -> SceneLayout:
        """Layout of the scenes with what is done in them."""
        schema = self._view.schema
        return schema.layout(schema.order if ACTION in schema.order else self._bare.names)

    def checked(self, actions: Any, count: int) -> Any:
        """Actions as an array of shape ``(count, …)``; `ActionError` unless all lie in the space."""
        return checked_actions(self._space, actions, count)

    def joined(self, vectors: Float2D, actions: Any) -> Float2D:
        """State vectors with the actions in them, shape ``(n, layout.width)``."""
        if self.layout is self._bare:
            return vectors
        both = np.empty((len(vectors), self.layout.width))
        both[:, self._own], both[:, self._rest] = self._all_values(actions, len(vectors)), vectors
        return both

    def parted(self, vectors: Float2D) -> Float2D:
        """State vectors without the actions."""
        return vectors if self.layout is self._bare else vectors[:, self._rest]

    @cached_property
    def _own(self) -> NDArray[np.intp]:
        return np.arange(self.layout.width)[self.layout.slice(self.layout.index(ACTION))]

    @cached_property
    def _rest(self) -> NDArray[np.intp]:
        return np.delete(np.arange(self.layout.width), self._own)

    def _all_values(self, actions: Any, count: int) -> Float2D:
        """Properties of the action object for n actions."""
        view = self._view.view if isinstance(self._view, TaskView) else self._view
        if (at_once := in_batches_too(view, "action_values", "with_action")) is not None:
            return np.asarray(at_once(actions), dtype=np.float64)
        distinct, which = np.unique(np.asarray(actions).reshape(count, -1), axis=0, return_inverse=True)
        done = np.array([self._values(action.reshape(np.shape(actions)[1:])) for action in distinct])
        found: Float2D = done[which.reshape(-1)]
        return found

    def _values(self, action: Any) -> Float1D:
        """Properties of the action object; they don't depend on the scene."""
        empty = Scene(self._view.schema, self._bare, np.zeros(self._bare.width))
        return self._view.with_action(empty, action[()])[ACTION].values


def checked_boxes(space: spaces.Space[Any], schema: SceneSchema) -> dict[str, spaces.Box]:
    """The Boxes of some objects; `ConfigError` unless the space is a Dict of them."""
    parts = space.spaces if isinstance(space, spaces.Dict) else {}
    boxes = {
        name: box
        for name, box in parts.items()
        if isinstance(box, spaces.Box)
        and name in schema.order
        and box.shape == (len(schema.type_of(name).properties),)
    }
    if not boxes or len(boxes) < len(parts):
        raise ConfigError(
            f"expected a Dict observation space, object name -> Box with a number for each property, for the objects "
            f"{[name for name in schema.order if name != ACTION]}, got {space}; wrap the dream as the env was, or "
            "pass the view that the model was learned through"
        )
    return boxes
