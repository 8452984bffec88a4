"""Model files: versioned canonical JSON with a checksum, written whole or not at all; with history a zip.

Nothing is ever unpickled or evaluated. `relgym.model.files.format` declares what the JSON holds.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ModelFileError
from relgym.files.reading import (
    ARCHIVE,
    FileLimits,
    StoredArrays,
    check_depth,
    parse_json,
    read_bytes,
    read_members,
    write_arrays,
    write_members,
)
from relgym.files.writing import write_whole
from relgym.model.files.upgrade import upgraded
from relgym.scene.objects import Kinematics, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Compound, ConvexPolyhedron, Prism, Shape, Sphere, Wedge

__all__ = [
    "FORMAT",
    "VERSION",
    "read_model",
    "schema_from_json",
    "schema_to_json",
    "shape_from_json",
    "shape_to_json",
    "write_model",
]

FORMAT: Final = "relgym-model"
VERSION: Final = 6
"""Files of all versions are read: `relgym.model.files.upgrade` says what has changed. Version 1 had no checksum of the
history."""

_TEXT, _HISTORY = "model.json", "history.npz"

_SHAPES: dict[str, type] = {
    "sphere": Sphere,
    "box": Box,
    "wedge": Wedge,
    "prism": Prism,
    "polyhedron": ConvexPolyhedron,
    "compound": Compound,
}


def write_model(
    path: str | os.PathLike[str], body: dict[str, Any], arrays: Mapping[str, NDArray[Any]] | None
) -> None:
    """Write a model file; a kill at any moment leaves the old or the new file whole.

    Parameters
    ----------
    path
        Where to write.
    body
        Plain data.
    arrays
        History to keep beside it (then the file is a zip), or None.

    Raises
    ------
    ModelFileError
        The body isn't plain data, there is no such folder, no space is left, or nothing may be written there.
    """
    history = None if arrays is None else write_arrays(arrays)
    digest = None if history is None else hashlib.sha256(history).hexdigest()
    try:
        check_depth(body.get("extra"))
        whole = {"body": body, "history": digest}
        text = _canonical({"format": FORMAT, "version": VERSION, "sha256": _digest(whole), **whole}).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise ModelFileError(
            f"the model can't be saved: {error}; expected extra to be plain data (numbers, strings, lists, dicts "
            "with strings as keys) that isn't nested deep"
        ) from None
    write_whole(
        path,
        text if history is None else write_members({_TEXT: text, _HISTORY: history}),
        error=ModelFileError,
    )


def read_model(
    path: str | os.PathLike[str], limits: FileLimits | None = None
) -> tuple[dict[str, Any], StoredArrays | None]:
    """Read what `write_model` wrote: plain data and arrays (None when saved without history).

    An array is read when it is asked for; one that can't be read then raises `ModelFileError`, too.

    Parameters
    ----------
    path
        The file.
    limits
        How much it may ask for; default: those of `FileLimits`.

    Raises
    ------
    ModelFileError
        There is no such file, it isn't a relgym model, is of another version, truncated, too large, or was edited.
    """
    limits = limits or FileLimits()
    data = read_bytes(path, limits, error=ModelFileError)
    try:
        history: bytes | None = None
        if data[:2] == ARCHIVE:
            members = read_members(data, (_TEXT, _HISTORY))
            data, history = members[_TEXT], members[_HISTORY]
        whole = parse_json(data, limits)
    except ValueError as error:
        raise ModelFileError(
            f"{path}: expected a relgym model, but it can't be read ({error}); it is truncated or another kind of "
            "file: save the model again"
        ) from None
    body = _checked(path, whole, history)
    try:
        return body, None if history is None else StoredArrays(history, limits, error=_lost)
    except ValueError as error:
        raise ModelFileError(f"{path}: {_lost(str(error))}") from None


def _lost(said: str) -> ModelFileError:
    return ModelFileError(f"its history can't be read ({said}); save the model again")


def _checked(path: str | os.PathLike[str], whole: Any, history: bytes | None) -> dict[str, Any]:
    """The body of a file of a known version whose checksum fits, as the present version has it."""
    if not isinstance(whole, dict) or whole.get("format") != FORMAT:
        raise ModelFileError(f"{path}: expected a relgym model file, got another kind of JSON")
    version, body = whole.get("version"), whole.get("body")
    if type(version) is not int or not 1 <= version <= VERSION:
        raise ModelFileError(
            f"{path}: expected format version 1 to {VERSION}, got {version!r:.40}; load it with the relgym version "
            "that wrote it"
        )
    digest = None if history is None else hashlib.sha256(history).hexdigest()
    content = body if version == 1 else {"body": body, "history": whole.get("history")}
    try:
        fits = isinstance(body, dict) and _digest(content) == whole.get("sha256")
    except (ValueError, RecursionError):
        fits = False
    if not isinstance(body, dict) or not fits or (version != 1 and whole.get("history") != digest):
        raise ModelFileError(
            f"{path}: the checksum doesn't match: the file was edited or damaged; save it again"
        )
    return upgraded(body, version)


def _canonical(data: Any) -> str:
    compact = (",", ":")
    return json.dumps(
        data, sort_keys=True, separators=compact, ensure_ascii=False, allow_nan=True, default=_plain
    )


def _plain(value: Any) -> Any:
    """NumPy's numbers as Python's: users' declarations and records may hold them."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a model's file can't hold {value!r:.200}")


