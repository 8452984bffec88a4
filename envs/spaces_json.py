"""Gymnasium spaces as plain JSON data, for model files."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from relgym.errors import ConfigError, ModelFileError

__all__ = ["space_from_json", "space_to_json"]


def space_to_json(space: spaces.Space[Any]) -> dict[str, Any]:
    """Plain data that `space_from_json` reads back; `ConfigError` for spaces other than Box, Discrete and Dict."""
    if isinstance(space, spaces.Dict):
        return {
            "kind": "dict",
            "spaces": [[name, space_to_json(part)] for name, part in space.spaces.items()],
        }
    if isinstance(space, spaces.Discrete):
        return {"kind": "discrete", "n": int(space.n), "start": int(space.start)}
    if isinstance(space, spaces.Box):
        return {
            "kind": "box",
            "low": space.low.astype(np.float64).tolist(),
            "high": space.high.astype(np.float64).tolist(),
            "dtype": str(space.dtype),
        }
    raise ConfigError(f"a model file can hold Box, Discrete and Dict spaces, got {space}")


def space_from_json(data: dict[str, Any]) -> spaces.Space[Any]:
    """Read what `space_to_json` wrote."""
    if data["kind"] == "dict":
        return spaces.Dict({name: space_from_json(part) for name, part in data["spaces"]})
    if data["kind"] == "discrete":
        return spaces.Discrete(int(data["n"]), start=int(data["start"]))
    if data["kind"] == "box":
        dtype = np.dtype(data["dtype"])
        return spaces.Box(
            np.array(data["low"], dtype=dtype), np.array(data["high"], dtype=dtype), dtype=dtype.type
        )
    raise ModelFileError(
        f"unknown kind of space {data['kind']!r}; load the model with the relgym that wrote it"
    )
