"""Actions as points of a Euclidean space, so that one search serves continuous and discrete ones."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.arguments import refusing_calls
from relgym.errors import ConfigError

__all__ = ["ActionCoder"]


@refusing_calls(ConfigError)
class ActionCoder:
    """Translates latent vectors, standard normal a priori, into legal actions.

    Of a `Box` a latent number counts from the middle in units of half the width, and is clipped: about a third of the
    random actions lie on a bound, where the best ones of many tasks are. Of a `Discrete` space, and of every part of a
    `MultiDiscrete` or `MultiBinary` one, the largest of as many latent numbers as there are choices wins: a priori all
    are equally likely, and a search that moves the means makes some likelier.

    Parameters
    ----------
    space
        The action space.

    Attributes
    ----------
    size : int
        Numbers of a latent vector.

    Raises
    ------
    ConfigError
        An unbounded Box, or a space of another kind.
    """

    def __init__(self, space: spaces.Space[Any]) -> None:
        self.space = space
        if isinstance(space, spaces.Box):
            if not (np.isfinite(space.low).all() and np.isfinite(space.high).all()):
                raise ConfigError(
                    f"the action space {space} has no bounds: expected finite ones; put a "
                    "gymnasium.wrappers.RescaleAction or a ClipAction round the env"
                )
            low, high = space.low.astype(np.float64), space.high.astype(np.float64)
            self._middle, self._half = (low + high) / 2.0, (high - low) / 2.0
            self.size = int(np.prod(space.shape))
        else:
            self._choices = _choices(space)
            self.size = int(sum(self._choices))

    def actions(self, latents: NDArray[np.float64]) -> NDArray[Any]:
        """Actions of latent vectors.

        Parameters
        ----------
        latents
            Shape ``(…, size)``.

        Returns
        -------
        Shape ``(…, *action shape)``, in the space's dtype, all legal.
        """
        latents = np.asarray(latents, dtype=np.float64)
        if not latents.ndim or latents.shape[-1] != self.size:
            raise ConfigError(f"latents: expected shape (..., {self.size}), got {latents.shape}")
        lead = latents.shape[:-1]
        space = self.space
        if isinstance(space, spaces.Box):
            shaped = self._middle + self._half * latents.reshape(*lead, *space.shape)
            # Clipped in the space's own dtype: rounding must not lead over a bound.
            cast: NDArray[Any] = np.clip(shaped.astype(space.dtype), space.low, space.high)
            return cast
        parts = np.split(latents, np.cumsum(self._choices)[:-1], axis=-1)
        chosen = np.stack([part.argmax(axis=-1) for part in parts], axis=-1)
        if isinstance(space, spaces.Discrete):
            only: NDArray[Any] = chosen[..., 0] + space.start
            return only
        if isinstance(space, spaces.MultiDiscrete):
            chosen = chosen + space.start.ravel()
        whole: NDArray[Any] = chosen.reshape(*lead, *(space.shape or ())).astype(space.dtype)
        return whole


def _choices(space: spaces.Space[Any]) -> list[int]:
    if isinstance(space, spaces.Discrete):
        return [int(space.n)]
    if isinstance(space, spaces.MultiDiscrete):
        return [int(n) for n in space.nvec.ravel()]
    if isinstance(space, spaces.MultiBinary):
        return [2] * int(np.prod(space.shape))
    raise ConfigError(
        f"can't plan actions of {space}: expected a Box with bounds, a Discrete, MultiDiscrete or MultiBinary space"
    )