def _digest(content: Any) -> str:
    return hashlib.sha256(_canonical(content).encode()).hexdigest()


def schema_to_json(schema: SceneSchema) -> dict[str, Any]:
    """Plain data that `schema_from_json` reads back."""
    return {
        "types": [_type_to_json(t) for t in schema.types],
        "objects": [list(pair) for pair in schema.objects],
        "up": schema.up,
        "planar": schema.planar,
        "kinematics": [[k.type, k.property, k.rate, k.step, k.uses_next] for k in schema.kinematics],
        "targets": None if schema.targets is None else [target_to_json(t) for t in schema.targets],
        "action_scale": [list(a) for a in schema.action_scale],
        **({"offsets": True} if schema.offsets else {}),
        **({"precision": schema.precision} if schema.precision else {}),
    }


def schema_from_json(data: dict[str, Any]) -> SceneSchema:
    """Read what `schema_to_json` wrote."""
    targets = data["targets"]
    return SceneSchema(
        types=tuple(_type_from_json(t) for t in data["types"]),
        objects=tuple((str(name), str(kind)) for name, kind in data["objects"]),
        up=data["up"],
        planar=data["planar"],
        kinematics=tuple(Kinematics(*k) for k in data["kinematics"]),
        targets=None if targets is None else tuple(target_from_json(t) for t in targets),
        action_scale=tuple((str(p), float(low), float(high)) for p, low, high in data["action_scale"]),
        offsets=bool(data.get("offsets", False)),
        precision=float(data.get("precision", 0.0)),
    )


def target_to_json(target: Target) -> list[Any]:
    """Plain data that `target_from_json` reads back."""
    return [target.type, target.property, [list(pair) for pair in target.given]]


def target_from_json(data: list[Any]) -> Target:
    """Read what `target_to_json` wrote."""
    return Target(data[0], data[1], tuple((str(t), str(p)) for t, p in data[2]))


def _type_to_json(t: ObjectType) -> dict[str, Any]:
    return {
        "name": t.name,
        "properties": list(t.properties),
        "shape": None if t.shape is None else shape_to_json(t.shape),
        "parent": t.parent,
        "pose": dict(t.pose),
        "velocity": list(t.velocity),
        "exogenous": list(t.exogenous),
        "optional": t.optional,
        "angles": list(t.angles),
        **({"flags": list(t.flags)} if t.flags else {}),
    }


def _type_from_json(data: dict[str, Any]) -> ObjectType:
    return ObjectType(
        name=data["name"],
        properties=tuple(data["properties"]),
        shape=None if data["shape"] is None else shape_from_json(data["shape"]),
        parent=data["parent"],
        pose=dict(data["pose"]),
        velocity=tuple(data["velocity"]),
        exogenous=tuple(data["exogenous"]),
        optional=data["optional"],
        angles=tuple(data.get("angles", ())),
        flags=tuple(data.get("flags", ())),
    )


def shape_to_json(shape: Shape) -> dict[str, Any]:
    """Plain data that `shape_from_json` reads back."""
    kind = next(name for name, cls in _SHAPES.items() if type(shape) is cls)
    if isinstance(shape, Compound):
        return {"kind": kind, "parts": [[list(c) for c in part] for part in shape.parts]}
    corners = getattr(shape, "vertices", None)
    return {"kind": kind} if corners is None else {"kind": kind, "vertices": [list(c) for c in corners]}


def shape_from_json(data: dict[str, Any]) -> Shape:
    """Read what `shape_to_json` wrote."""
    cls = _SHAPES[data["kind"]]
    if "parts" in data:
        return Compound(tuple(tuple((float(x), float(y)) for x, y in part) for part in data["parts"]))
    if "vertices" not in data:
        plain: Shape = cls()
        return plain
    shape: Shape = cls(tuple(tuple(float(c) for c in corner) for corner in data["vertices"]))
    return shape
