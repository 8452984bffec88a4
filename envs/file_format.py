"""The declared format of what a model file says of its env: spaces, first scenes, and the view of its observations.

It stands under `extra` in the file's body (`relgym.model.files.format`). ``python -m relgym.envs.file_format`` prints
the JSON Schema of whole files, as it stands in `docs/reference/model-file.schema.json`.
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal, TypeAlias

import msgspec
from msgspec import Meta, Struct

from relgym.files.records import Amount, Finite, Name, Pair, Record
from relgym.model.files.format import Body, SchemaRecord, ShapeRecord
from relgym.model.files.storage import FORMAT, VERSION

__all__ = ["EnvBody", "SpaceRecord", "ViewRecord", "json_schema"]

_Whole: TypeAlias = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
_Choices: TypeAlias = Annotated[int, Meta(ge=1, le=2**63 - 1)]


# ---------------------------------------------------------------------- spaces
class BoxSpace(Record, tag_field="kind", tag="box"):
    """`gymnasium.spaces.Box`; bounds are nested lists, and may be infinite."""

    low: Any
    high: Any
    dtype: Literal[
        "float16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"
    ]  # fmt: skip


class DiscreteSpace(Record, tag_field="kind", tag="discrete"):
    """`gymnasium.spaces.Discrete`."""

    n: _Choices
    start: _Whole


class MultiDiscreteSpace(Record, tag_field="kind", tag="multi-discrete"):
    """`gymnasium.spaces.MultiDiscrete`; both are nested lists of whole numbers."""

    nvec: list[Any]
    start: list[Any]


class MultiBinarySpace(Record, tag_field="kind", tag="multi-binary"):
    """`gymnasium.spaces.MultiBinary`."""

    n: (
        Annotated[int, Meta(ge=1, le=10**6)]
        | Annotated[list[Annotated[int, Meta(ge=1, le=10**6)]], Meta(min_length=1, max_length=8)]
    )


class DictSpace(Record, tag_field="kind", tag="dict"):
    """`gymnasium.spaces.Dict`."""

    spaces: list[tuple[str, SpaceRecord]]


class TupleSpace(Record, tag_field="kind", tag="tuple"):
    """`gymnasium.spaces.Tuple`."""

    spaces: list[SpaceRecord]


class AgentsSpaceRecord(Record, tag_field="kind", tag="agents"):
    """`relgym.envs.AgentsSpace`: a part for each agent."""

    spaces: list[tuple[str, SpaceRecord]]


class OneOfSpace(Record, tag_field="kind", tag="one-of"):
    """`gymnasium.spaces.OneOf`."""

    spaces: Annotated[list[SpaceRecord], Meta(min_length=1)]


class SequenceSpace(Record, tag_field="kind", tag="sequence"):
    """`gymnasium.spaces.Sequence`."""

    space: SpaceRecord
    stack: bool


class GraphSpace(Record, tag_field="kind", tag="graph"):
    """`gymnasium.spaces.Graph`; nodes and edges are a Box or Discrete."""

    nodes: BoxSpace | DiscreteSpace
    edges: BoxSpace | DiscreteSpace | None


class TextSpace(Record, tag_field="kind", tag="text"):
    """`gymnasium.spaces.Text`."""

    min_length: Annotated[int, Meta(ge=0, le=10**6)]
    max_length: Annotated[int, Meta(ge=0, le=10**6)]
    charset: Annotated[str, Meta(max_length=10_000)]


SpaceRecord: TypeAlias = (
    BoxSpace
    | DiscreteSpace
    | MultiDiscreteSpace
    | MultiBinarySpace
    | DictSpace
    | TupleSpace
    | AgentsSpaceRecord
    | OneOfSpace
    | SequenceSpace
    | GraphSpace
    | TextSpace
)


# ---------------------------------------------------------------------- views
class PartRecord(Record):
    """An object, and the numbers that are its properties (`relgym.envs.views.Part`)."""

    name: Name
    columns: list[Pair]
    type: Name | None
    shape: ShapeRecord | None
    pose: dict[Name, Name]
    velocity: list[Name | None]
    constants: list[tuple[Name, Finite]]
    angles: list[Name]


class RowsRecord(Record):
    """Rows of a table that are objects of one kind (`relgym.envs.views.Rows`)."""

    name: Name
    count: Annotated[int, Meta(ge=1, le=10**6)]
    type: Name | None
    shape: ShapeRecord | None
    pose: dict[Name, Name]
    velocity: list[Name | None]
    constants: list[tuple[Name, Finite]]
    angles: list[Name]


class StaticRecord(Record):
    """An object that no observation shows (`relgym.envs.views.Static`)."""

    name: Name
    values: list[tuple[Name, Finite]]
    type: Name | None
    shape: ShapeRecord | None


class AngleRecord(Struct, array_like=True, forbid_unknown_fields=True):
    """Names of two numbers that are cosine and sine of an angle, and the angle's."""

    cos: Name
    sin: Name
    name: Name | None = None


