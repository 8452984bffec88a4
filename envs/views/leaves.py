"""Observations of any flat space as one vector of float64 numbers, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.envs.views.base import as_shown, cast_to
from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import Float1D, Float2D

__all__ = ["Leaf", "Numbers", "parts_of"]

Key: TypeAlias = str | int | None
"""Where a part of an observation lies: its key in a Dict, its place in a Tuple, ``None``: the whole."""


@dataclass(frozen=True)
class Leaf:
    """A part of an observation that is a vector of numbers."""

    key: Key
    space: spaces.Space[Any]

    @cached_property
    def size(self) -> int:
        """How many numbers it has."""
        return 1 if isinstance(self.space, spaces.Discrete) else int(np.prod(self.space.shape or ()))

    @cached_property
    def bounds(self) -> tuple[Float1D, Float1D]:
        """Smallest and largest number in each place, shape ``(size,)`` each."""
        space = self.space
        if isinstance(space, spaces.Box):
            return space.low.astype(np.float64).ravel(), space.high.astype(np.float64).ravel()
        start = np.asarray(getattr(space, "start", 0), dtype=np.float64).ravel()
        count = np.asarray(
            getattr(space, "nvec", 2 if isinstance(space, spaces.MultiBinary) else getattr(space, "n", 2))
        )
        low = np.broadcast_to(start, (self.size,))
        return low, low + count.astype(np.float64).ravel() - 1.0

    @property
    def single(self) -> bool:
        """Whether its numbers were rounded to float32 or coarser."""
        return isinstance(self.space, spaces.Box) and self.space.dtype in (np.float16, np.float32)

    def read(self, part: Any) -> Float1D:
        """The numbers of this part, shape ``(size,)``; `ObservationError` where it has others."""
        try:
            array = np.asarray(part, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise ObservationError(f"{self._place()}expected numbers, got {part!r}") from None
        if array.size != self.size or (array.ndim > 0 and array.shape != (self.space.shape or ())):
            raise ObservationError(
                f"{self._place()}expected {self.size} numbers as {self.space} says, got an array of shape "
                f"{array.shape}; fix the env's observation_space, or give a view of your own"
            )
        return array.ravel()

    def write(self, numbers: Float1D) -> Any:
        """The inverse of `read`: whole numbers where the space has them; `ObservationError` where they don't fit."""
        shown = as_shown(numbers, self.space.dtype)
        return shown[0] if isinstance(self.space, spaces.Discrete) else shown.reshape(self.space.shape or ())

    def write_all(self, numbers: Float2D) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """`write` of n observations, and which of them lie in the space."""
        low, high = self.bounds
        shown, fits = cast_to(numbers, self.space.dtype)
        inside = np.asarray((fits & (low <= shown) & (shown <= high)).all(axis=1))
        return shown.reshape(len(shown), *(self.space.shape or ())), inside

    def _place(self) -> str:
        return "" if self.key is None else f"observation[{self.key!r}]: "


