"""Results of tasks in a folder, one file each, named by content and written atomically."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from msgspec import Meta

from relgym.errors import StoreError
from relgym.experiments.jobs.task import Task, canonical
from relgym.files.reading import FileLimits, parse_json, read_bytes
from relgym.files.records import Amount, Record, checked
from relgym.files.writing import write_whole

__all__ = ["Result", "ResultStore", "write_atomically"]

_FORMAT: Final = 1


class Entry(Record):
    """The declared format of a kept result: `digest` is that of the first four fields, `task` is for people."""

    format: Literal[1]
    key: Annotated[str, Meta(min_length=1, max_length=200)]
    seconds: Amount
    value: Any
    digest: Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]
    task: Any = None


@dataclass(frozen=True, slots=True)
class Result:
    """What a task gave.

    Attributes
    ----------
    value
        Plain data.
    seconds
        How long it took to compute.
    """

    value: Any
    seconds: float


class ResultStore:
    """A folder of results; a result that is there need not be computed again.

    Parameters
    ----------
    folder
        Made when the first result is kept. Several programs may share it: files appear whole or not at all.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)

    def path(self, task: Task) -> Path:
        """Where a task's result lies or will lie."""
        return self.folder / task.name / f"{task.key}.json"

    def get(self, task: Task) -> Result | None:
        """The result of a task; none if it hasn't been computed with these arguments and this code.

        Raises
        ------
        StoreError
            The file is damaged, or holds another task's result.
        """
        path = self.path(task)
        if not path.exists():
            return None
        try:
            data = parse_json(read_bytes(path, FileLimits(), error=StoreError), FileLimits())
            entry: Entry = checked(data, Entry, "the entry", error=StoreError)
        except (ValueError, StoreError) as error:
            raise _damaged(path, str(error)) from error
        body = {name: data[name] for name in ("format", "key", "seconds", "value")}
        if entry.digest != _digest(body) or entry.key != task.key:
            raise _damaged(path, "its checksum doesn't fit its content")
        return Result(entry.value, entry.seconds)

    def put(self, task: Task, result: Result) -> None:
        """Keep the result of a task.

        Raises
        ------
        StoreError
            The disk is full, or the folder can't be written to; no part of the entry is left behind.
        """
        body = {"format": _FORMAT, "key": task.key, "seconds": result.seconds, "value": result.value}
        about = {"function": task.function, "arguments": task.arguments}  # for people
        write_atomically(
            self.path(task), canonical({**body, "task": about, "digest": _digest(body)}).encode()
        )


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file so that a kill at any moment leaves the old one or the new one, whole.

    Raises
    ------
    StoreError
        It can't be written: no space left, no permission; the old file, if any, is untouched.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(
            f"{path.parent}: can't be made ({error.strerror or error}); choose another folder with --out"
        ) from error
    write_whole(path, data, error=StoreError)


def _damaged(path: Path, why: str) -> StoreError:
    return StoreError(f"{path} is damaged: {why}; delete it, and it is computed again")


def _digest(body: dict[str, Any]) -> str:
    return hashlib.sha256(canonical(body).encode()).hexdigest()
