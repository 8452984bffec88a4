from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest

from relgym.errors import StoreError
from relgym.experiments.jobs.store import Result, ResultStore, write_atomically
from relgym.experiments.jobs.task import Task

TASK = Task("statistics:fmean", {"data": [1.0, 2.0]})


def test_what_is_put_is_got(tmp_path: Path) -> None:
    store = ResultStore(tmp_path / "new")
    assert store.get(TASK) is None
    store.put(TASK, Result({"rate": 0.1 + 0.2}, 3.5))
    assert store.get(TASK) == Result({"rate": 0.1 + 0.2}, 3.5)
    assert store.get(Task("statistics:fmean", {"data": [1.0, 3.0]})) is None


@pytest.mark.parametrize("damage", ["cut", "edited", "empty", "list", "renamed"])
def test_a_damaged_entry_is_named_and_never_taken(tmp_path: Path, damage: str) -> None:
    store = ResultStore(tmp_path)
    store.put(TASK, Result(0.5, 1.0))
    path = store.path(TASK)
    text = path.read_text()
    other = json.loads(text) | {"key": "0" * 64}
    texts = {
        "cut": text[:-9],
        "edited": text.replace('"value":0.5', '"value":0.6'),
        "empty": "",
        "list": "[]",
        "renamed": json.dumps(other),
    }
    path.write_text(texts[damage])
    with pytest.raises(StoreError, match=rf"{path.name} is damaged: .*; delete it, and it is computed again"):
        store.get(TASK)


@pytest.mark.parametrize("failing", ["fsync", "replace"])
def test_no_space_left_leaves_nothing_half_written(
    tmp_path: Path, failing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "result.json"
    write_atomically(path, b"old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, failing, full)
    with pytest.raises(
        StoreError, match=r"no space left: .* make room, or choose a path on another disk, and write again"
    ):
        write_atomically(path, b"new")
    assert [p.name for p in tmp_path.iterdir()] == ["result.json"]
    assert path.read_bytes() == b"old"


def test_a_file_in_the_way_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(StoreError, match=r"can't be made .* choose another folder with --out"):
        ResultStore(tmp_path / "taken").put(TASK, Result(1, 1.0))
