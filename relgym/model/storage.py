"""Model files: versioned canonical JSON with a checksum, written atomically; with history a zip.

Nothing is ever unpickled or evaluated.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ModelFileError
from relgym.scene.objects import Kinematics, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, ConvexPolyhedron, Prism, Shape, Sphere, Wedge

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

FORMAT = "relgym-model"
VERSION = 1

_SHAPES: dict[str, type] = {
    "sphere": Sphere,
    "box": Box,
    "wedge": Wedge,
    "prism": Prism,
    "polyhedron": ConvexPolyhedron,
}


def write_model(
    path: str | os.PathLike[str], body: dict[str, Any], arrays: dict[str, NDArray[Any]] | None
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
        There is no such folder, or nothing may be written there.
    """
    text = _canonical({"format": FORMAT, "version": VERSION, "sha256": _digest(body), "body": body})
    data = text.encode()
    if arrays is not None:
        data = _zipped(data, arrays)
    target = Path(path)
    try:
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    except OSError as error:
        raise ModelFileError(
            f"{path} can't be written ({error.strerror}): expected a path in a folder that may be written to"
        ) from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o666 & ~_umask())  # a temporary file is its owner's alone; a model need not be
        if target.is_dir():
            raise ModelFileError(f"{path} is a folder: expected the path of a file")
        os.replace(temporary, target)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def read_model(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, NDArray[Any]] | None]:
    """Read what `write_model` wrote: plain data and arrays (None when saved without history).

    Raises
    ------
    ModelFileError
        There is no such file, it isn't a relgym model, is of another version, truncated, or was edited.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise ModelFileError(
            f"{path} can't be read ({error.strerror}): expected a file that a model's save has written"
        ) from error
    arrays: dict[str, NDArray[Any]] | None = None
    if data[:2] == b"PK":
        data, arrays = _unzipped(path, data)
    try:
        whole = json.loads(data)
    except ValueError as error:
        raise ModelFileError(
            f"{path}: expected a relgym model (JSON), but it can't be read ({error}); it is truncated or "
            "another kind of file: save the model again"
        ) from None
    if not isinstance(whole, dict) or whole.get("format") != FORMAT:
        raise ModelFileError(f"{path}: expected a relgym model file, got another kind of JSON")
    if whole.get("version") != VERSION:
        raise ModelFileError(
            f"{path}: expected format version {VERSION}, got {whole.get('version')!r}; "
            "load it with the relgym version that wrote it"
        )
    body = whole.get("body")
    if not isinstance(body, dict) or _digest(body) != whole.get("sha256"):
        raise ModelFileError(
            f"{path}: the checksum doesn't match: the file was edited or damaged; save it again"
        )
    return body, arrays


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _canonical(data: Any) -> str:
    compact = (",", ":")
    return json.dumps(
        data, sort_keys=True, separators=compact, ensure_ascii=False, allow_nan=True, default=_plain
    )


def _plain(value: Any) -> Any:
    """NumPy's numbers as Python's: users' declarations and records may hold them."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a model's file can't hold {value!r}: expected plain data")


def _digest(body: dict[str, Any]) -> str:
    return hashlib.sha256(_canonical(body).encode()).hexdigest()


def _zipped(text: bytes, arrays: dict[str, NDArray[Any]]) -> bytes:
    buffer, history = io.BytesIO(), io.BytesIO()
    np.savez_compressed(history, allow_pickle=False, **arrays)
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, content in (("model.json", text), ("history.npz", history.getvalue())):
            archive.writestr(zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0)), content)
    return buffer.getvalue()


def _unzipped(path: str | os.PathLike[str], data: bytes) -> tuple[bytes, dict[str, NDArray[Any]]]:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            text = archive.read("model.json")
            with np.load(io.BytesIO(archive.read("history.npz")), allow_pickle=False) as arrays:
                return text, {name: arrays[name] for name in arrays.files}
    except (zipfile.BadZipFile, KeyError, ValueError, EOFError, OSError) as error:
        raise ModelFileError(
            f"{path}: expected a relgym model with history, but it can't be read ({error}); "
            "it is truncated or another kind of zip: save the model again"
        ) from None


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
    corners = getattr(shape, "vertices", None)
    return {"kind": kind} if corners is None else {"kind": kind, "vertices": [list(c) for c in corners]}


def shape_from_json(data: dict[str, Any]) -> Shape:
    """Read what `shape_to_json` wrote."""
    cls = _SHAPES[data["kind"]]
    if "vertices" not in data:
        plain: Shape = cls()
        return plain
    shape: Shape = cls(tuple(tuple(float(c) for c in corner) for corner in data["vertices"]))
    return shape