class Numbers:
    """The numbers of a space's elements, one after the other.

    Parameters
    ----------
    space
        A flat Box, Discrete, MultiDiscrete or MultiBinary, or a Dict or Tuple of those.

    Raises
    ------
    ConfigError
        An image, a table, or a nested space; the message says which view to use instead.
    """

    def __init__(self, space: spaces.Space[Any]) -> None:
        self.space = space
        self.leaves = tuple(Leaf(key, _flat(part, key)) for key, part in parts_of(space))
        if not self.leaves:
            raise ConfigError(
                f"the observation space {space} has no parts: expected some numbers to learn of"
            )
        ends = np.cumsum([0, *(leaf.size for leaf in self.leaves)]).tolist()
        self.slices = tuple(slice(a, b) for a, b in pairwise(ends))
        self.width = int(ends[-1])

    @cached_property
    def bounds(self) -> tuple[Float1D, Float1D]:
        """Smallest and largest number in each place, shape ``(width,)`` each."""
        low, high = zip(*(leaf.bounds for leaf in self.leaves), strict=True)
        return np.concatenate(low), np.concatenate(high)

    @cached_property
    def single(self) -> tuple[bool, ...]:
        """Per number, whether it was rounded to float32 or coarser."""
        return tuple(leaf.single for leaf in self.leaves for _ in range(leaf.size))

    def read(self, observation: Any) -> Float1D:
        """The numbers of an observation, shape ``(width,)``; a new array.

        Raises
        ------
        ObservationError
            A missing or unknown key, or a wrong length.
        """
        if isinstance(self.space, spaces.Dict):
            self._check_keys(observation)
        elif isinstance(self.space, spaces.Tuple):
            self._check_length(observation)
        else:
            return np.array(self.leaves[0].read(observation))
        return np.concatenate([leaf.read(observation[leaf.key]) for leaf in self.leaves])

    def write(self, numbers: Float1D) -> Any:
        """The observation with these numbers, shape ``(width,)``: the inverse of `read`."""
        parts = [leaf.write(numbers[cut]) for leaf, cut in zip(self.leaves, self.slices, strict=True)]
        if isinstance(self.space, spaces.Dict):
            return {leaf.key: part for leaf, part in zip(self.leaves, parts, strict=True)}
        return tuple(parts) if isinstance(self.space, spaces.Tuple) else parts[0]

    def write_all(self, numbers: Float2D) -> tuple[Any, NDArray[np.bool_]]:
        """`write` of n observations, batched as Gymnasium batches them, and which of them lie in the space."""
        parts = [leaf.write_all(numbers[:, cut]) for leaf, cut in zip(self.leaves, self.slices, strict=True)]
        inside = np.logical_and.reduce([fine for _, fine in parts])
        shown = [part for part, _ in parts]
        if isinstance(self.space, spaces.Dict):
            return {leaf.key: part for leaf, part in zip(self.leaves, shown, strict=True)}, inside
        return (tuple(shown) if isinstance(self.space, spaces.Tuple) else shown[0]), inside

    def _check_keys(self, observation: Any) -> None:
        keys = {leaf.key for leaf in self.leaves}
        if not isinstance(observation, Mapping) or set(observation) != keys:
            came = sorted(map(str, observation)) if isinstance(observation, Mapping) else type(observation)
            raise ObservationError(
                f"expected an observation with the keys {sorted(map(str, keys))}, got {came}; objects that come "
                "and go need a FunctionView, or a TableView with a presence column"
            )

    def _check_length(self, observation: Any) -> None:
        if not isinstance(observation, Sequence) or len(observation) != len(self.leaves):
            raise ObservationError(f"expected a tuple of {len(self.leaves)} parts, got {observation!r}")


def parts_of(space: spaces.Space[Any]) -> list[tuple[Key, spaces.Space[Any]]]:
    """The parts of a Dict by key, those of a Tuple by place; of another space the whole."""
    if isinstance(space, spaces.Dict):
        return list(space.spaces.items())
    if isinstance(space, spaces.Tuple):
        return list(enumerate(space.spaces))
    return [(None, space)]


def _flat(space: spaces.Space[Any], key: Key) -> spaces.Space[Any]:
    """The space itself; `ConfigError` unless its elements are vectors of numbers."""
    where = "the observation space" if key is None else f"part {key!r} of the observation space"
    own = "FunctionView(objects, function, env.action_space) takes any function you write"
    if isinstance(space, (spaces.Dict, spaces.Tuple)):
        raise ConfigError(
            f"{where} is nested ({space}): expected one level of flat spaces; flatten it "
            f"(gymnasium.wrappers.FlattenObservation), or pass view=: {own}"
        )
    if isinstance(space, spaces.Box) and len(space.shape) >= 2:
        raise ConfigError(_shaped(space, where, own, key))
    if isinstance(space, (spaces.Box, spaces.Discrete, spaces.MultiDiscrete, spaces.MultiBinary)):
        return space
    raise ConfigError(
        f"{where} is {space}: expected Box, Discrete, MultiDiscrete, MultiBinary, or one level of Dict or Tuple of "
        f"those; pass view=: {own}"
    )


def _shaped(space: spaces.Box, where: str, own: str, key: Key) -> str:
    if len(space.shape) >= 3 or space.dtype == np.uint8:
        return (
            f"{where} is an image ({space.shape}, {space.dtype}): relgym learns of objects and their properties, "
            f"not of pixels; use the env's state if it offers one, or detect objects and pass view=: {own}"
        )
    table = f"{where} is a table of shape {space.shape}: nothing says what its rows and columns are; "
    if key is None:
        return f"{table}pass view=TableView(env.observation_space, env.action_space, columns=(...)), or flatten it"
    return (
        f"{table}show it alone (gymnasium.wrappers.TransformObservation(env, lambda seen: seen[{key!r}], "
        f"env.observation_space[{key!r}])) and pass view=TableView(env.observation_space, env.action_space, "
        f"columns=(...)); or flatten all (gymnasium.wrappers.FlattenObservation); or pass view=: {own}"
    )