_Axes: TypeAlias = tuple[Literal["x", "y", "z"], bool]


class NumbersViewRecord(Record, tag_field="kind", tag="flat"):
    """`relgym.envs.views.NumbersView`."""

    observation: SpaceRecord
    action: SpaceRecord
    names: list[Name]
    parts: list[PartRecord]
    angles: Literal["auto"] | list[AngleRecord]
    actions: list[Name] | None
    static: list[StaticRecord]
    axes: _Axes


class TableViewRecord(Record, tag_field="kind", tag="table"):
    """`relgym.envs.views.TableView`."""

    observation: SpaceRecord
    action: SpaceRecord
    columns: list[Name]
    rows: list[RowsRecord]
    presence: Name | None
    match: list[tuple[Name, Amount]] | None
    actions: list[Name] | None
    static: list[StaticRecord]
    axes: _Axes
    changes: list[Name] = []
    offsets: bool = False


class SceneViewRecord(Record, tag_field="kind", tag="scene"):
    """`relgym.envs.views.SceneView`."""

    schema: SchemaRecord
    observation: SpaceRecord
    action: SpaceRecord


class AgentsViewRecord(Record, tag_field="kind", tag="agents"):
    """`relgym.envs.views.AgentsView`: kind of each agent, and names of what each kind shows and does."""

    observation: SpaceRecord
    action: SpaceRecord
    kinds: dict[Name, Name]
    names: dict[Name, list[Name]]
    actions: dict[Name, list[Name]]


class FunctionViewRecord(Record, tag_field="kind", tag="function"):
    """That there was a function; no file can hold one."""


class TaskViewRecord(Record, tag_field="kind", tag="task"):
    """Another view, whose scenes also say what a step brought (`relgym.envs.views.TaskView`)."""

    view: NumbersViewRecord | TableViewRecord | SceneViewRecord | AgentsViewRecord | FunctionViewRecord
    reward: bool
    terminated: bool


ViewRecord: TypeAlias = (
    NumbersViewRecord
    | TableViewRecord
    | SceneViewRecord
    | AgentsViewRecord
    | FunctionViewRecord
    | TaskViewRecord
)


# ---------------------------------------------------------------------- the env
class StartRecord(Record):
    """The first scene of an episode."""

    objects: list[Name]
    vector: list[Finite]


class SpacesRecord(Record):
    """What observations and actions are elements of."""

    observation: SpaceRecord
    action: SpaceRecord


class EnvBody(Struct):
    """What a model keeps of its env; whoever saves it may add fields of his own."""

    spaces: SpacesRecord
    starts: list[StartRecord]
    metadata: dict[str, Any]
    view: ViewRecord | None = None


def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a model file: of its text, or of the member ``model.json`` of one with history."""
    (body, env), records = msgspec.json.schema_components((Body, EnvBody), ref_template="#/$defs/{name}")
    for record in records.values():  # parameters are described where they are declared
        record["description"] = record.get("description", "").split("\n\n")[0]
    records["Body"]["properties"]["extra"] |= {
        "description": f"The caller's data; a learner's: {env['$ref']}"
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"relgym model file, version {VERSION}",
        "type": "object",
        "properties": {
            "format": {"const": FORMAT},
            "version": {"const": VERSION},
            "sha256": {"type": "string", "description": "of the canonical JSON of body and history"},
            "history": {
                "type": ["string", "null"],
                "description": "SHA-256 of history.npz; null without history",
            },
            "body": body,
        },
        "required": ["format", "version", "sha256", "history", "body"],
        "additionalProperties": False,
        "$defs": records,
    }


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=1, sort_keys=True, ensure_ascii=False))
