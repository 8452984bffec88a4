"""Checks of arguments, reset options and actions that the envs share."""

from __future__ import annotations

import inspect
import math
import reprlib
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from typing import Any, TypeAlias, cast

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from relgym.arguments import finite
from relgym.config.checks import checked_count
from relgym.envs.agents import AgentsSpace
from relgym.errors import ActionError, ConfigError
from relgym.scene.objects import Float1D
from relgym.scene.schema import SceneSchema

__all__ = [
    "Coefficient",
    "action_numbers",
    "action_parts",
    "check_options",
    "checked_action",
    "checked_actions",
    "checked_count",
    "checked_function",
    "checked_least",
    "checked_mask",
    "checked_options",
    "checked_range",
    "counted",
    "numbered",
    "per_object",
    "physical_action",
    "refuse_vector_env",
    "stepped",
    "takes",
]

Coefficient: TypeAlias = float | Mapping[str, float]
"""One number for all objects, or numbers by object name or kind."""


def checked_least(what: str, value: Any, least: float) -> float:
    """`value` as a float; `ConfigError` unless it is a finite number of at least `least`."""
    if not _is_number(value) or not least <= value < np.inf:
        raise ConfigError(f"{what}={value!r}: expected a finite number of at least {least:g}")
    return float(value)


def checked_range(what: str, span: tuple[float, float]) -> tuple[float, float]:
    """`span` as two floats; `ConfigError` unless they are finite with 0 <= low <= high."""
    low, high = (float(x) for x in span) if len(tuple(span)) == 2 else (math.nan, math.nan)
    if not 0.0 <= low <= high < math.inf:
        raise ConfigError(f"{what}={span!r}: expected two finite numbers with 0 <= low <= high")
    return low, high


def numbered(kind: str, count: int) -> tuple[str, ...]:
    """Names of `count` objects of a kind: ``ball``, ``ball2``, ``ball3``."""
    return tuple(kind if k == 1 else f"{kind}{k}" for k in range(1, count + 1))


def counted(objects: Sequence[str] | Mapping[str, int], kinds: Sequence[str]) -> dict[str, str]:
    """Name and kind of each object in a list of kinds, or in a mapping from kind to count."""
    if isinstance(objects, str):
        raise ConfigError(
            f"objects={objects!r}: expected a sequence such as ({objects!r},) or counts by kind"
        )
    given = list(objects)
    unknown = sorted({str(kind) for kind in given if kind not in kinds})
    if unknown:
        raise ConfigError(f"objects: unknown kinds {unknown}; expected {tuple(kinds)}")
    counts = objects if isinstance(objects, Mapping) else {kind: given.count(kind) for kind in given}
    checked = {kind: checked_count(f"objects[{kind!r}]", count, 0, 100) for kind, count in counts.items()}
    return {name: kind for kind, count in checked.items() for name in numbered(kind, count)}


def per_object(
    what: str, value: Coefficient, kinds: Mapping[str, str], default: float, span: tuple[float, float]
) -> dict[str, float]:
    """The value for each object of `kinds` (name to kind): its own entry, else its kind's, else the default.

    Raises
    ------
    ConfigError
        An unknown name or kind, or a number outside `span`.
    """
    given: Mapping[str, float] = value if isinstance(value, Mapping) else dict.fromkeys(kinds, value)
    legal = {*kinds, *kinds.values()}
    unknown = sorted(set(given) - legal)
    if unknown:
        raise ConfigError(f"{what}: unknown objects {unknown}; expected names or kinds among {sorted(legal)}")
    for key, number in given.items():
        if not _is_number(number) or not span[0] <= number <= span[1]:
            raise ConfigError(
                f"{what}={number!r} (for {key!r}): expected a number from {span[0]:g} to {span[1]:g}"
            )
    return {name: float(given.get(name, given.get(kind, default))) for name, kind in kinds.items()}


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def checked_options(options: Any) -> Mapping[str, Any]:
    """The options of a `reset`, none for None; `ConfigError` unless they are a mapping."""
    if options is not None and not isinstance(options, Mapping):
        raise ConfigError(f"options={options!r}: expected a dict such as {{'scene': scene}}")
    return {} if options is None else options


def checked_function(what: str, given: Any, *arguments: str) -> Any:
    """`given`; `ConfigError` unless it is None, or a function of these arguments."""
    if given is not None and not callable(given):
        raise ConfigError(f"{what}={given!r}: expected a function, or None")
    if given is not None and not takes(given, len(arguments)):
        raise ConfigError(f"{what}={given!r}: expected a function of ({', '.join(arguments)})")
    return given


