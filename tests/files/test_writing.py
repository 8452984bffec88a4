"""Files are written whole or not at all, whatever happens to the process, the disk, or the name."""

from __future__ import annotations

import errno
import os
import resource
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from relgym.errors import ModelFileError, RelgymError, StoreError
from relgym.files.writing import write_whole

WRITER = """
import sys
from relgym.errors import ModelFileError
from relgym.files.writing import write_whole
path, size = sys.argv[1], int(sys.argv[2])
print("ready", flush=True)
for k in range(100_000):
    write_whole(path, bytes([65 + k % 26]) * size, error=ModelFileError)
"""

MANY_WRITERS = """
import os, sys
from relgym.errors import ModelFileError
from relgym.files.writing import write_whole
path, size = sys.argv[1], int(sys.argv[2])
for line in sys.stdin:
    child = os.fork()
    if not child:
        print(os.getpid(), flush=True)
        for k in range(100_000):
            write_whole(path, bytes([65 + k % 26]) * size, error=ModelFileError)
    os.waitpid(child, 0)
    print("dead", flush=True)
"""
"""Starts a writer for every line that it reads, and tells when that has ended; each has what it needs in memory."""


def write(path: Path, data: bytes = b"new") -> None:
    write_whole(path, data, error=ModelFileError)


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def test_what_is_written_is_there_and_nothing_else(tmp_path: Path) -> None:
    write(tmp_path / "file", b"one")
    write(tmp_path / "file", b"two")
    assert (tmp_path / "file").read_bytes() == b"two"
    assert names(tmp_path) == ["file"]


def test_a_new_file_has_the_mode_that_the_umask_leaves(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write(tmp_path / "file")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == 0o640


@pytest.mark.parametrize("mode", [0o600, 0o664, 0o755])
def test_an_existing_file_keeps_its_mode(mode: int, tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    path.chmod(mode)
    write(path)
    assert stat.S_IMODE(path.stat().st_mode) == mode


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is protected from root")
def test_a_write_protected_file_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    path.chmod(0o444)
    with pytest.raises(ModelFileError, match="write-protected"):
        write(path)
    assert path.read_bytes() == b"old"


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "file", tmp_path / "link"
    target.write_bytes(b"old")
    link.symlink_to(target)
    write(link)
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    dangling = tmp_path / "dangling"
    dangling.symlink_to(tmp_path / "there" / "other")
    write(dangling)
    assert (tmp_path / "there" / "other").read_bytes() == b"new"
    assert names(tmp_path / "there") == ["file", "other"]


def test_a_circle_of_links_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(ModelFileError, match="can't be written"):
        write(tmp_path / "a")


def _pipe(path: Path) -> None:
    os.mkfifo(path)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(os.path.relpath(path))


@pytest.mark.parametrize("make", [_pipe, _socket, Path.mkdir])
def test_only_plain_files_are_written(make: Callable[[Path], None], tmp_path: Path) -> None:
    path = tmp_path / "special"
    make(path)
    kind = stat.S_IFMT(path.stat().st_mode)
    with pytest.raises(ModelFileError, match=r"special file|is a folder"):
        write(path)
    assert stat.S_IFMT(path.stat().st_mode) == kind
    assert names(tmp_path) == ["special"]


@pytest.mark.parametrize("name", ["no/such/folder", "nul\0l", "", "x" * 300])
def test_no_such_place(name: str, tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match=r"can't be written|is a folder"):
        write_whole(os.fspath(tmp_path) + "/" + name, b"", error=ModelFileError)
    assert names(tmp_path) == []


@pytest.mark.parametrize("name", ["x" * 255, "é" * 120])
def test_long_names_do(name: str, tmp_path: Path) -> None:
    write(tmp_path / name)
    assert names(tmp_path) == [name]


@pytest.mark.parametrize("error", [ModelFileError, StoreError])
@pytest.mark.parametrize("failing", ["fsync", "replace"])
def test_a_full_disk_leaves_the_old_file(
    failing: str, error: type[RelgymError], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    write(path, b"old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, failing, full)
    with pytest.raises(error, match="no space left"):
        write_whole(path, b"new", error=error)
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["file"]


def test_a_file_that_may_not_grow_so_far(tmp_path: Path) -> None:
    # What the system itself says when there is no room: a limit on the size of files.
    path = tmp_path / "file"
    write(path, b"old")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1_000, before[1]))
        with pytest.raises(ModelFileError, match="no space left"):
            write(path, b"x" * 100_000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["file"]


def test_leftovers_of_the_dead_are_removed_and_those_of_the_living_are_not(tmp_path: Path) -> None:
    path = tmp_path / "file"
    code = (
        "import os, sys, time; from pathlib import Path; from relgym.files import writing\n"
        "writing._temporary(Path(sys.argv[1])); print('ready', flush=True); time.sleep(600)"
    )
    with subprocess.Popen([sys.executable, "-c", code, path], stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        writer.stdout.readline()
        assert len(names(tmp_path)) == 1
        write(path)
        assert len(names(tmp_path)) == 2, "it is still at work"
        writer.kill()
        writer.wait()
    (tmp_path / ".file.other").write_bytes(b"somebody else's")
    write(path)
    assert names(tmp_path) == [".file.other", "file"]


def kill_while_writing(path: Path, kills: int, size: int = 3_000_000) -> int:
    """Kill writers at random moments; how many kills left a temporary file. Raises where a file is broken."""
    left = 0
    command = [sys.executable, "-c", MANY_WRITERS, str(path), str(size)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as writers:
        assert writers.stdin is not None and writers.stdout is not None
        for k in range(kills):
            print(flush=True, file=writers.stdin)
            writer = int(writers.stdout.readline())
            time.sleep(0.0007 * (k % 60))
            os.kill(writer, signal.SIGKILL)
            assert writers.stdout.readline() == "dead\n"
            left += len(names(path.parent)) > 1
            found = path.read_bytes() if path.exists() else b"A" * size
            assert len(found) == size and found == found[:1] * size
    return left


def test_a_kill_leaves_a_whole_file(tmp_path: Path) -> None:
    left = kill_while_writing(tmp_path / "file", 8)
    write(tmp_path / "file")
    assert names(tmp_path) == ["file"]
    assert left >= 0


@pytest.mark.slow
def test_a_thousand_kills_leave_a_whole_file(tmp_path: Path) -> None:
    left = kill_while_writing(tmp_path / "file", 1_000)
    print(f"{left} of 1,000 kills left a temporary file")
    assert left > 50, "kills hit no writer at work"
    write(tmp_path / "file")
    assert names(tmp_path) == ["file"]


def test_two_writers_leave_one_whole_file(tmp_path: Path) -> None:
    path, size = tmp_path / "file", 200_000
    writers = [
        subprocess.Popen([sys.executable, "-c", WRITER, path, str(size)], stdout=subprocess.PIPE)
        for _ in range(2)
    ]
    try:
        for writer in writers:
            assert writer.stdout is not None
            writer.stdout.readline()
        until = time.monotonic() + 1.5
        while time.monotonic() < until:
            if path.exists():
                found = path.read_bytes()
                assert len(found) == size and found == found[:1] * size
            assert all(writer.poll() is None for writer in writers), "one took the other's file away"
    finally:
        for writer in writers:
            writer.kill()
            writer.wait()
            assert writer.stdout is not None
            writer.stdout.close()
    write(path)
    assert names(tmp_path) == ["file"]
