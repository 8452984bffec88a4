"""Machine code is kept whole or not at all, and whoever can't have it gets none."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from relgym.program import machine


@pytest.fixture
def empty_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr(machine, "folders", lambda: iter((tmp_path / "new" / "folder",)))
    return tmp_path / "new" / "folder"


def test_it_is_compiled_once(empty_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert machine.make() is not None
    (file,) = empty_folder.iterdir()
    monkeypatch.setattr(machine, "_built", lambda: pytest.fail("it was compiled again"))
    assert machine.make() is not None
    content = file.read_bytes()
    built: list[bytes] = []
    monkeypatch.setattr(machine, "_built", lambda: built.append(b"") or content[32:])
    for damaged in (content[:-1], content[:40] + bytes([content[40] ^ 1]) + content[41:], b""):
        file.write_bytes(damaged)
        assert machine.make() is not None
        assert file.read_bytes() == content
    assert len(built) == 3


def test_where_no_folder_can_be_written_to_it_is_not_kept(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(machine, "folders", lambda: iter((tmp_path / "file" / "below",)))
    code = machine.build()
    monkeypatch.setattr(machine, "_built", lambda: code)
    assert machine.make() is not None
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("failing", ["exit", "executable"])
def test_where_compiling_fails_there_is_none(
    empty_folder: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    run = subprocess.run

    def fails(command: list[str], **options: Any) -> Any:
        return run([sys.executable, "-c", "raise SystemExit(3)"], **options)

    if failing == "exit":
        monkeypatch.setattr(subprocess, "run", fails)
    else:
        monkeypatch.setattr(sys, "executable", str(empty_folder / "nobody"))
    assert machine.make() is None
    assert not empty_folder.exists()


def test_without_a_python_to_begin_this_process_compiles(
    empty_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", None)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: pytest.fail("a process was begun"))
    assert machine.make() is not None
    assert len(list(empty_folder.iterdir())) == 1


def test_its_name_says_what_it_was_made_from(monkeypatch: pytest.MonkeyPatch) -> None:
    import llvmlite

    name = machine._name()
    assert name == machine._name()
    monkeypatch.setattr(llvmlite, "__version__", "0.0")
    assert machine._name() != name
