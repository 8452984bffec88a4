"""Gymnasium spaces as plain JSON data, for model files."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium import spaces

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


def space_from_json(data: dict[str, Any]) -> spaces.Space[Any]:
    """Read what `space_to_json` wrote."""
    kind = data["kind"]
    if kind not in _READERS:
        raise ModelFileError(f"unknown kind of space {kind!r}; load the model with the relgym that wrote it")
    return _READERS[kind](data)


def _dict(data: dict[str, Any]) -> spaces.Space[Any]:
    return spaces.Dict({name: space_from_json(part) for name, part in data["spaces"]})


def _tuple(data: dict[str, Any]) -> spaces.Space[Any]:
    return spaces.Tuple([space_from_json(part) for part in data["spaces"]])


def _discrete(data: dict[str, Any]) -> spaces.Space[Any]:
    return spaces.Discrete(int(data["n"]), start=int(data["start"]))


def _multi_discrete(data: dict[str, Any]) -> spaces.Space[Any]:
    return spaces.MultiDiscrete(np.array(data["nvec"]), start=np.array(data["start"]))


def _multi_binary(data: dict[str, Any]) -> spaces.Space[Any]:
    return spaces.MultiBinary(data["n"])


def _box(data: dict[str, Any]) -> spaces.Space[Any]:
    dtype = np.dtype(data["dtype"])
    low, high = (np.array(data[end], dtype=dtype) for end in ("low", "high"))
    return spaces.Box(low, high, dtype=dtype.type)


_READERS: dict[str, Callable[[dict[str, Any]], spaces.Space[Any]]] = {
    "box": _box,
    "dict": _dict,
    "discrete": _discrete,
    "multi-binary": _multi_binary,
    "multi-discrete": _multi_discrete,
    "tuple": _tuple,
}
