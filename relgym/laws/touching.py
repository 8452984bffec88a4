"""Which bodies touch which, in a batch of scenes: what the laws act on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relgym.laws.columns import Sources
from relgym.laws.frames import Bearings
from relgym.laws.points import Points, find_points
from relgym.laws.records import Kind
from relgym.scene.axes import WORLD, Axes
from relgym.scene.contacts import velocity_columns
from relgym.scene.geometry.areas import mean_squares
from relgym.scene.geometry.manifolds import Manifolds
from relgym.scene.geometry.vectors import FloatArray, norm
from relgym.scene.objects import ObjectType, SceneLayout, poses
from relgym.scene.relations import Relations
from relgym.scene.schema import SceneSchema

__all__ = ["Cast", "Contacts", "Group"]


@dataclass(frozen=True)
class Cast:
    """What a layout means for the laws: who moves, and which pairs may meet.

    Attributes
    ----------
    axes
        The schema's axes.
    layout
        The layout.
    movers
        Body numbers of objects whose velocity is learned.
    sources
        Columns of each mover, by body number, and where they lie.
    first, second
        Bodies of every pair that may meet: the first one moves, shape ``(P,)``.
    kinds
        Types of each pair.
    both
        Whether the second one moves too, shape ``(P,)``.
    velocities
        Column of every body's velocity along the axes in use, and of its spin where some type has one; shape
        ``(d, K)`` or ``(d + 1, K)``; of a 0 where there is none.
    spins
        Whether a body's spin is learned, shape ``(K,)``.
    pairs
        `first` and `second` of each pair.
    manifolds
        Finds the points of contacts, where bodies turn that aren't round; else None.
    squares
        Area and mean squares of the bodies' canonical shapes (`mean_squares`), shape ``(3, K)``; empty otherwise.
    """

    axes: Axes
    layout: SceneLayout
    movers: tuple[int, ...]
    sources: Mapping[int, tuple[Sources, NDArray[np.intp]]]
    first: NDArray[np.intp]
    second: NDArray[np.intp]
    kinds: tuple[Kind, ...]
    both: NDArray[np.bool_]
    velocities: NDArray[np.intp]
    spins: NDArray[np.bool_]
    pairs: tuple[tuple[int, int], ...]
    manifolds: Manifolds | None
    squares: FloatArray

    @classmethod
    def of(cls, schema: SceneSchema, layout: SceneLayout, sources: Mapping[str, Sources]) -> Cast:
        """Work out the cast of a layout; `sources` are those of the types whose velocity is learned."""
        axes = Axes.of(schema)
        types = [layout.types[i] for i in layout.bodies]
        movers = tuple(k for k, t in enumerate(types) if t.name in sources)
        pairs = []
        for a in movers:
            for b, t in enumerate(types):
                # A pair of movers counts once, in an order that no body's number decides between types.
                if a != b and (b not in movers or (types[a].name, a) < (t.name, b)):
                    pairs.append((a, b))
        first, second = (np.array([p[k] for p in pairs], dtype=np.intp) for k in (0, 1))
        columns = velocity_columns(layout, axes)
        spin = _spin_columns(layout, sources)
        if any(s.spin for s in sources.values()):
            columns = np.concatenate([columns, spin[None]])
        return cls(
            axes,
            layout,
            movers,
            {
                k: (
                    sources[types[k].name],
                    sources[types[k].name].places(
                        layout, layout.bodies[k], layout.width + 2 + number * len(axes.used)
                    ),
                )
                for number, k in enumerate(movers)
            },
            first,
            second,
            tuple((types[a].name, types[b].name) for a, b in pairs),
            np.isin(second, np.array(movers, dtype=np.intp)),
            np.where(columns < 0, layout.width + 1, columns),
            spin >= 0,
            tuple(pairs),
            *_geometry(axes, types, sources),
        )

    @cached_property
    def bodies(self) -> dict[str, int]:
        """Number of each body, by name."""
        return {self.layout.names[index]: body for body, index in enumerate(self.layout.bodies)}

    @property
    def dimensions(self) -> int:
        """Number of components of a velocity."""
        return len(self.axes.used)

    def padded(self, vectors: NDArray[np.float64]) -> FloatArray:
        """State vectors, columns first, with NaN and 0 behind them, shape ``(width + 2, n)``.

        Where bodies turn, each mover's velocity times its magnitude follows.
        """
        n = len(vectors)
        whole = np.concatenate([vectors.T, np.full((1, n), np.nan), np.zeros((1, n))])
        return whole if self.manifolds is None else np.concatenate([whole, self._dragged(whole)])

    def padded_one(self, vector: NDArray[np.float64]) -> FloatArray:
        """`padded` of a single scene, shape ``(width + 2,)``, and more where bodies turn."""
        found = np.empty(len(vector) + 2)
        found[:-2], found[-2], found[-1] = vector, np.nan, 0.0
        return found if self.manifolds is None else np.concatenate([found, self._dragged(found)])

    def _dragged(self, whole: FloatArray) -> FloatArray:
        """Each mover's velocity times its magnitude, mover by mover, of padded vectors ``(width + 2, ...)``."""
        velocity = whole[self.velocities[: self.dimensions, list(self.movers)]]  # (d, movers, ...)
        found: FloatArray = (norm(velocity) * velocity).swapaxes(0, 1).reshape(-1, *whole.shape[1:])
        return found


