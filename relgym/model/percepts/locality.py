"""Scenes of very many bodies are looked at locally: each object that is learned of, with the bodies nearest to it.

Relations are told of pairs, and a thousand bodies are half a million of them. What a body does depends on what is
near, so a scene of more than `MOST` bodies is taken apart: for each object whose properties are targets there is a
small scene of it and its nearest neighbours, some of each type, and that is what is learned from and predicted. All
small scenes have the same layout, whoever the neighbours are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import NEAREST, PAIRS
from relgym.errors import ConfigError
from relgym.model.learning.transition import NOTHING, LearnReport, learn
from relgym.model.parts import Parts
from relgym.model.percepts.perception import Percept
from relgym.model.percepts.scenes import next_values, passage, wrap
from relgym.model.predicting.prediction import OUTCOMES, BatchPrediction, Prediction, ScenePrediction
from relgym.model.predicting.querying import derive, predict, predict_many
from relgym.model.target.hindsight import Confirmed
from relgym.scene.axes import Axes
from relgym.scene.objects import ACTION, Scene, SceneLayout, Transition, pose_columns

__all__ = [
    "MOST",
    "Neighbourhoods",
    "check_size",
    "foci",
    "large",
    "learn_locally",
    "predict_locally",
    "predict_many_locally",
]

Ask: TypeAlias = Callable[[Scene, Callable[[Scene], Percept]], ScenePrediction | None]
"""From a scene, and what is seen of it if somebody looks, to what follows; None: arrays must say that."""

MOST = math.isqrt(PAIRS)
"""Scenes of no more bodies than this are looked at as a whole."""

SINGLY = PAIRS // (NEAREST * NEAREST)
"""So many objects are looked at one by one: of a transition at most so many that changed are learned from, and up to so
many are predicted with all that is told of a prediction; more in one batch, in which roles and spreads aren't told."""


def large(layout: SceneLayout) -> bool:
    """Whether scenes of a layout are taken apart; not where there are so many types that it would gain nothing."""
    if len(layout.bodies) <= MOST:
        return False
    kinds: int | None = layout.__dict__.get("_kinds")
    if kinds is None:
        kinds = layout.__dict__["_kinds"] = len({layout.types[k].name for k in layout.bodies})
    return kinds <= NEAREST


def check_size(parts: Parts, layout: SceneLayout) -> None:
    """Raise `ConfigError` where a step would take long: many kinds of bodies, of which many are learned of."""
    bodies = len(layout.bodies)
    if bodies <= MOST or large(layout):
        return
    able = {
        t.name
        for t in layout.types
        if t.name != ACTION and set(t.properties) - set(t.exogenous) and t.velocity
    }
    learned = able if parts.open else {t.type for t in parts.targets}
    movers = sum(t.name in learned for t in layout.types)
    if movers * bodies > PAIRS:
        raise ConfigError(
            f"the scene has {bodies} bodies of more than {NEAREST} types, and {movers} of them are to be learned of: "
            f"at most {PAIRS // bodies} of so many; name the targets that matter "
            "(targets=['type.property', ...]), or give bodies that behave alike one type"
        )


