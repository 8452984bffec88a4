"""The published format is the declared one, and spaces and views that don't fit it are refused by name."""

from __future__ import annotations

import copy
import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from file_mutations import Mutator
from gymnasium import spaces

from relgym.envs.file_format import json_schema
from relgym.envs.spaces_json import space_from_json, space_to_json
from relgym.envs.views import NumbersView, Part, Rows, Static, TableView, TaskView, view_from_json
from relgym.errors import ModelFileError, RelgymError
from relgym.scene.shapes import Box, Prism, Sphere

PUBLISHED = Path(__file__).parents[2] / "docs" / "reference" / "model-file.schema.json"

SPACES = {
    "box": spaces.Box(np.float32([-1.0, -np.inf]), np.float32([1.0, np.inf]), dtype=np.float32),
    "picture": spaces.Box(0, 255, (2, 3, 1), dtype=np.uint8),
    "long": spaces.Box(np.iinfo(np.int64).min, np.iinfo(np.int64).max, (2,), dtype=np.int64),
    "discrete": spaces.Discrete(5, start=-2),
    "multi-discrete": spaces.MultiDiscrete([[2, 3], [4, 5]], start=[[0, 1], [-1, 0]]),
    "multi-binary": spaces.MultiBinary([2, 3]),
    "bits": spaces.MultiBinary(4),
    "text": spaces.Text(5, min_length=1, charset="abc"),
    "sequence": spaces.Sequence(spaces.Discrete(3), stack=True),
    "one-of": spaces.OneOf([spaces.Discrete(2), spaces.MultiBinary(2)]),
    "graph": spaces.Graph(spaces.Box(0, 1, (2,)), spaces.Discrete(3)),
    "dict": spaces.Dict({"b": spaces.Discrete(2), "a": spaces.Tuple([spaces.MultiBinary(1)])}),
}


def views() -> dict[str, Any]:
    box, push = spaces.Box(-9, 9, (5,), np.float64), spaces.Discrete(3)
    body = Part(
        "ball", ("px", "vx"), shape=Sphere(), velocity=("vx", None, None), constants={"sx": 1.0}, angles=()
    )
    wall = Static("wall", {"px": 5.0, "sx": 1.0}, shape=Prism(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))))
    numbers = NumbersView(
        box, push, names=("px", "vx", "c", "s", "q"), parts=[body], angles=[("c", "s")],
        actions=("left", "stay", "right"), static=[wall],
    )  # fmt: skip
    table = TableView(
        spaces.Box(-9, 9, (3, 4), np.float32), push, columns=("here", "px", "vx", "sx"), presence="here",
        rows=[Rows("car", 2, shape=Box()), Rows("me", 1)], match={"px": 1.0}, changes=("vx",), offsets=True,
    )  # fmt: skip
    return {"flat": numbers, "table": table, "task": TaskView(numbers), "told": TaskView(table, reward=False)}


def test_the_published_schema_is_the_declared_one() -> None:
    declared = json.dumps(json_schema(), indent=1, sort_keys=True, ensure_ascii=False) + "\n"
    assert PUBLISHED.read_text(encoding="utf-8") == declared, (
        "run: python -m relgym.envs.file_format > docs/reference/model-file.schema.json"
    )


@pytest.mark.parametrize("name", SPACES)
def test_spaces_come_back(name: str) -> None:
    again = space_from_json(json.loads(json.dumps(space_to_json(SPACES[name]))))
    assert again == SPACES[name]
    assert again.dtype == SPACES[name].dtype


@pytest.mark.parametrize("name", ["flat", "table", "task", "told"])
def test_views_come_back(name: str) -> None:
    view = views()[name]
    again = view_from_json(json.loads(json.dumps(view.to_json())))
    assert again.schema == view.schema
    assert again.to_json() == view.to_json()


@pytest.mark.parametrize(
    ("data", "match"),
    [
        ({"kind": "oracle"}, "Invalid value 'oracle'"),
        ({"kind": "discrete", "n": 0, "start": 0}, "Expected `int` >= 1"),
        ({"kind": "discrete", "n": 2**63 - 1, "start": 5}, "64 bits"),
        ({"kind": "box", "low": [0], "high": [1, 2], "dtype": "float32"}, "one shape"),
        ({"kind": "box", "low": [2], "high": [1], "dtype": "float32"}, "low at most high"),
        ({"kind": "box", "low": [float("nan")], "high": [1], "dtype": "float32"}, "one shape"),
        ({"kind": "box", "low": [[1], [1, 2]], "high": [1], "dtype": "float32"}, "a space isn't"),
        ({"kind": "box", "low": ["0"], "high": [1], "dtype": "float32"}, "expected numbers"),
        ({"kind": "box", "low": [-1], "high": [1], "dtype": "uint8"}, "bounds that uint8 can hold"),
        ({"kind": "box", "low": [0], "high": [1], "dtype": "object"}, "Invalid enum value 'object'"),
        ({"kind": "multi-discrete", "nvec": [0], "start": [0]}, "at least 1"),
        ({"kind": "multi-discrete", "nvec": [2, 2], "start": [0]}, "as many starts"),
        ({"kind": "multi-binary", "n": [10**6, 10**6]}, "at most 10,000,000"),
        ({"kind": "dict", "spaces": [["a", {"kind": "multi-binary", "n": 1}]] * 2}, "keys must differ"),
    ],
)
def test_spaces_that_do_not_fit_are_refused(data: dict[str, Any], match: str) -> None:
    with pytest.raises(ModelFileError, match=match):
        space_from_json(data)


@pytest.mark.parametrize("name", ["flat", "table", "task"])
def test_changed_views_are_refused_or_work(name: str) -> None:
    view = views()[name]
    rng = random.Random(name)
    mutator, kept = Mutator(view.to_json(), None, rng), copy.deepcopy(view.to_json())
    accepted = 0
    for _ in range(300):
        data, _ = mutator.draw()
        try:
            again = view_from_json(data)
        except RelgymError:
            continue
        accepted += 1
        again.to_json()
        rows = again.to_json().get("view", again.to_json())["observation"]
        seen = space_from_json(rows).sample()
        try:
            scene = again.scene(seen)
            again.observation(again.with_action(scene, space_from_json(kept_action(again)).sample()))
        except RelgymError:
            continue
    assert 10 < accepted < 290
    assert view.to_json() == kept


def kept_action(view: Any) -> dict[str, Any]:
    """The action space in a view's data."""
    data = view.to_json()
    found: dict[str, Any] = data.get("view", data)["action"]
    return found
