"""Real scenes in which roll-outs begin, and what may be varied in them without leaving what the model knows."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError
from relgym.model.predicting.prediction import BatchPrediction, ScenePrediction
from relgym.scene.objects import ACTION, TASK, Float2D, ObjectType, Scene, SceneLayout, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.wrappers.dyna.config import DynaConfig

__all__ = ["DreamModel", "SceneStock", "changing", "free_properties", "permuted"]


class DreamModel(Protocol):
    """What Dyna asks of a model: relational, neural or any other."""

    @property
    def schema(self) -> SceneSchema:
        """Of the scenes that it predicts."""

    @property
    def targets(self) -> tuple[Target, ...]:
        """What it predicts."""

    def learn_one(self, transition: Transition) -> Any:
        """Learn from one real transition."""

    def predict_one(self, scene: Scene) -> ScenePrediction:
        """Predict what follows a scene with an action in it."""

    def predict_batch(self, layout: SceneLayout, vectors: Float2D) -> BatchPrediction:
        """Predict what follows n scenes with the same objects."""


class SceneStock:
    """A buffer of the latest scenes that were seen, grouped by the objects in them.

    Parameters
    ----------
    capacity
        How many scenes are kept, and how many of those that episodes began with.
    """

    def __init__(self, capacity: int = 5_000) -> None:
        if capacity < 1:
            raise ConfigError(f"capacity={capacity!r}: expected at least 1 scene")
        self._capacity = capacity
        self._all: dict[SceneLayout, list[NDArray[np.float64]]] = {}
        self._firsts: dict[SceneLayout, list[NDArray[np.float64]]] = {}

    def __len__(self) -> int:
        return sum(map(len, self._all.values()))

    def add(self, scene: Scene, *, first: bool) -> None:
        """Keep a scene without an action; `first`: an episode began with it."""
        for kept in (self._all, self._firsts) if first else (self._all,):
            scenes = kept.setdefault(scene.layout, [])
            scenes.append(scene.vector)
            if len(scenes) > self._capacity:
                del scenes[0]

    def draw(
        self, n: int, *, from_start: float, rng: np.random.Generator, layout: SceneLayout | None = None
    ) -> tuple[SceneLayout, NDArray[np.float64]]:
        """Draw n scenes with the same objects, some of them from where episodes began.

        Parameters
        ----------
        n
            How many.
        from_start
            Share of first scenes.
        rng
            Draws layout and scenes.
        layout
            Which objects they show; default: drawn, as often as each was seen.
        """
        if not self._all:
            raise ConfigError("no scenes to begin roll-outs in: add some that were seen (explore)")
        if layout is None:
            counts = np.array([len(scenes) for scenes in self._all.values()], dtype=np.float64)
            layout = list(self._all)[int(rng.choice(len(counts), p=counts / counts.sum()))]
        firsts, scenes = self._firsts.get(layout, []), self._all[layout]
        chosen = [
            pool[int(rng.integers(len(pool)))]
            for pool in (firsts if firsts and u < from_start else scenes for u in rng.random(n))
        ]
        return layout, np.stack(chosen)

    def starts(
        self,
        n: int,
        model: DreamModel,
        config: DynaConfig,
        *,
        rng: np.random.Generator,
        layout: SceneLayout | None = None,
    ) -> tuple[SceneLayout, NDArray[np.float64]]:
        """Draw n scenes in which roll-outs begin, varied as `config` says.

        Parameters
        ----------
        n
            How many.
        model
            Says what may be varied.
        config
            Share of first scenes, and what is varied.
        rng
            Draws all of it.
        layout
            Which objects they show; default: drawn.
        """
        layout, vectors = self.draw(n, from_start=config.from_start, rng=rng, layout=layout)
        if config.permute:
            vectors = permuted(layout, vectors, model, rng=rng)
        if config.resample:
            vectors = self.resampled(layout, vectors, model, rng=rng)
        if config.perturb_velocity:
            fast = rng.random(n) < config.perturb_velocity
            vectors[fast] = self.perturbed(layout, vectors[fast], model, rng=rng)
        return layout, vectors

    def perturbed(
        self, layout: SceneLayout, vectors: Float2D, model: DreamModel, *, rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """The scenes with other velocities of the bodies that move.

        Drawn from an interval twice as wide as that of the velocities seen, about the same middle.
        """
        varied, moving = vectors.copy(), changing(model)
        columns = [
            layout.offsets[index] + column
            for index in layout.bodies
            for t in (layout.types[index],)
            for column in t.velocity_columns()
            if column >= 0 and (t.name, t.properties[column]) in moving
        ]
        seen = np.array([scene[columns] for scene in self._all.get(layout, ())])
        if len(seen) and columns:
            low, high = seen.min(axis=0), seen.max(axis=0)
            half = (high - low) / 2.0
            varied[:, columns] = rng.uniform(low - half, high + half, (len(varied), len(columns)))
        return varied

    def resampled(
        self, layout: SceneLayout, vectors: Float2D, model: DreamModel, *, rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """The scenes with other values of what nothing else depends on (`free_properties`).

        Drawn between the smallest and the largest value that episodes began with.
        """
        varied = vectors.copy()
        firsts = self._firsts.get(layout)
        if not firsts:
            return varied
        seen = np.stack(firsts)
        free = free_properties(model)
        for index, t in enumerate(layout.types):
            for prop in t.properties:
                if (t.name, prop) in free:
                    column = layout.column(index, prop)
                    low, high = seen[:, column].min(), seen[:, column].max()
                    varied[:, column] = rng.uniform(low, high, len(varied))
        return varied


def free_properties(model: DreamModel) -> frozenset[tuple[str, str]]:
    """(type, property) of bodiless objects that no law but its own mentions.

    Action and task apart. Empty for a model without modes, and for scenes in which nothing has a body: there the parts
    of a state depend on each other.
    """
    modes = getattr(model, "modes", None)
    if modes is None or not any(t.has_body for t in model.schema.types):
        return frozenset()
    bodiless = [t for t in model.schema.types if not t.has_body and t.name not in (ACTION, TASK)]
    mentioned = {
        (role.type, name)
        for target in model.targets
        for mode in modes(target.type, target.property)
        for role in mode.roles
        for prop, _ in role.terms
        for name in (prop.rstrip("'"),)
        if (role.type, name) != (target.type, target.property)
    }
    return frozenset((t.name, p) for t in bodiless for p in t.properties) - mentioned


def changing(model: DreamModel) -> set[tuple[str, str]]:
    """(type, property) pairs that the model lets change: its targets, and what follows from them."""
    derived = {(law.type, law.property) for law in model.schema.kinematics}
    return {(t.type, t.property) for t in model.targets} | derived


def permuted(
    layout: SceneLayout, vectors: Float2D, model: DreamModel, *, rng: np.random.Generator
) -> NDArray[np.float64]:
    """The scenes with objects of the same type exchanged, each in its own way.

    Twice: all properties, which merely renames the objects, since names mean nothing to a model of objects;
    and what is an object's own (neither place nor size nor motion, nothing that ever changes), so that
    another one stands in the same place.

    Parameters
    ----------
    layout
        The scenes' layout.
    vectors
        State vectors, shape ``(n, layout.width)``.
    model
        Says what may change.
    rng
        Draws the permutations.
    """
    varied = vectors.copy()
    moving = changing(model)
    for name in dict.fromkeys(t.name for t in layout.types):
        indices = layout.of_type(name)
        if len(indices) < 2 or name in (ACTION, TASK):
            continue
        t = layout.types[indices[0]]
        for properties in (t.properties, _own_properties(t, moving)):
            if properties:
                columns = np.array([[layout.column(i, p) for p in properties] for i in indices])
                order = rng.permuted(np.tile(np.arange(len(indices)), (len(varied), 1)), axis=1)
                varied[:, columns] = np.take_along_axis(varied[:, columns], order[:, :, None], axis=1)
    return varied


def _own_properties(t: ObjectType, moving: set[tuple[str, str]]) -> tuple[str, ...]:
    placed = {t.properties[k] for k in (*t.pose_columns(), *t.velocity_columns()) if k >= 0}
    return tuple(p for p in t.properties if p not in placed and (t.name, p) not in moving)