def takes(function: Any, count: int) -> bool:
    """Whether a function may be called with so many arguments; of something written in C nobody knows, so it may."""
    with suppress(ValueError):  # no signature
        try:
            inspect.signature(function).bind(*range(count))
        except TypeError:
            return False
    return True


def check_options(options: Mapping[str, Any], legal: Collection[str]) -> None:
    """Raise `ConfigError` when an option of `reset` isn't one of `legal`."""
    unknown = sorted(set(map(str, options)) - set(legal))
    if unknown:
        raise ConfigError(f"unknown reset options {unknown}; this env has {sorted(legal)}")


def checked_action(space: spaces.Space[Any], action: Any) -> Any:
    """`action` as an element of `space`, or `ActionError`.

    A Box takes any float dtype and values up to 1e-6 (relative) outside, which are clipped: `Box.contains`
    refuses float64 in a float32 Box, and rounding to float32 may overstep the bounds.

    Returns
    -------
    For a Box a float64 array of its shape, for a Dict or a Tuple one of parts that were checked so, otherwise `action`
    itself.
    """
    if isinstance(space, (spaces.Dict, spaces.Tuple)):
        parts = {key: checked_action(part, given) for key, part, given in action_parts(space, action)}
        return tuple(parts.values()) if isinstance(space, spaces.Tuple) else parts
    if not isinstance(space, spaces.Box):
        if not _chosen(space, action) and not space.contains(action):
            raise ActionError(f"action {action!r} lies outside {space}")
        return action
    try:
        array = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ActionError(f"expected numbers of shape {space.shape}, got {action!r}") from None
    if array.shape == space.shape and ((space.low <= array) & (array <= space.high)).all():
        return array.copy()  # most are, and clipping takes longer
    slack = 1e-6 * np.maximum(1.0, np.abs(space.high))
    if array.shape != space.shape or not np.all((array >= space.low - slack) & (array <= space.high + slack)):
        raise ActionError(
            f"expected an action of shape {space.shape} within [{space.low}, {space.high}], got {action!r}; "
            "clip or rescale it"
        )
    return np.clip(array, space.low, space.high)


def action_parts(
    space: spaces.Dict | spaces.Tuple[Any], action: Any
) -> list[tuple[str | int, spaces.Space[Any], Any]]:
    """Key, space and value of each part of an action, in the space's order; agents that don't act have none.

    Raises
    ------
    ActionError
        The action has other parts than the space.
    """
    if isinstance(space, spaces.Tuple):
        listed = isinstance(action, (tuple, list)) or (isinstance(action, np.ndarray) and action.ndim > 0)
        if not listed or len(action) != len(space.spaces):
            raise ActionError(
                f"expected a tuple of {len(space.spaces)} parts, one of each of {space}, got {action!r}"
            )
        return [(k, part, given) for k, (part, given) in enumerate(zip(space.spaces, action, strict=True))]
    keys = list(space.spaces)
    known = isinstance(action, Mapping) and set(action) <= set(keys)
    if not known or (len(action) < len(keys) and not isinstance(space, AgentsSpace)):
        raise ActionError(f"expected a dict with the keys {keys}, got {action!r}")
    return [(key, space.spaces[key], action[key]) for key in keys if key in action]


def _chosen(space: spaces.Space[Any], action: Any) -> bool:
    """Whether an action is a whole number that a space of choices has; faster than to ask the space."""
    if type(space) is not spaces.Discrete or not isinstance(action, (int, np.int64)):
        return False
    return bool(0 <= action - space.start < space.n)


def refuse_vector_env(env: Any) -> None:
    """Raise `ConfigError` where a wrapper of single envs is put round a vector env."""
    if isinstance(env, gym.vector.VectorEnv):
        raise ConfigError(
            "expected a single env, got a vector env: let make_vec wrap each of its envs, "
            "gym.make_vec(id, num_envs=n, vectorization_mode='sync', wrappers=[...])"
        )


def stepped(
    env: gym.vector.VectorEnv[Any, Any, Any], actions: Any
) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
    """A step of a vector env; `ActionError` where it fails for actions that are none of its space."""
    try:
        return env.step(actions)
    except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:
        with suppress(TypeError, ValueError, AttributeError):
            if env.action_space.contains(actions):
                raise
        raise ActionError(f"expected actions of {env.action_space}, got {reprlib.repr(actions)}") from error


