"""First scenes of dreams: drawn by a function, or from scenes that are known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from relgym.arguments import refusing
from relgym.errors import ConfigError
from relgym.scene.objects import Float1D, Float2D, Scene

__all__ = ["BatchStart", "Drawn", "Start", "drawn_from"]

Start: TypeAlias = Callable[[np.random.Generator], Scene]
"""Draws a first scene."""

BatchStart: TypeAlias = Callable[[np.random.Generator, int], Float2D]
"""Draws the state vectors of n first scenes, shape ``(n, layout.width)``."""


class Drawn:
    """First scenes of a batch of dreams, drawn uniformly: see `drawn_from`.

    Parameters
    ----------
    scenes
        Scenes, or state vectors.
    """

    def __init__(self, scenes: Sequence[Scene] | Float2D) -> None:
        given: Any = scenes
        if not isinstance(given, np.ndarray) and not (
            isinstance(given, Sequence) and all(isinstance(scene, Scene) for scene in given)
        ):
            raise ConfigError(
                f"expected scenes, or an array of state vectors, got {given!r}; take env.scene, or "
                "schema.scene(observation)"
            )
        if (isinstance(scenes, np.ndarray) and scenes.ndim != 2) or not len(scenes):
            came = f"an array of shape {scenes.shape}" if isinstance(scenes, np.ndarray) else "none"
            raise ConfigError(f"expected some scenes with the same objects, got {came}")
        self._scenes = scenes
        self._vectors: Float2D | None = None
        if isinstance(scenes, np.ndarray):
            self._vectors = scenes.astype(np.float64)
        elif len({scene.layout for scene in scenes}) == 1:
            self._vectors = np.array([scene.vector for scene in scenes])

    def fit(self, vector_of: Callable[[Scene], Float1D]) -> Drawn:
        """The same with state vectors as a world's dreams have them."""
        if isinstance(self._scenes, np.ndarray):
            return self
        return Drawn(np.array([vector_of(scene) for scene in self._scenes]))

    @property
    def vectors(self) -> Float2D:
        """State vectors of all that may be drawn."""
        if self._vectors is None:
            raise ConfigError("the scenes hold different objects, or the same ones in another order")
        return self._vectors

    def __call__(self, rng: np.random.Generator, count: int) -> Float2D:
        """State vectors of so many first scenes."""
        every = self.vectors
        drawn: Float2D = every[rng.integers(len(every), size=count)]
        return drawn


@refusing(ConfigError)
def drawn_from(scenes: Sequence[Scene] | Float2D) -> BatchStart:
    """First scenes for `LearnedModelVectorEnv`, drawn uniformly from scenes with the same objects.

    Parameters
    ----------
    scenes
        Scenes, with their objects in any order; or state vectors without an action, as the dreams have them: shape
        ``(m, layout.width)``, the columns of ``vectors``.

    Raises
    ------
    ConfigError
        Something else, or none. Scenes with other objects are refused by the env: `ObservationError`.
    """
    return Drawn(scenes)
