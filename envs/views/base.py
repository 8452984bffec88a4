"""What every view offers: an env's observations as scenes, and scenes as observations (design §5)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np

from relgym.scene.objects import Scene, SceneSchema

__all__ = ["View", "precision_of"]


@runtime_checkable
class View(Protocol):
    """What a learner, and a dream, must know of an env: how to see objects in it.

    A view keeps no state: what a scene depends on is passed in. One view serves any number of envs.

    Attributes
    ----------
    schema
        What the scenes are made of; constant.
    """

    schema: SceneSchema

    @property
    def matches(self) -> bool:
        """Whether `scene` heeds what was expected: without it, nobody works that out."""
        ...

    @property
    def precision(self) -> float:
        """Relative precision of the numbers that it shows: 0 for float64, 4 roundings for float32."""
        ...

    def scene(
        self,
        observation: Any,
        info: Mapping[str, Any] | None = None,
        *,
        last: Scene | None = None,
        expected: Scene | None = None,
    ) -> Scene:
        """The scene that an observation shows, without an action.

        Parameters
        ----------
        observation
            What the env returned.
        info
            What came with it.
        last
            The scene one step ago; none at the beginning of an episode. Objects without names go on from it.
        expected
            Where things were expected to be, if anybody knows: rows without names are matched with it.

        Raises
        ------
        ObservationError
            NaN, infinity, a wrong length, a missing or unknown object, or one that changed its type.
        """
        ...

    def with_action(self, scene: Scene, action: Any) -> Scene:
        """The scene together with what the agent does in it, in physical units."""
        ...

    def with_outcome(self, scene: Scene, reward: Any, terminated: bool) -> Scene:
        """The scene together with what the step to it brought, as the env returned it, where that is to be learned."""
        ...

    def observation(self, scene: Scene) -> Any:
        """The observation that shows a scene: the inverse of `scene` (`ConfigError` where there is none)."""
        ...

    def to_json(self) -> dict[str, Any]:
        """Plain data that `relgym.envs.views.view_from_json` reads back."""
        ...


def precision_of(*single: bool) -> float:
    """Relative precision of numbers some of which may be float32: 0 if none is, else four roundings."""
    return 4.0 * float(np.finfo(np.float32).eps) if any(single) else 0.0
