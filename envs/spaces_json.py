"""Gymnasium spaces as plain JSON data, for model files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

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


<<<<<<< HEAD
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
=======
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
>>>>>>> main


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


<<<<<<< HEAD
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
=======
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
>>>>>>> main


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


<<<<<<< HEAD
_LARGEST: Final = 10_000_000
"""Most numbers of a space."""
=======
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
>>>>>>> main
