"""Gymnasium spaces as plain JSON data, for model files."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium import spaces

from relgym.envs.agents import AgentsSpace
from relgym.errors import ConfigError, ModelFileError

__all__ = ["space_from_json", "space_to_json"]


def space_to_json(space: spaces.Space[Any]) -> dict[str, Any]:
    """Plain data that `space_from_json` reads back.

    Raises
    ------
    ConfigError
        A space of somebody's own; all of Gymnasium's can be written.
    """
    if isinstance(space, (spaces.Dict, spaces.Tuple, spaces.OneOf, spaces.Sequence, spaces.Graph)):
        return _of_parts(space)
    if isinstance(space, spaces.Text):
        return {
            "kind": "text",
            "min_length": space.min_length,
            "max_length": space.max_length,
            "charset": space.characters,
        }
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
        f"a model file can hold the spaces that come with Gymnasium, got {space} ({type(space).__name__}); show "
        "another one inside the learner (gymnasium.wrappers.TransformObservation, TransformAction)"
    )


def _of_parts(space: spaces.Space[Any]) -> dict[str, Any]:
    if isinstance(space, spaces.Dict):
        return {
            "kind": "agents" if isinstance(space, AgentsSpace) else "dict",
            "spaces": [[name, space_to_json(part)] for name, part in space.spaces.items()],
        }
    if isinstance(space, spaces.Sequence):
        return {"kind": "sequence", "space": space_to_json(space.feature_space), "stack": space.stack}
    if isinstance(space, spaces.Graph):
        edges = None if space.edge_space is None else space_to_json(space.edge_space)
        return {"kind": "graph", "nodes": space_to_json(space.node_space), "edges": edges}
    kind = "tuple" if isinstance(space, spaces.Tuple) else "one-of"
    return {"kind": kind, "spaces": [space_to_json(part) for part in getattr(space, "spaces", ())]}


def space_from_json(data: dict[str, Any]) -> spaces.Space[Any]:
    """Read what `space_to_json` wrote."""
    kind = data["kind"]
    if kind not in _READERS:
        raise ModelFileError(f"unknown kind of space {kind!r}; load the model with the relgym that wrote it")
    return _READERS[kind](data)


def _dict(data: dict[str, Any]) -> spaces.Space[Any]:
    return spaces.Dict({name: space_from_json(part) for name, part in data["spaces"]})


def _agents(data: dict[str, Any]) -> spaces.Space[Any]:
    return AgentsSpace({name: space_from_json(part) for name, part in data["spaces"]})


def _tuple(data: dict[str, Any]) -> spaces.Space[Any]:
    return spaces.Tuple([space_from_json(part) for part in data["spaces"]])


def _one_of(data: dict[str, Any]) -> spaces.Space[Any]:
    return spaces.OneOf([space_from_json(part) for part in data["spaces"]])


def _sequence(data: dict[str, Any]) -> spaces.Space[Any]:
    return spaces.Sequence(space_from_json(data["space"]), stack=bool(data["stack"]))


def _graph(data: dict[str, Any]) -> spaces.Space[Any]:
    edges = None if data["edges"] is None else space_from_json(data["edges"])
    return spaces.Graph(space_from_json(data["nodes"]), edges)


def _text(data: dict[str, Any]) -> spaces.Space[Any]:
    return spaces.Text(
        int(data["max_length"]), min_length=int(data["min_length"]), charset=str(data["charset"])
    )


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
    "agents": _agents,
    "box": _box,
    "dict": _dict,
    "discrete": _discrete,
    "graph": _graph,
    "multi-binary": _multi_binary,
    "multi-discrete": _multi_discrete,
    "one-of": _one_of,
    "sequence": _sequence,
    "text": _text,
    "tuple": _tuple,
}
