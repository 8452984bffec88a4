"""What every view offers: an env's observations as scenes, and scenes as observations."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ObservationError
from relgym.scene.objects import Scene
from relgym.scene.schema import SceneSchema

__all__ = ["View", "as_shown", "cast_to", "in_batches_too", "is_whole", "limits_of", "precision_of"]


@runtime_checkable
class View(Protocol):
    """What a learner, and a dream, must know of an env: how to see objects in it.

    A view keeps no state: what a scene depends on is passed in. One view serves any number of envs.

    Two more methods are optional, and make many dreams at once faster: ``observations(layout, vectors)``, the
    observations of n scenes, batched as Gymnasium batches them, and which of them lie in the observation space; and
    ``action_values(actions)``, the properties of the action object for n actions, shape ``(n, k)``. Both give the same
    bits as one by one. Where a subclass changes `observation` or `with_action` alone, that is asked.

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
        """The observation that shows a scene: the inverse of `scene` (`ConfigError` where there is none).

        Raises
        ------
        ObservationError
            Its dtype can't hold a number of the scene; views of the user's own may do otherwise.
        """
        ...

    def to_json(self) -> dict[str, Any]:
        """Plain data that `relgym.envs.views.view_from_json` reads back."""
        ...


def in_batches_too(view: Any, many: str, single: str) -> Any:
    """A view's method for many scenes or actions; None where it has none, or a subclass has changed the single one."""
    for kind in type(view).__mro__:
        if many in vars(kind):
            return getattr(view, many)
        if single in vars(kind):
            return None
    return None


def as_shown(numbers: NDArray[np.float64], dtype: Any) -> NDArray[Any]:
    """Numbers in the dtype of a space: to the nearest whole one where it has only those.

    Raises
    ------
    ObservationError
        A number that the dtype can't hold, and that would come out as another one.
    """
    found, fits = cast_to(numbers, dtype)
    if not fits.all():
        raise ObservationError(f"the observation {numbers} left what {np.dtype(dtype).name} can hold")
    return found


def cast_to(numbers: NDArray[np.float64], dtype: Any) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Numbers in another dtype, to the nearest whole one where it has only those, and which of them it can hold.

    Those that it can't (NaN too) come out as 0.
    """
    rounded = np.rint(numbers) if is_whole(dtype) else np.asarray(numbers)
    low, high = limits_of(dtype)
    fits = (low <= rounded) & (rounded <= high)
    return (rounded if fits.all() else np.where(fits, rounded, 0.0)).astype(np.dtype(dtype)), fits


def is_whole(dtype: Any) -> bool:
    """Whether a dtype holds whole numbers only."""
    return np.dtype(dtype).kind in "iub"


@cache
def limits_of(dtype: Any) -> tuple[float, float]:
    """Smallest and largest number of float64 that a dtype can hold; neither is infinite."""
    kind = np.dtype(dtype)
    if kind.kind == "b":
        return 0.0, 1.0
    found: Any = np.iinfo(kind) if kind.kind in "iu" else np.finfo(kind)
    most = float(found.max)
    # The greatest number of int64 is none of float64, and the next one is too great.
    return float(found.min), most if most <= found.max else float(np.nextafter(most, 0.0))


def precision_of(*single: bool) -> float:
    """Relative precision of numbers some of which may be float32: 0 if none is, else four roundings."""
    return 4.0 * float(np.finfo(np.float32).eps) if any(single) else 0.0
