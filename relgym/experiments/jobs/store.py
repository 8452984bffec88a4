"""Results of tasks in a folder, one file each, named by content and written atomically."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from relgym.errors import StoreError
from relgym.experiments.jobs.task import Task, canonical

__all__ = ["Result", "ResultStore", "write_atomically"]

_FORMAT: Final = 1


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
        try:
            text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError) as error:
            raise _damaged(path, str(error)) from error
        try:
            entry = json.loads(text)
            body = {name: entry[name] for name in ("format", "key", "seconds", "value")}
            digest = entry["digest"]
        except (ValueError, KeyError, TypeError) as error:
            raise _damaged(path, f"not an entry of the store ({error})") from error
        if digest != _digest(body) or body["format"] != _FORMAT or body["key"] != task.key:
            raise _damaged(path, "its checksum doesn't fit its content")
        return Result(body["value"], float(body["seconds"]))

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
    temporary = ""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)  # a temporary file is its owner's alone; a result need not be
        os.replace(temporary, path)
    except OSError as error:
        raise StoreError(_why(path, error)) from error
    finally:
        if temporary:
            with suppress(FileNotFoundError):
                os.unlink(temporary)


def _why(path: Path, error: OSError) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{path}: no space left to keep a result; free some and run the same command again: it resumes"
    return f"{path}: can't be written ({error.strerror or error}); choose another folder with --out"


def _damaged(path: Path, why: str) -> StoreError:
    return StoreError(f"{path} is damaged: {why}; delete it, and it is computed again")


def _digest(body: dict[str, Any]) -> str:
    return hashlib.sha256(canonical(body).encode()).hexdigest()