def checked_actions(space: spaces.Space[Any], actions: Any, count: int) -> Any:
    """`checked_action` for `count` actions at once, first axis first; they come back as one array."""
    if isinstance(space, spaces.MultiBinary):  # Gymnasium's batch of them is a Box of int8: no other integers
        array = np.asarray(actions)
        if array.shape != (count, *space.shape) or not np.isin(array, (0, 1)).all():
            raise ActionError(f"expected {count} actions of {space}, got {actions!r}")
        return array.astype(space.dtype)
    if not isinstance(space, spaces.Box):
        array = np.asarray(actions)
        if not _batched(space, count).contains(array):
            raise ActionError(f"expected {count} actions of {space}, got {actions!r}")
        return array
    try:
        array = np.array(actions, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ActionError(f"expected numbers of shape {(count, *space.shape)}, got {actions!r}") from None
    if array.shape != (count, *space.shape):
        raise ActionError(f"expected actions of shape {(count, *space.shape)}, got shape {array.shape}")
    low, high = _limits(space)
    if ((array >= low) & (array <= high)).all():
        return array  # most are, and clipping takes longer
    slack = 1e-6 * np.maximum(1.0, np.abs(high))
    legal_ones = (array >= low - slack) & (array <= high + slack)
    if not legal_ones.all():
        row = int(np.argwhere(~legal_ones)[0][0])
        raise ActionError(
            f"action {row} of {count} lies outside [{space.low}, {space.high}]: {array[row]}; clip or rescale it"
        )
    return np.clip(array, low, high)


def _limits(space: spaces.Box) -> tuple[Any, Any]:
    """Smallest and largest action; numbers where all are the same: those are compared in a fraction of the time."""
    known = _LIMITS.get(id(space))
    if known is None or known[0] is not space:
        if len(_LIMITS) >= _KEPT:
            _LIMITS.clear()
        low, high = cast(Any, (space.low, space.high))
        if low.size and (low == low.flat[0]).all() and (high == high.flat[0]).all():
            low, high = low.flat[0], high.flat[0]
        known = _LIMITS[id(space)] = space, low, high
    return known[1:]


def _batched(space: spaces.Space[Any], count: int) -> spaces.Space[Any]:
    """`batch_space`, which copies the space and its generator of random numbers; the last few are kept."""
    known = _BATCHED.get(id(space))
    if known is None or known[0] is not space or known[1] != count:
        if len(_BATCHED) >= _KEPT:
            _BATCHED.clear()
        known = _BATCHED[id(space)] = space, count, batch_space(space, count)
    return known[2]


_KEPT = 64
_LIMITS: dict[int, tuple[spaces.Box, Any, Any]] = {}
_BATCHED: dict[int, tuple[spaces.Space[Any], int, spaces.Space[Any]]] = {}


def checked_mask(mask: Any, count: int) -> NDArray[np.bool_]:
    """Which of `count` envs to reset, all if `mask` is None; `ConfigError` unless it is a mask that marks some."""
    if mask is None:
        return np.ones(count, dtype=np.bool_)
    if not isinstance(mask, np.ndarray) or mask.shape != (count,) or mask.dtype != np.bool_ or not mask.any():
        raise ConfigError(
            f"options['reset_mask']: expected an array of booleans of shape {(count,)} that marks at least one env, "
            f"got {mask!r}"
        )
    return mask


def action_numbers(action: Any, count: int | None = None) -> Float1D:
    """An action's numbers, shape ``(count,)``; `ActionError` where they are none, not finite, or not as many."""
    try:
        array = np.asarray(action, dtype=np.float64).ravel()
    except (TypeError, ValueError, OverflowError):
        raise ActionError(f"expected the numbers of an action, got {reprlib.repr(action)}") from None
    if (count is not None and len(array) != count) or not finite(array):
        said = "" if count is None else f"{count} "
        raise ActionError(f"expected an action of {said}finite numbers, got {reprlib.repr(action)}")
    return array


def physical_action(schema: SceneSchema, action: Any) -> Float1D:
    """Properties of the action object for an action in [-1, 1]: what the schema's affine maps make of it."""
    array = action_numbers(action, len(schema.action_scale))
    return np.array(
        [
            low + (u + 1.0) / 2.0 * (high - low)
            for u, (_, low, high) in zip(array, schema.action_scale, strict=True)
        ]
    )
