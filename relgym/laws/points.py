"""Points at which bodies that turn touch, and the islands of bodies that act on each other through them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relgym.laws.frames import turned
from relgym.scene.geometry.manifolds import Manifolds
from relgym.scene.geometry.vectors import FloatArray

__all__ = ["Island", "Points", "across", "find_points", "lever"]


def lever(arm: FloatArray, axis: FloatArray) -> FloatArray:
    """How a push along an axis at the end of an arm turns a body: their cross product, shape ``(...)``."""
    found: FloatArray = arm[0] * axis[1] - arm[1] * axis[0]
    return found


def across(moving: FloatArray, arm: FloatArray) -> FloatArray:
    """Velocity of a body's point: that of its position, and its turning rate times the arm, turned."""
    found: FloatArray = moving[:2] + moving[2] * turned(arm)
    return found


@dataclass(frozen=True, slots=True)
class Points:
    """Contact points of n scenes, p of them, in the order of scenes and pairs.

    Attributes
    ----------
    scene, pair
        Each point's scene, and the number of its pair in the cast, shape ``(p,)``.
    normal
        Unit vector from the second body to the first, shape ``(2, p)``.
    arms
        From the position of the first and of the second body to the point on its own edge, shape ``(2, 2, p)``:
        bodies, then components.
    """

    scene: NDArray[np.intp]
    pair: NDArray[np.intp]
    normal: FloatArray
    arms: FloatArray

    def __len__(self) -> int:
        return len(self.scene)

    def take(self, rows: NDArray[np.intp]) -> Points:
        """Some of the points; `rows` may have any shape."""
        return Points(self.scene[rows], self.pair[rows], self.normal[:, rows], self.arms[:, :, rows])

    def islands(
        self, first: NDArray[np.intp], second: NDArray[np.intp], moves: NDArray[np.bool_]
    ) -> Iterator[Island]:
        """Points by the bodies that they tie together, islands with equally many points at once.

        Parameters
        ----------
        first, second
            Bodies of the cast's pairs.
        moves
            Whether each of the cast's K bodies is moved by contacts, shape ``(K,)``: what isn't ties nothing.
        """
        if not len(self):
            return
        ends = [self.scene * len(moves) + side[self.pair] for side in (first, second)]
        both = np.flatnonzero(moves[second[self.pair]])
        label = np.arange(int(max(end.max() for end in ends)) + 1)
        while True:
            least = np.minimum(label[ends[0][both]], label[ends[1][both]])
            before = label.copy()
            np.minimum.at(label, ends[0][both], least)
            np.minimum.at(label, ends[1][both], least)
            if np.array_equal(before, label):
                break
        own = label[ends[0]]
        order = np.argsort(own, kind="stable")
        _, starts, counts = np.unique(own[order], return_index=True, return_counts=True)
        for count in np.unique(counts).tolist():
            rows = order[starts[counts == count][:, None] + np.arange(count)]
            yield Island(rows, self.take(rows))


@dataclass(frozen=True, slots=True)
class Island:
    """m islands of c points each: which of all points they are, shape ``(m, c)``, and these."""

    rows: NDArray[np.intp]
    points: Points


def find_points(
    manifolds: Manifolds,
    pose: FloatArray,
    hits: NDArray[np.bool_],
    first: NDArray[np.intp],
    second: NDArray[np.intp],
) -> Points:
    """Contact points of n scenes.

    Parameters
    ----------
    manifolds
        The geometry of the layout's bodies.
    pose
        Poses of all bodies, shape ``(n, K, 9)``.
    hits
        Which pairs may touch, shape ``(n, P)``.
    first, second
        The pairs' bodies.
    """
    scene, pair = np.nonzero(hits)
    a, b = first[pair], second[pair]
    found = manifolds.touch(pose[scene, a].T, a, pose[scene, b].T, b)
    return Points(scene[found.pair], pair[found.pair], found.normal, np.stack([found.first, found.second]))
