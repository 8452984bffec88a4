"""Views: how an env's observations and actions become scenes, and scenes observations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from relgym.envs.views.agents import AgentsView
from relgym.envs.views.base import View
from relgym.envs.views.function import FunctionView
from relgym.envs.views.numeric import NumbersView
from relgym.envs.views.records import Angle, Part, Rows, Static
from relgym.envs.views.scene import SceneView
from relgym.envs.views.table import TableView
from relgym.envs.views.task import REWARD, TERMINATED, TaskView
from relgym.errors import ModelFileError

__all__ = [
    "REWARD",
    "TERMINATED",
    "AgentsView",
    "Angle",
    "FunctionView",
    "NumbersView",
    "Part",
    "Rows",
    "SceneView",
    "Static",
    "TableView",
    "TaskView",
    "View",
    "view_from_json",
]


def view_from_json(data: Mapping[str, Any]) -> View:
    """Read what a view's `to_json` wrote.

    Raises
    ------
    ModelFileError
        A kind that this relgym doesn't know, or a view made of functions, which no file can hold.
    """
    kind = data.get("kind")
    if kind == "function":
        raise ModelFileError(
            "the scenes were made by a function, and a file can't hold one: pass the FunctionView again"
        )
    if kind == "task":
        view = view_from_json(data["view"])
        return TaskView(view, reward=bool(data["reward"]), terminated=bool(data["terminated"]))
    if kind not in _READERS:
        raise ModelFileError(f"unknown kind of view {kind!r}; load the model with the relgym that wrote it")
    return _READERS[str(kind)](data)


_READERS: dict[str, Callable[[Mapping[str, Any]], View]] = {
    "agents": AgentsView.from_json,
    "flat": NumbersView.from_json,
    "scene": SceneView.from_json,
    "table": TableView.from_json,
}
