"""Reading files that anybody may have made: within limits, and nothing is allocated before it is known to fit.

JSON, and zip archives of arrays as `numpy.savez_compressed` writes them. Nothing is ever unpickled or evaluated.
"""

from __future__ import annotations

import io
import json
import math
import os
import re
import stat
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from typing import IO, Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError, RelgymError

__all__ = [
    "ARCHIVE",
    "DEPTH",
    "FileLimits",
    "StoredArrays",
    "check_depth",
    "parse_json",
    "read_arrays",
    "read_bytes",
    "read_members",
    "write_arrays",
    "write_members",
]

ARCHIVE: Final = b"PK"
"""What zip archives begin with."""

DEPTH: Final = 64
"""Data of a caller's own may be nested so deep."""

_MIB: Final = 1 << 20
_DIRECTORY: Final = 1 << 20
"""Most bytes of an archive's table of contents: some 10,000 entries."""
_CHUNK: Final = 1 << 20
_DTYPES: Final = {"<f8": "float64", "<i8": "int64", "<i4": "int32", "<i2": "int16"}
_HEADER: Final = re.compile(
    rb"\{'descr': '(<f8|<i8|<i4|<i2)', 'fortran_order': False, 'shape': \(([0-9, ]{0,60})\), \} *\n"
)
_DATE: Final = (1980, 1, 1, 0, 0, 0)


class _UnreadableError(Exception):
    """Why a file can't be read; callers say which file, and raise their own kind of error."""


@dataclass(frozen=True, slots=True)
class FileLimits:
    """How much a file may ask for before it is refused.

    Parameters
    ----------
    file
        Most bytes of the file itself. Default 1 GiB.
    text
        Most bytes of JSON. Default 256 MiB.
    items
        Most values in the JSON: numbers, strings, lists, objects. Default 2,000,000, which take some 200 MB.
    arrays
        Most bytes of all arrays together, decompressed. Default 1.5 GiB.

    Raises
    ------
    ConfigError
        A limit that is no whole number of at least 1.
    """

    file: int = 1024 * _MIB
    text: int = 256 * _MIB
    items: int = 2_000_000
    arrays: int = 1536 * _MIB

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, int) or isinstance(value, bool) or value < 1:
                raise ConfigError(f"limits: {field.name} must be a whole number of at least 1, got {value!r}")


def _too_large(what: str, size: int, most: int, field: str) -> _UnreadableError:
    return _UnreadableError(
        f"{what}: {size:,}, and at most {most:,} are allowed; if you trust the file, load it with "
        f"limits=FileLimits({field}={size})"
    )


def read_bytes(path: str | os.PathLike[str], limits: FileLimits, *, error: type[RelgymError]) -> bytes:
    """The content of a plain file.

    Raises
    ------
    RelgymError
        Of the kind asked for: there is no such file, it is a folder or a special file, or larger than allowed.
    """
    try:
        # A pipe that nobody writes to would never open, and a device never end.
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | getattr(os, "O_CLOEXEC", 0))
        with os.fdopen(handle, "rb") as file:
            found = os.fstat(file.fileno())
            if stat.S_ISDIR(found.st_mode):
                raise error(f"{path} can't be read (it is a folder): expected the path of a file")
            if not stat.S_ISREG(found.st_mode):
                raise error(f"{path} can't be read (it is a special file): expected the path of a plain file")
            if found.st_size > limits.file:
                said = _too_large("bytes of the file", found.st_size, limits.file, "file")
                raise error(f"{path} is too large: {said}")
            return file.read(found.st_size + 1)
    except RelgymError:
        raise
    except (OSError, ValueError) as problem:  # ValueError: a null byte in the path
        why = getattr(problem, "strerror", None) or str(problem)
        raise error(f"{path} can't be read ({why}): expected a file that relgym has written") from problem


