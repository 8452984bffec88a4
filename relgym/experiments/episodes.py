"""Episodes of consecutive transitions, with the truth about what happened in each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.scene.objects import Float2D, Scene, SceneLayout, Transition
from relgym.scene.schema import SceneSchema

__all__ = ["Episode", "Truth"]

Int1D: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True)
class Truth:
    """What really happened in each of an episode's n transitions.

    Attributes
    ----------
    mode : mapping of target (``"ball.vx"``) to int array of shape ``(n,)``
        Number of the analytic mode; -1 where no single one applies (corner hits, several active contacts).
    mode_names : mapping of target to the modes' names.
    active : int array of shape ``(n,)``
        How many contacts changed the velocity.
    corner : bool array of shape ``(n,)``
        Whether one of those was with a corner: its normal depends on the geometry, so no linear mode
        explains it.
    touched, pushing : tuples of n sets of names
        What the ball overlapped, and what of that changed its velocity; empty where no ball is.
    """

    mode: Mapping[str, Int1D]
    mode_names: Mapping[str, tuple[str, ...]]
    active: Int1D
    corner: NDArray[np.bool_]
    touched: tuple[frozenset[str], ...] = ()
    pushing: tuple[frozenset[str], ...] = ()


@dataclass(frozen=True)
class Episode:
    """One episode: n consecutive transitions (§4.2).

    Attributes
    ----------
    schema, layout
        What the scenes are made of; all episodes of a data set share the schema.
    vectors : float array of shape ``(n + 1, layout.width)``
        State vectors. Row i with its action is the scene before transition i, row i + 1 the scene after.
        The last row's action is 0: none was chosen there.
    truth
        What really happened.
    configuration
        Reset options that give the same initial scene again.
    """

    schema: SceneSchema
    layout: SceneLayout
    vectors: Float2D
    truth: Truth
    configuration: Mapping[str, Any]

    def __len__(self) -> int:
        return len(self.vectors) - 1

    def scene(self, index: int) -> Scene:
        """The scene of one row of `vectors`."""
        return Scene(self.schema, self.layout, self.vectors[index])

    def transitions(self) -> Iterator[Transition]:
        """The episode's transitions in order."""
        scenes = [self.scene(i) for i in range(len(self.vectors))]
        return (Transition(before, after) for before, after in pairwise(scenes))

    def columns(self, object_name: str, *properties: str) -> Float2D:
        """Values of an object's properties, shape ``(n + 1, len(properties))``."""
        index = self.layout.index(object_name)
        return self.vectors[:, [self.layout.column(index, prop) for prop in properties]]