def _geometry(
    axes: Axes, types: list[ObjectType], sources: Mapping[str, Sources]
) -> tuple[Manifolds | None, FloatArray]:
    """What finds the points of contacts and what masses follow from, if something turns that isn't round."""
    plane = axes.used[0], axes.used[1]
    if not any(s.turns for s in sources.values()):
        return None, mean_squares([], plane)
    shapes = [t.shape for t in types if t.shape is not None]
    return Manifolds(axes, shapes), mean_squares(shapes, plane)


def _spin_columns(layout: SceneLayout, sources: Mapping[str, Sources]) -> NDArray[np.intp]:
    """Column of every body's spin, shape ``(K,)``; -1 where it has none."""
    names = [(i, sources.get(layout.types[i].name)) for i in layout.bodies]
    found = [layout.column(i, s.spin) if s is not None and s.spin is not None else -1 for i, s in names]
    return np.array(found, dtype=np.intp)


@dataclass(frozen=True, slots=True)
class Group:
    """Scenes with equally many contacts.

    Attributes
    ----------
    scenes
        Their numbers in the batch, shape ``(m,)``.
    pairs
        Number of each contact's pair in the cast, shape ``(m, c)``.
    bearings
        Directions at the contacts, shape ``(d, m, c)``.
    """

    scenes: NDArray[np.intp]
    pairs: NDArray[np.intp]
    bearings: Bearings


@dataclass(frozen=True, slots=True)
class Contacts:
    """Contacts of a batch of scenes.

    Attributes
    ----------
    relations
        Where directions are read; may be None where points are known, which have their own.
    pose
        Poses of all bodies, shape ``(n, K, 9)``.
    hits
        Which pairs of the cast touch, shape ``(n, P)``.
    points
        At which points, where bodies turn that aren't round.
    """

    cast: Cast
    relations: Relations | None
    pose: NDArray[np.float64]
    hits: NDArray[np.bool_]
    points: Points | None = None

    @classmethod
    def of(cls, cast: Cast, relations: Relations, vectors: NDArray[np.float64]) -> Contacts:
        """Find the contacts of n scenes."""
        pose = poses(cast.layout, vectors)
        if cast.manifolds is None:
            return cls(cast, relations, pose, relations.touching(cast.first, cast.second))
        hits = relations.near(cast.first, cast.second)
        points = find_points(cast.manifolds, pose, hits, cast.first, cast.second)
        met = np.zeros_like(hits)
        met[points.scene, points.pair] = True
        return cls(cast, relations, pose, met, points)

    def scene(self, number: int) -> Contacts:
        """The contacts of one of the scenes; quickly where they are points: these say all that laws ask for."""
        part = slice(number, number + 1)
        pose, hits = self.pose[part], self.hits[part]
        if self.points is None:
            return Contacts(self.cast, self._read().rows(part), pose, hits)
        own = self.points.take(np.flatnonzero(self.points.scene == number))
        return Contacts(self.cast, None, pose, hits, replace(own, scene=np.zeros_like(own.scene)))

    def groups(self) -> Iterator[Group]:
        """Scenes by their number of contacts, those without any left out."""
        counts = self.hits.sum(axis=1)
        for count in np.unique(counts[counts > 0]).tolist():
            scenes = np.flatnonzero(counts == count)
            pairs = np.nonzero(self.hits[scenes])[1].reshape(len(scenes), count)
            yield Group(scenes, pairs, self.bearings(scenes[:, None], pairs))

    def _read(self) -> Relations:
        assert self.relations is not None, "bodies that touch in points have their directions there"
        return self.relations

    def bearings(self, scenes: NDArray[np.intp], pairs: NDArray[np.intp]) -> Bearings:
        """Directions at contacts; the arguments have a common shape after broadcasting."""
        a, b = self.cast.first[pairs], self.cast.second[pairs]
        used = list(self.cast.axes.used)
        pose_a, pose_b = self.pose[scenes, a], self.pose[scenes, b]
        between = np.moveaxis(pose_a[..., used] - pose_b[..., used], -1, 0)
        length = norm(between)
        angles = np.moveaxis(pose_a[..., 3:6], -1, 0)
        if self.cast.axes.planar:
            angles = np.repeat(self.cast.axes.turn * angles[self.cast.axes.depth][None], len(WORLD), axis=0)
        normals = np.empty(between.shape)
        for body in np.unique(a).tolist():
            part = a == body
            rows = np.broadcast_to(scenes, a.shape)[part]
            normals[:, part] = self._read().normals(body)[rows, b[part]].T
        return Bearings(normals, between / np.where(length > 0.0, length, 1.0), angles)

    def arms(self, scenes: NDArray[np.intp], bodies: NDArray[np.intp]) -> FloatArray:
        """How far from their centres bodies that spin are touched; 0 for others. Negative if spins turn clockwise.

        The arguments have a common shape after broadcasting.
        """
        radius = 0.5 * self.cast.axes.turn * self.pose[scenes, bodies, 6 + self.cast.axes.used[0]]
        return np.where(self.cast.spins[bodies], radius, 0.0)