def parse_json(data: bytes, limits: FileLimits) -> Any:
    """JSON as plain data; `ValueError` says what is wrong with it.

    Infinity and NaN may stand for numbers: spaces may be unbounded.
    """
    try:
        if len(data) > limits.text:
            raise _too_large("bytes of JSON", len(data), limits.text, "text")
        items = data.count(b",") + data.count(b"[") + data.count(b"{") + 1
        if items > limits.items:
            raise _too_large("values in the JSON", items, limits.items, "items")
        text = data.decode("utf-8")
        found = json.loads(text)
        if "\\ud" in text or "\\uD" in text:  # half a pair of surrogates is no text, and no file can hold it
            json.dumps(found, ensure_ascii=False).encode()
    except (_UnreadableError, RecursionError, ValueError) as problem:
        said = "it is nested too deep" if isinstance(problem, RecursionError) else str(problem)
        raise ValueError(said) from None
    return found


def check_depth(data: Any, most: int = DEPTH) -> None:
    """Raise `ValueError` for data that is nested deeper than that."""
    level = [data]
    for _ in range(most):
        level = [
            inner
            for each in level
            if isinstance(each, (dict, list))
            for inner in (each.values() if isinstance(each, dict) else each)
        ]
        if not level:
            return
    raise ValueError(f"it is nested too deep: at most {most} levels are allowed")


# ---------------------------------------------------------------------- archives
def write_members(members: Mapping[str, bytes]) -> bytes:
    """An archive that `read_members` reads, the same bytes whenever it is written."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name, date_time=_DATE), content)
    return buffer.getvalue()


def read_members(data: bytes, names: tuple[str, ...]) -> dict[str, bytes]:
    """Members of an archive that holds these and nothing else, uncompressed; `ValueError` says what is wrong."""
    with _opened(data) as archive:
        found = {info.filename: info for info in archive.infolist()}
        if tuple(sorted(found)) != tuple(sorted(names)):
            raise ValueError(f"expected an archive of {list(names)}, got {sorted(found)[:5]}")
        for name, info in found.items():
            if info.compress_type != zipfile.ZIP_STORED or info.file_size != info.compress_size:
                raise ValueError(f"{name}: expected a member that is stored as it is")
        return {name: _content(archive, found[name]) for name in names}


def _content(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> bytes:
    try:
        return archive.read(info)
    except _BROKEN as problem:
        raise ValueError(f"{info.filename}: {problem}") from None


_BROKEN: Final = (
    zipfile.BadZipFile,
    EOFError,
    OSError,
    KeyError,
    NotImplementedError,
    RuntimeError,
    zlib.error,
)
"""What `zipfile` raises of archives that are damaged, encrypted, or packed in a way that it doesn't know."""


def _opened(data: bytes) -> zipfile.ZipFile:
    """An archive whose table of contents is of a bounded size, with every entry once and none encrypted."""
    if len(data) < 22 or data[-22:-18] != b"PK\x05\x06":
        raise ValueError("it is truncated or no archive that relgym has written")
    (directory,) = struct.unpack("<I", data[-10:-6])
    if directory > _DIRECTORY:
        raise ValueError(f"its table of contents has {directory:,} bytes, expected at most {_DIRECTORY:,}")
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except (*_BROKEN, ValueError) as problem:
        raise ValueError(str(problem)) from None
    names = [info.filename for info in archive.infolist()]
    if len(set(names)) < len(names):
        raise ValueError("it holds two members of one name")
    for info in archive.infolist():
        if info.flag_bits & 0x1:
            raise ValueError(f"{info.filename} is encrypted")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{info.filename} is packed by method {info.compress_type}, expected deflate")
    return archive


