"""Spaces as plain data: read back they are equal, and what is no space is refused."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st

from relgym.envs.spaces_json import space_from_json, space_to_json
from relgym.errors import ConfigError, ModelFileError

NUMBERS = st.sampled_from((-np.inf, -3.5, -1.0, 0.0, 0.25, 2.0, np.inf))


@st.composite
def boxes(draw: st.DrawFn) -> spaces.Box:
    shape = draw(st.sampled_from(((), (1,), (2, 2))))
    dtype = draw(st.sampled_from((np.float32, np.float64, np.int16, np.uint8)))
    ends = [np.array([draw(NUMBERS) for _ in range(int(np.prod(shape)))]).reshape(shape) for _ in range(2)]
    low, high = np.minimum(*ends), np.maximum(*ends)
    if np.dtype(dtype).kind in "iu":
        low, high = np.clip(np.floor(low), 0, 9), np.clip(np.ceil(high), 0, 9)
    return spaces.Box(low.astype(dtype), high.astype(dtype), dtype=dtype)


LEAVES = (
    boxes()
    | st.builds(lambda n, start: spaces.Discrete(n, start=start), st.integers(1, 5), st.integers(-3, 3))
    | st.builds(lambda n: spaces.MultiBinary(n), st.sampled_from((1, 3, (2, 2))))
    | st.builds(
        lambda n, s: spaces.MultiDiscrete(n, start=s), st.just([2, 3]), st.sampled_from(([0, 0], [-1, 4]))
    )
    | st.builds(lambda n: spaces.Text(n, charset="abc"), st.integers(1, 4))
)
NESTED = st.recursive(
    LEAVES,
    lambda some: (
        st.dictionaries(st.sampled_from("abcd"), some, min_size=1, max_size=3).map(spaces.Dict)
        | st.lists(some, min_size=1, max_size=3).map(spaces.Tuple)
        | st.lists(some, min_size=1, max_size=2).map(spaces.OneOf)
        | st.builds(lambda part, stack: spaces.Sequence(part, stack=stack), some, st.booleans())
    ),
    max_leaves=5,
)


@settings(max_examples=60, deadline=None)
@given(NESTED)
def test_what_is_read_back_is_the_same_space(space: spaces.Space[Any]) -> None:
    data = json.loads(json.dumps(space_to_json(space)))
    again = space_from_json(data)
    assert again == space and type(again) is type(space)
    assert space_to_json(again) == space_to_json(space)


def test_order_of_keys_is_kept() -> None:
    space = spaces.Dict([("b", spaces.Discrete(2)), ("a", spaces.Discrete(3))])
    assert list(space_from_json(space_to_json(space))) == list(space.spaces)  # type: ignore[call-overload]


def test_graphs() -> None:
    for edges in (None, spaces.Discrete(2)):
        space = spaces.Graph(spaces.Box(0.0, 1.0, (2,)), edges)
        assert space_from_json(space_to_json(space)) == space


def test_the_greatest_whole_numbers_stay_what_they_are() -> None:
    top = np.iinfo(np.int64).max
    space = spaces.Box(0, top, (1,), np.int64)
    assert space_from_json(space_to_json(space)).high.tolist() == [top]  # type: ignore[attr-defined]


def test_a_space_of_somebodys_own_is_refused() -> None:
    class Odd(spaces.Space[int]):
        pass

    with pytest.raises(
        ConfigError, match=r"a model file can hold the spaces that come with Gymnasium, got .*Odd"
    ):
        space_to_json(Odd())
    with pytest.raises(ConfigError, match="Odd"):
        space_to_json(spaces.Dict({"a": Odd()}))


def box(low: Any, high: Any, dtype: str = "float64") -> dict[str, Any]:
    return {"kind": "box", "low": low, "high": high, "dtype": dtype}


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"kind": "cube"},
        {"kind": "discrete", "n": 0, "start": 0},
        {"kind": "discrete", "n": 2, "start": 2**63 - 1},
        {"kind": "discrete", "n": "2", "start": 0},
        {"kind": "multi-discrete", "nvec": [2, 0], "start": [0, 0]},
        {"kind": "multi-discrete", "nvec": [2], "start": [0, 0]},
        {"kind": "multi-binary", "n": [10_000, 10_000]},
        box([0.0], [1.0, 2.0]),
        box([1.0], [0.0]),
        box([float("nan")], [1.0]),
        box([0.0, [1.0]], [1.0, 1.0]),
        box(["a"], [1.0]),
        box([-1.0], [1.0], "uint8"),
        box([0.0], [256.0], "uint8"),
        box([0.0], [1.0], "complex64"),
        {"kind": "dict", "spaces": [["a", {"kind": "discrete", "n": 2, "start": 0}]] * 2},
        {"kind": "tuple", "spaces": [{"kind": "discrete"}]},
        {"kind": "text", "min_length": 5, "max_length": 2, "charset": "ab"},
    ],
)
def test_what_is_no_space_is_refused(data: dict[str, Any]) -> None:
    with pytest.raises(ModelFileError):
        space_from_json(data)