@dataclass(frozen=True, slots=True)
class _Plan:
    """What must be known of a large layout; cached on it."""

    small: SceneLayout
    poses: NDArray[np.intp]  # columns of the bodies' poses, of a vector with (0, 1) appended
    used: tuple[int, ...]
    bodies: NDArray[np.intp]  # indices of the objects that have bodies
    groups: dict[
        str, tuple[NDArray[np.intp], int]
    ]  # numbers of each type's bodies, and how many are looked at
    bodiless: dict[str, list[int]]
    offsets: NDArray[np.intp]  # where each object's numbers begin
    widths: NDArray[np.intp]  # how many numbers each object of the small scene has
    within: NDArray[np.intp]  # for each number of the small scene, the how-manieth of its object it is

    @classmethod
    def of(cls, scene: Scene) -> _Plan:
        layout = scene.layout
        known: _Plan | None = layout.__dict__.get("_neighbourhoods")
        if known is None:
            known = layout.__dict__["_neighbourhoods"] = cls._make(scene)
        return known

    @classmethod
    def _make(cls, scene: Scene) -> _Plan:
        layout, having = scene.layout, set(scene.layout.bodies)
        types: dict[str, list[int]] = {}
        for number, index in enumerate(layout.bodies):
            types.setdefault(layout.types[index].name, []).append(number)
        sizes = [len(members) for members in types.values()]
        share = max(1, NEAREST // len(sizes))
        while sum(min(size, share + 1) for size in sizes) <= NEAREST and share < max(sizes):
            share += 1
        groups = {name: (np.array(members), min(len(members), share)) for name, members in types.items()}
        bodiless: dict[str, list[int]] = {}
        for k, t in enumerate(layout.types):
            if k not in having:
                bodiless.setdefault(t.name, []).append(k)
        # The first objects of each type lend their names.
        names = [layout.names[k] for each in bodiless.values() for k in each]
        names += [
            layout.names[layout.bodies[n]] for members, count in groups.values() for n in members[:count]
        ]
        axes = Axes.of(scene.schema)
        bodies, offsets = (np.array(each, dtype=np.intp) for each in (layout.bodies, layout.offsets))
        small = scene.schema.layout(names)
        widths = np.array([len(t.properties) for t in small.types], dtype=np.intp)
        within = np.arange(small.width) - np.repeat(small.offsets, widths)
        poses = pose_columns(layout)[0]
        return cls(small, poses, axes.used, bodies, groups, bodiless, offsets, widths, within)


@dataclass(frozen=True, slots=True)
class _Window:
    """A small scene around one object of a large one: which objects are in it, and where its numbers lie there."""

    objects: list[int]
    place: int  # of the object in the small scene
    scene: Scene
    columns: NDArray[np.intp]


class Neighbourhoods:
    """One large scene, taken apart; what was seen of it is kept.

    Parameters
    ----------
    parts
        The model that looks at it.
    scene
        The scene.

    Notes
    -----
    Cost O(bodies) an object, some 0.1 ms for a thousand, and what a scene of `NEAREST` bodies costs.
    """

    def __init__(self, parts: Parts, scene: Scene) -> None:
        self._parts, self._scene, self._plan = parts, scene, _Plan.of(scene)
        self._windows: dict[int, _Window] = {}
        self._percepts: dict[int, Percept] = {}
        pose = np.concatenate([scene.vector, (0.0, 1.0)])[self._plan.poses]
        self._centre = pose[:, self._plan.used]
        half = 0.5 * pose[:, [6 + axis for axis in self._plan.used]]
        if pose[:, 3:6].any():
            turned = (pose[:, 3:6] != 0.0).any(axis=1)
            half[turned] = np.sqrt(np.square(half[turned]).sum(axis=1, keepdims=True))
        self._half = half

    def window(self, focus: int) -> _Window:
        """The small scene around the object with this index."""
        if focus not in self._windows:
            self._windows[focus] = self._make(focus)
        return self._windows[focus]

    def percept(self, focus: int) -> Percept:
        """What the learners see of it."""
        if focus not in self._percepts:
            small = self.window(focus).scene
            self._percepts[focus] = self._parts.perception.percept(small.layout, small.vector[None])
        return self._percepts[focus]

    def named(self, focus: int) -> Scene:
        """The small scene under the objects' own names, for people."""
        scene = self._scene
        names = {scene.layout.names[k] for k in self.window(focus).objects}
        return scene.schema.scene({name: part for name, part in scene.values().items() if name in names})

    def _make(self, focus: int) -> _Window:
        plan = self._plan
        number = int(np.searchsorted(plan.bodies, focus))
        chosen = {name: list(each) for name, each in plan.bodiless.items()}
        there = number < len(plan.bodies) and plan.bodies[number] == focus
        away = np.zeros(len(plan.bodies))  # from who has no body nothing is far away
        if there:
            gaps = np.abs(self._centre - self._centre[number]) - self._half - self._half[number]
            gaps = np.square(np.maximum(gaps, 0.0))
            away = gaps[:, 0].copy()
            for axis in range(1, gaps.shape[1]):  # column by column, which takes a fourth of the time
                away += gaps[:, axis]
            away[number] = -1.0  # the object itself comes before all others of its type
        for name, (members, count) in plan.groups.items():
            chosen[name] = sorted(plan.bodies[members[_nearest(away[members], count)]].tolist())
        objects = [chosen[t.name].pop(0) for t in plan.small.types]
        columns = np.repeat(plan.offsets[objects], plan.widths) + plan.within
        small = Scene(self._scene.schema, plan.small, self._scene.vector[columns])
        return _Window(objects, objects.index(focus), small, columns)


def _nearest(away: NDArray[np.float64], count: int) -> NDArray[np.intp]:
    """Which are nearest, of those equally near the first; the same as the beginning of a stable sort, in less time."""
    if count >= len(away):
        return np.arange(len(away))
    near = np.flatnonzero(away <= np.partition(away, count - 1)[count - 1])
    return near[np.argsort(away[near], kind="stable")[:count]]


def learn_locally(
    parts: Parts,
    near: Neighbourhoods,
    transition: Transition,
    seen: int,
    told: ScenePrediction | None = None,
    confirmed: Mapping[tuple[str, str], Confirmed] = NOTHING,
) -> LearnReport:
    """Take up one transition of a large scene: of the objects that changed, or of one that didn't in its turn."""
    before, after = transition.before, transition.after
    layout, following = before.layout, next_values(before, after)
    whole: LearnReport | None = None
    for focus in _learned(parts, before, after, following, seen):
        window = near.window(focus)
        later = Scene(before.schema, window.scene.layout, following[window.columns])
        step = Transition(window.scene, later)
        said = None if told is None else _told_of(told, window, layout)
        own, name = layout.names[focus], window.scene.layout.names[window.place]
        came = {(name, prop): one for (which, prop), one in confirmed.items() if which == own}
        report = learn(parts, near.percept(focus), step, frozenset({window.place}), said, came)
        named = {(layout.names[focus], prop): part for (_, prop), part in report.parts.items()}
        known = {} if whole is None else whole.parts
        whole = LearnReport(known | named, report.work + (0 if whole is None else whole.work))
    return LearnReport({}, 0) if whole is None else whole


def _told_of(told: ScenePrediction, window: _Window, layout: SceneLayout) -> ScenePrediction | None:
    """What was predicted of the object that a small scene is around, in its names; None where others play roles."""
    names = {layout.names[k]: window.scene.layout.names[n] for n, k in enumerate(window.objects)}
    own = layout.names[window.objects[window.place]]
    found = []
    for one in told.parts:
        if one.object == own:
            if not all(role in names for role in one.roles):
                return None
            roles = tuple(names[role] for role in one.roles)
            found.append(one.replace(object=names[own], roles=roles))
    return ScenePrediction(window.scene, tuple(found))


def _learned(
    parts: Parts, before: Scene, after: Scene, following: NDArray[np.float64], seen: int
) -> list[int]:
    layout, there = before.layout, passage(before.layout, after.layout).stays

    def able(some: Iterable[int]) -> list[int]:
        """Those of some objects that are learned of."""
        types = [layout.types[k].name for k in some]
        known = [t in parts.by_type or (parts.open and t != ACTION) for t in types]
        return [k for k, ok in zip(some, known, strict=True) if ok and there[k]]

    changes = np.logical_or.reduceat(following != before.vector, _Plan.of(before).offsets)
    moved = able(np.flatnonzero(changes).tolist())
    if not moved:
        every = able(range(len(layout.types)))
        return every[seen % len(every) :][:1] if every else []
    return [moved[k] for k in np.unique(np.linspace(0, len(moved) - 1, SINGLY).astype(int)).tolist()]


def predict_locally(parts: Parts, near: Neighbourhoods, scene: Scene, ask: Ask) -> ScenePrediction:
    """Predict the scene that follows a large one; `ask` is asked of small ones first."""
    layout, following = scene.layout, scene.vector.copy()
    foci = _predicted(parts, layout)
    if len(foci) > SINGLY:
        batch = predict_many_locally(parts, [near], layout, scene.vector[None])
        return ScenePrediction(Scene(scene.schema, layout, batch.vectors[0].copy()), _told(batch))
    found: list[Prediction] = []
    for focus in foci:
        window = near.window(focus)
        names = dict(zip(window.scene.layout.names, (layout.names[k] for k in window.objects), strict=True))
        said = ask(window.scene, partial(_seen, near, focus))
        for one in (said or predict(parts, near.percept(focus), window.scene)).parts:
            if names[one.object] == layout.names[focus]:
                roles = tuple(names[role] for role in one.roles)
                found.append(one.replace(object=layout.names[focus], roles=roles))
                following[layout.column(focus, one.property)] = one.value
    derive(parts.schema, layout, scene.vector[None], following[None])
    wrap(layout, following)
    return ScenePrediction(Scene(scene.schema, layout, following), tuple(found))


def _seen(near: Neighbourhoods, focus: int, _: Scene) -> Percept:
    return near.percept(focus)


def predict_many_locally(
    parts: Parts, near: Sequence[Neighbourhoods], layout: SceneLayout, vectors: NDArray[np.float64]
) -> BatchPrediction:
    """Predict what follows n large scenes with the same objects."""
    following, keys, frames = vectors.copy(), list[tuple[str, str]](), list[str]()
    columns: list[tuple[NDArray[Any], ...]] = []
    for focus in _predicted(parts, layout):
        windows = [each.window(focus) for each in near]
        small = np.stack([window.scene.vector for window in windows]) if windows else np.zeros((0, 0))
        if not windows:
            continue
        inner = windows[0].scene.layout
        said = predict_many(parts, parts.perception.percept(inner, small), inner, small)
        places = np.array([window.place for window in windows])
        for target in (t for t in parts.targets if t.type == layout.types[focus].name):
            where = {name: k for k, (name, prop) in enumerate(said.parts) if prop == target.property}
            part = np.array([where[inner.names[place]] for place in places])
            rows = np.arange(len(vectors))
            at = np.array([inner.column(int(place), target.property) for place in places])
            following[:, layout.column(focus, target.property)] = said.vectors[rows, at]
            tables = (said.modes, said.outcomes, said.margins, said.probabilities, said.intervals)
            columns.append(tuple(table[rows, part] for table in tables))
            keys.append((layout.names[focus], target.property))
            frames.append(said.frames[int(part[0])])
    derive(parts.schema, layout, vectors, following)
    wrap(layout, following)
    n = len(vectors)
    kinds = (np.int64, np.int8, np.float64, np.float64, np.float64)
    modes, outcomes, margins, probabilities, intervals = (
        np.stack([c[k] for c in columns], axis=1) if columns else np.zeros((n, 0), dtype=kind)
        for k, kind in enumerate(kinds)
    )
    return BatchPrediction(
        layout,
        following,
        tuple(keys),
        modes,
        outcomes,
        margins,
        tuple(frames),
        probabilities,
        intervals,
    )


def _predicted(parts: Parts, layout: SceneLayout) -> list[int]:
    return [k for name in dict.fromkeys(t.type for t in parts.targets) for k in layout.of_type(name)]


def foci(parts: Parts, layout: SceneLayout) -> list[int]:
    """Indices of some objects that are predicted, for people."""
    return _predicted(parts, layout)[:SINGLY]


def _told(batch: BatchPrediction) -> tuple[Prediction, ...]:
    """A batch of one scene as single predictions."""
    layout, found = batch.layout, []
    for k, (name, prop) in enumerate(batch.parts):
        value = float(batch.vectors[0, layout.column(layout.index(name), prop)])
        outcome, mode = OUTCOMES[int(batch.outcomes[0, k])], int(batch.modes[0, k])
        one = Prediction(name, prop, value, outcome, mode, (), float(batch.margins[0, k]), batch.frames[k])
        stated = float(batch.probabilities[0, k]), float(batch.intervals[0, k])
        found.append(one.replace(probability=stated[0], interval=stated[1]))
    return tuple(found)