def write_arrays(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Arrays as an archive that `read_arrays` and `numpy.load` read; the same bytes whenever they are written."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            content = io.BytesIO()
            np.lib.format.write_array(
                content, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False
            )
            info = zipfile.ZipInfo(f"{name}.npy", date_time=_DATE)
            archive.writestr(info, content.getbuffer(), zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


class StoredArrays(Mapping[str, NDArray[Any]]):
    """What `write_arrays` wrote: arrays by name, each of which is read when it is asked for, and then kept.

    The sizes that all arrays claim are looked at before the first one is made room for, and no more than that is ever
    decompressed. Who knows what shapes there should be can look at the claims before any room is made.

    Parameters
    ----------
    data
        The archive.
    limits
        How much it may ask for.
    error
        What to raise where an array that is asked for can't be read.

    Raises
    ------
    ValueError
        Says what is wrong with the archive, or with what it claims.
    """

    def __init__(
        self, data: bytes, limits: FileLimits, *, error: Callable[[str], Exception] = ValueError
    ) -> None:
        self._error = error
        self._archive = _opened(data)
        self._members = {info.filename.removesuffix(".npy"): info for info in self._archive.infolist()}
        self._claims = {name: _claim(self._archive, info) for name, info in self._members.items()}
        self._found: dict[str, NDArray[Any]] = {}
        total = sum(claim.nbytes for claim in self._claims.values())
        if total > limits.arrays:
            raise ValueError(str(_too_large("bytes of arrays", total, limits.arrays, "arrays")))
        for name, info in self._members.items():
            size = self._claims[name].start + self._claims[name].nbytes
            if info.file_size != size:
                raise ValueError(f"{info.filename}: expected {size:,} bytes, got {info.file_size:,}")

    def claim(self, name: str) -> tuple[np.dtype[Any], tuple[int, ...]]:
        """Dtype and shape of an array, from its header."""
        return np.dtype(self._claims[name].dtype), self._claims[name].shape

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._found:
            try:
                self._found[name] = _array(self._archive, self._members[name], self._claims[name])
            except ValueError as problem:
                raise self._error(str(problem)) from None
        return self._found[name]

    def __contains__(self, name: object) -> bool:
        return name in self._members  # without reading it

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)


def read_arrays(data: bytes, limits: FileLimits) -> dict[str, NDArray[Any]]:
    """All of `StoredArrays`; `ValueError` says what is wrong with it."""
    return dict(StoredArrays(data, limits))


@dataclass(frozen=True, slots=True)
class _Claim:
    """What an array's header says, and where its numbers begin."""

    dtype: str
    shape: tuple[int, ...]
    start: int

    @property
    def nbytes(self) -> int:
        return math.prod(self.shape) * np.dtype(self.dtype).itemsize


def _claim(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> _Claim:
    try:
        with archive.open(info) as stream:
            head = _exactly(stream, 10)
            if head[:8] != b"\x93NUMPY\x01\x00":
                raise ValueError(f"{info.filename}: expected an array (npy, version 1.0)")
            (length,) = struct.unpack("<H", head[8:])
            header = _HEADER.fullmatch(_exactly(stream, min(length, 512)))
    except _BROKEN as problem:
        raise ValueError(f"{info.filename}: {problem}") from None
    if header is None:
        raise ValueError(f"{info.filename}: expected whole numbers or float64, in rows (C order)")
    sizes = [part for part in header[2].decode().replace(" ", "").split(",") if part]
    if len(sizes) > 2 or any(len(size) > 15 for size in sizes):
        raise ValueError(f"{info.filename}: no array has the shape ({header[2].decode()})")
    return _Claim(_DTYPES[header[1].decode()], tuple(map(int, sizes)), 10 + length)


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, claim: _Claim) -> NDArray[Any]:
    found = np.empty(claim.shape, dtype=claim.dtype)
    room = found.reshape(-1).view(np.uint8)
    try:
        with archive.open(info) as stream:
            _exactly(stream, claim.start)
            for start in range(0, claim.nbytes, _CHUNK):
                size = min(_CHUNK, claim.nbytes - start)
                room[start : start + size] = np.frombuffer(_exactly(stream, size), dtype=np.uint8)
            if stream.read(1):
                raise ValueError(f"{info.filename}: there is more in it than its header says")
    except _BROKEN as problem:
        raise ValueError(f"{info.filename}: {problem}") from None
    return found


def _exactly(stream: IO[bytes], size: int) -> bytes:
    found = stream.read(size)
    if len(found) < size:
        raise EOFError("it is truncated")
    return found
