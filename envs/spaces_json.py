"""Gymnasium spaces as plain JSON data, for model files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.errors import ConfigError, ModelFileError

__all__ = ["space_from_json", "space_to_json"]


def space_to_json(space: spaces.Space[Any]) -> dict[str, Any]:
    """Plain data that `space_from_json` reads back.

    Raises
    ------
    ConfigError
        A space other than Box, Discrete, MultiDiscrete, MultiBinary, Dict and Tuple.
    """
    if isinstance(space, spaces.Dict):
        return {
            "kind": "dict",
            "spaces": [[name, space_to_json(part)] for name, part in space.spaces.items()],
        }
    if isinstance(space, spaces.Tuple):
        return {"kind": "tuple", "spaces": [space_to_json(part) for part in space.spaces]}
    if isinstance(space, spaces.MultiDiscrete):
        return {"kind": "multi-discrete", "nvec": space.nvec.tolist(), "start": space.start.tolist()}
    if isinstance(space, spaces.MultiBinary):
        return {"kind": "multi-binary", "n": space.n if isinstance(space.n, int) else list(space.n)}
    if isinstance(space, spaces.Discrete):
        return {"kind": "discrete", "n": int(space.n), "start": int(space.start)}
    if isinstance(space, spaces.Box):
        return {
            "kind": "box",
            "low": space.low.astype(np.float64).tolist(),
            "high": space.high.astype(np.float64).tolist(),
            "dtype": str(space.dtype),
        }
    raise ConfigError(
        f"a model file can hold Box, Discrete, MultiDiscrete, MultiBinary, Dict and Tuple spaces, got {space}"
    )


def space_from_json(data: Mapping[str, Any]) -> spaces.Space[Any]:
    """Read what `space_to_json` wrote.

    Raises
    ------
    ModelFileError
        It is no such data, or bounds, shapes and dtype don't go together.
    """
    from relgym.envs.file_format import SpaceRecord
    from relgym.files.records import checked

    checked(data, SpaceRecord, "a space")
    try:
        return _read(data)
    except (TypeError, ValueError, OverflowError, AssertionError) as error:
        raise ModelFileError(f"a space isn't as the format says ({error}); save the model again") from None


def _read(data: Mapping[str, Any]) -> spaces.Space[Any]:
    """The space that data of the declared format stand for; Gymnasium says what doesn't go together."""
    match data["kind"]:
        case "dict":
            names = [name for name, _ in data["spaces"]]
            if len(set(names)) < len(names):
                raise ValueError(f"keys must differ, got {names}")
            return spaces.Dict({name: _read(part) for name, part in data["spaces"]})
        case "tuple":
            return spaces.Tuple([_read(part) for part in data["spaces"]])
        case "discrete":
            if data["start"] + data["n"] > 2**63:
                raise ValueError("choices must be numbers of 64 bits")
            return spaces.Discrete(data["n"], start=data["start"])
        case "multi-discrete":
            return _multi_discrete(data)
        case "multi-binary":
            if math.prod(np.atleast_1d(np.array(data["n"], dtype=object))) > _LARGEST:
                raise ValueError(f"expected at most {_LARGEST:,} numbers")
            return spaces.MultiBinary(data["n"])
    return _box(data)


def _multi_discrete(data: Mapping[str, Any]) -> spaces.MultiDiscrete:
    counts, start = (_numbers(data[name], int).astype(np.int64) for name in ("nvec", "start"))
    if (counts < 1).any() or counts.shape != start.shape or (start > 2**62).any() or (counts > 2**62).any():
        raise ValueError("expected numbers of choices of at least 1, and as many starts")
    return spaces.MultiDiscrete(counts, start=start)


def _box(data: Mapping[str, Any]) -> spaces.Space[Any]:
    dtype: Any = np.dtype(data["dtype"])
    low, high = (_numbers(data[end], float) for end in ("low", "high"))
    if low.shape != high.shape or np.isnan(low).any() or np.isnan(high).any() or (low > high).any():
        raise ValueError("expected low and high of one shape, low at most high")
    if dtype.kind in "iu":
        limits = np.iinfo(dtype)
        if (low < limits.min).any() or (high > limits.max).any():
            raise ValueError(f"expected bounds that {dtype} can hold")
    with np.errstate(over="ignore"):  # beyond the dtype's numbers there is no bound
        return spaces.Box(_cast(low, dtype), _cast(high, dtype), dtype=dtype.type)


def _cast(bounds: NDArray[np.float64], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Bounds in a dtype; the greatest whole numbers of 64 bits are none of float64, and round to one too many."""
    if dtype.kind not in "iu":
        return bounds.astype(dtype)
    limits = np.iinfo(dtype)
    found = np.array([min(int(b), int(limits.max)) for b in bounds.ravel()], dtype=dtype)
    return found.reshape(bounds.shape)


def _numbers(data: Any, kind: type) -> NDArray[Any]:
    """Nested lists of numbers as an array; `ValueError` where they are none, or lists of several lengths."""
    kinds = (int,) if kind is int else (int, float)
    level: list[Any] = [data]
    while level and isinstance(level[0], list):
        level = [each for part in level if isinstance(part, list) for each in part]
    if not all(type(each) in kinds for each in level):
        raise ValueError("expected numbers in nested lists")
    found = np.array(data, dtype=np.float64 if kind is float else np.int64)
    if found.size > _LARGEST:
        raise ValueError(f"expected at most {_LARGEST:,} numbers")
    return found


_LARGEST: Final = 10_000_000
"""Most numbers of a space."""
