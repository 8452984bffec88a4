"""Files that mean harm are refused with a typed error, fast, and without memory."""

from __future__ import annotations

import hashlib
import io
import json
import os
import struct
import time
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from relgym.errors import ConfigError, ModelFileError
from relgym.files.reading import (
    FileLimits,
    check_depth,
    parse_json,
    read_arrays,
    read_bytes,
    write_arrays,
    write_members,
)
from relgym.model.world_model import WorldModel

ARRAYS = {"x": np.arange(6.0).reshape(3, 2), "n": np.arange(4, dtype=np.int32), "none": np.zeros((0, 3))}


def packed(members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def npy(shape: str, data: bytes = b"", descr: str = "<f8") -> bytes:
    header = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    header += b" " * (53 - len(header)) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + data


def model(history: bytes) -> bytes:
    """A model file with this history, and the checksum that goes with it."""
    whole = {"body": {}, "history": hashlib.sha256(history).hexdigest()}
    text = json.dumps(whole, sort_keys=True, separators=(",", ":")).encode()
    head = {"format": "relgym-model", "version": 2, "sha256": hashlib.sha256(text).hexdigest()}
    return write_members({"model.json": json.dumps(head | whole).encode(), "history.npz": history})


def encrypted(data: bytes) -> bytes:
    """The same archive with the flag of encryption in all its headers."""
    found = bytearray(data)
    for magic, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        place = found.find(magic)
        while place >= 0:
            found[place + at] |= 1
            place = found.find(magic, place + 4)
    return bytes(found)


def zeros(size: int, head: bytes = b"") -> bytes:
    """An archive of one array of so many zeros, in a thousandth of the bytes."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    first = packer.compress(head) + packer.flush(zlib.Z_FULL_FLUSH)
    # After a full flush the same bytes mean the same wherever they stand.
    chunk = packer.compress(b"\0" * (1 << 20)) + packer.flush(zlib.Z_FULL_FLUSH)
    content = first + chunk * (size >> 20) + packer.flush()
    return _raw_zip("x.npy", content, len(head) + size, zipfile.ZIP_DEFLATED)


def _raw_zip(
    name: str, content: bytes, claimed: int, method: int, sizes: int | None = None, repeat: int = 1
) -> bytes:
    """An archive of one member with whatever sizes its headers are to claim."""
    packed_size = len(content) if sizes is None else sizes
    head = struct.pack("<HHHHHIIIHH", 20, 0, method, 0, 0x21, 0, packed_size, claimed, len(name), 0)
    local = b"PK\x03\x04" + head + name.encode() + content
    central = (
        b"PK\x01\x02" + struct.pack("<H", 20) + head + struct.pack("<HHHII", 0, 0, 0, 0, 0) + name.encode()
    )
    central *= repeat
    end = struct.pack("<HHHHIIH", 0, 0, repeat, repeat, len(central), len(local), 0)
    return local + central + b"PK\x05\x06" + end


BOMBS: dict[str, Callable[[], bytes]] = {
    "deep lists": lambda: b"[" * 1_000_000,
    "deep objects": lambda: b'{"a":' * 500_000,
    "deep and whole": lambda: b"[" * 300_000 + b"]" * 300_000,
    "deep where anything may stand": lambda: (
        b'{"format":"relgym-model","version":1,"body":{"extra":' + b"[" * 500 + b"]" * 500 + b"}}"
    ),
    "many small lists": lambda: b"[" + b"[]," * 3_000_000 + b"[]]",
    "a long number": lambda: b'{"format": "relgym-model", "version": ' + b"9" * 100_000 + b"}",
    "half a surrogate": lambda: b'{"format": "relgym-model", "version": 1, "body": {"a": "\\ud800"}, "sha256": ""}',
    "half a surrogate as a name": lambda: b'{"\\udfff": "relgym-model"}',
    "no utf-8": lambda: b'{"format": "\xff"}',
    "null bytes": lambda: b"\0" * 1_000,
    "empty": lambda: b"",
    "1e12 elements": lambda: model(packed({"x.npy": npy("(1000000000000,)")})),
    "1e12 x 1e12 elements": lambda: model(packed({"x.npy": npy("(1000000000000, 1000000000000)")})),
    "many digits": lambda: model(packed({"x.npy": npy("(9" + "9" * 20 + ",)")})),
    "negative": lambda: model(packed({"x.npy": npy("(-1,)")})),
    "objects": lambda: model(packed({"x.npy": npy("(1,)", b"x", "|O")})),
    "strings": lambda: model(packed({"x.npy": npy("(1,)", b"x" * 1000, "<U999")})),
    "2 GB of zeros": lambda: model(zeros(1 << 31, npy("(268435456,)"))),
    "2 GB of zeros that claim to be 1": lambda: model(zeros(1 << 31, npy("(1,)"))),
    "2 GB of zeros in 20 kB": lambda: packed(
        {"model.json": b"{}", "history.npz": zeros(1 << 31, npy("(268435456,)"))}
    ),
    "less than its header says": lambda: model(packed({"x.npy": npy("(200,)", b"\0" * 8)})),
    "a directory that claims 1e9 bytes": lambda: model(packed({"x.npy": npy("(1,)")}))[:-10]
    + struct.pack("<I", 10**9)
    + b"\0" * 6,
    "30,000 members": lambda: _raw_zip("x.npy", b"abc", 3, 0, repeat=30_000),
    "two of a name": lambda: model(_twice()),
    "encrypted": lambda: encrypted(model(b"")),
    "encrypted arrays": lambda: model(encrypted(packed({"x.npy": npy("(1,)", b"\0" * 8)}))),
    "bzip2": lambda: packed({"model.json": b"{}", "history.npz": b""}, zipfile.ZIP_BZIP2),
    "lzma": lambda: model(packed({"x.npy": npy("(1,)", b"\0" * 8)}, zipfile.ZIP_LZMA)),
    "method 99": lambda: model(_raw_zip("x.npy", b"abc", 3, 99)),
    "a member that isn't there": lambda: model(_raw_zip("x.npy", b"", 10**9, zipfile.ZIP_STORED, 10**9)),
    "names that lead elsewhere": lambda: packed({"../../model.json": b"{}", "/etc/history.npz": b""}),
    "cut": lambda: model(packed({"x.npy": npy("(1,)", b"\0" * 8)}))[:-30],
    "deep where anything may stand, with its checksum": lambda: _deep(),
    "no archive": lambda: b"PK" + b"\xff" * 1_000,
}  # fmt: skip


def _deep() -> bytes:
    body = '{"extra":' + "[" * 900 + "]" * 900 + "}"
    digest = hashlib.sha256(f'{{"body":{body},"history":null}}'.encode()).hexdigest()
    head = f'"format":"relgym-model","version":2,"sha256":"{digest}","history":null'
    return f'{{{head},"body":{body}}}'.encode()


def _twice() -> bytes:
    buffer = io.BytesIO()
    with pytest.warns(UserWarning, match="Duplicate"), zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("x.npy", npy("(1,)", b"\0" * 8))
        archive.writestr("x.npy", npy("(1,)", b"\0" * 8))
    return buffer.getvalue()


@pytest.fixture(scope="module", autouse=True)
def _loaded() -> None:
    """What a first file loads isn't the file's to answer for."""
    import relgym.files.records
    import relgym.model.files.checks  # noqa: F401


@pytest.mark.parametrize("name", BOMBS)
def test_bombs_are_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / "model"
    path.write_bytes(BOMBS[name]())
    tracemalloc.start()
    began = time.process_time()
    with pytest.raises(ModelFileError, match=str(path)):
        WorldModel.load(path)
    took, (_, peak) = time.process_time() - began, tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak <= 100e6
    assert took <= 2.0  # where a bomb works it takes far longer; the tracer alone takes tenths of a second


@pytest.mark.parametrize("kind", ["pipe", "folder", "missing", "null"])
def test_only_plain_files_are_read(kind: str, tmp_path: Path) -> None:
    path = tmp_path / ("nul\0l" if kind == "null" else "file")
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    with pytest.raises(ModelFileError, match=r"special file|folder|can't be read"):
        read_bytes(path, FileLimits(), error=ModelFileError)


def test_a_device_is_refused() -> None:
    with pytest.raises(ModelFileError, match="special file"):
        read_bytes("/dev/zero", FileLimits(), error=ModelFileError)


def test_limits_name_themselves(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x" * 100)
    with pytest.raises(ModelFileError, match=r"limits=FileLimits\(file=100\)"):
        read_bytes(path, FileLimits(file=99), error=ModelFileError)
    assert read_bytes(path, FileLimits(file=100), error=ModelFileError) == b"x" * 100
    with pytest.raises(ValueError, match=r"limits=FileLimits\(text=7\)"):
        parse_json(b"[1,2,3]", FileLimits(text=6))
    with pytest.raises(ValueError, match=r"limits=FileLimits\(items=4\)"):
        parse_json(b"[1,2,3]", FileLimits(items=3))
    assert parse_json(b"[1,2,3]", FileLimits(text=7, items=4)) == [1, 2, 3]
    size = sum(array.nbytes for array in ARRAYS.values())
    with pytest.raises(ValueError, match=rf"limits=FileLimits\(arrays={size}\)"):
        read_arrays(write_arrays(ARRAYS), FileLimits(arrays=size - 1))
    assert set(read_arrays(write_arrays(ARRAYS), FileLimits(arrays=size))) == set(ARRAYS)


@pytest.mark.parametrize("value", [0, -1, 1.5, True, None, "1"])
def test_limits_are_whole_numbers(value: object) -> None:
    with pytest.raises(ConfigError, match="text must be a whole number"):
        FileLimits(text=value)  # type: ignore[arg-type]


def test_arrays_come_back_and_numpy_reads_them_too() -> None:
    data = write_arrays(ARRAYS)
    assert data == write_arrays(ARRAYS)
    again, other = read_arrays(data, FileLimits()), np.load(io.BytesIO(data))
    for name, array in ARRAYS.items():
        for found in (again[name], other[name]):
            assert found.dtype == array.dtype
            np.testing.assert_array_equal(found, array)
    assert again["x"].flags.writeable


def test_what_numpy_writes_is_read() -> None:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **ARRAYS)
    again = read_arrays(buffer.getvalue(), FileLimits())
    np.testing.assert_array_equal(again["x"], ARRAYS["x"])


def test_depth_is_counted() -> None:
    check_depth(json.loads("[" * 64 + "]" * 64))
    with pytest.raises(ValueError, match="at most 64"):
        check_depth(json.loads("[" * 65 + "]" * 65))


def test_infinity_is_a_number_and_text_may_hold_any_character() -> None:
    assert parse_json('[Infinity, "é\U0001f600\\ud83d\\ude00"]'.encode(), FileLimits()) == [
        float("inf"),
        "é\U0001f600\U0001f600",
    ]
