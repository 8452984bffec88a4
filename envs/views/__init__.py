"""Views: how an env's observations and actions become scenes, and scenes observations.

A *view* is how an env's observations, actions, rewards and ends become scenes, and scenes observations: `SceneView`
(an env with a schema), `NumbersView` (any flat space), `TableView` (rows are objects), `FunctionView` (any function),
`AgentsView` (agents are objects, what they do is a property of theirs), and `TaskView` around one of them (reward and
termination as properties of `task`, 0 before a step and the step's after it). They lie in `envs/`, below wrappers and
dreams, because both need them: a model file holds the view's JSON, so that a dream shows what the env would.
"""

from __future__ import annotations

from collections.abc import Mapping
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
        It is no such data, or a view made of functions, which no file can hold.
    ConfigError
        Its parts don't fit its spaces.
    """
    from relgym.envs.file_format import ViewRecord
    from relgym.files.records import checked

    checked(data, ViewRecord, "a view")
    return _read(data)


def _read(data: Mapping[str, Any]) -> View:
    match data["kind"]:
        case "function":
            raise ModelFileError(
                "the scenes were made by a function, and a file can't hold one: pass the FunctionView again"
            )
        case "task":
            return TaskView(_read(data["view"]), reward=data["reward"], terminated=data["terminated"])
        case "agents":
            return AgentsView.from_json(data)
        case "agents":
            return AgentsView.from_json(data)
        case "flat":
            return NumbersView.from_json(data)
        case "table":
            return TableView.from_json(data)
    return SceneView.from_json(data)
