"""Gymnasium spaces as plain JSON data, for model files."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
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


def _of_parts(space: spaces.Space[Any]) -> dict[str, Any]:
    if isinstance(space, spaces.Dict):
        keys: list[Any] = list(space.spaces)  # of any kind, whatever Gymnasium's types say
        if wrong := [key for key in keys if not isinstance(key, str)]:
            raise ConfigError(
                f"a model file can hold Dict spaces whose keys are strings, got {wrong}; call the parts otherwise "
                "inside the learner (gymnasium.wrappers.TransformObservation, TransformAction)"
            )
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
    return _READERS[data["kind"]](data)


def _dict(data: Mapping[str, Any]) -> spaces.Space[Any]:
    names = [name for name, _ in data["spaces"]]
    if len(set(names)) < len(names):
        raise ValueError(f"keys must differ, got {names}")
    parts = {name: _read(part) for name, part in data["spaces"]}
    # Pairs keep their order, which flat vectors follow; Gymnasium sorts the keys of a dict.
    return AgentsSpace(parts) if data["kind"] == "agents" else spaces.Dict(list(parts.items()))


def _tuple(data: Mapping[str, Any]) -> spaces.Space[Any]:
    return spaces.Tuple([_read(part) for part in data["spaces"]])


def _one_of(data: Mapping[str, Any]) -> spaces.Space[Any]:
    return spaces.OneOf([_read(part) for part in data["spaces"]])


def _sequence(data: Mapping[str, Any]) -> spaces.Space[Any]:
    return spaces.Sequence(_read(data["space"]), stack=data["stack"])


def _graph(data: Mapping[str, Any]) -> spaces.Space[Any]:
    nodes: Any = _read(data["nodes"])
    return spaces.Graph(nodes, None if data["edges"] is None else _read(data["edges"]))


def _text(data: Mapping[str, Any]) -> spaces.Space[Any]:
    return spaces.Text(data["max_length"], min_length=data["min_length"], charset=data["charset"])


def _discrete(data: Mapping[str, Any]) -> spaces.Space[Any]:
    if data["start"] + data["n"] > 2**63:
        raise ValueError("choices must be numbers of 64 bits")
    return spaces.Discrete(data["n"], start=data["start"])


def _multi_binary(data: Mapping[str, Any]) -> spaces.Space[Any]:
    if math.prod(np.atleast_1d(np.array(data["n"], dtype=object))) > _LARGEST:
        raise ValueError(f"expected at most {_LARGEST:,} numbers")
    return spaces.MultiBinary(data["n"])


def _multi_discrete(data: Mapping[str, Any]) -> spaces.Space[Any]:
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

_READERS: dict[str, Callable[[Mapping[str, Any]], spaces.Space[Any]]] = {
    "agents": _dict,
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
