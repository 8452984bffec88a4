"""Writing a file so that whatever happens, the old one or the new one is there, whole.

The bytes go to a temporary file in the same folder, which then takes the other one's name. Temporary files that a
killed process left behind are removed by the next one that writes the same file: whoever writes holds a lock on its
temporary file, and a lock ends with its process, however that dies.
"""

from __future__ import annotations

import errno
import os
import secrets
import stat
import zlib
from contextlib import suppress
from pathlib import Path

from relgym.errors import RelgymError

__all__ = ["write_whole"]

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.EINVAL, errno.ENOSYS)
_STEM = 60
"""Leading characters of a file's name that its temporary files bear: names have at most 255 bytes."""


def write_whole(path: str | os.PathLike[str], data: bytes, *, error: type[RelgymError]) -> None:
    """Write a file; a kill at any moment, or a full disk, leaves the old or the new file whole.

    A symbolic link is followed: what it points to is written. An existing file keeps its mode bits, a new one has
    those that the umask leaves. Two processes may write the same file: the last one to finish wins. File and folder
    are synced, so what was written survives a power cut.

    Parameters
    ----------
    path
        Where to write.
    data
        The whole content.
    error
        What to raise.

    Raises
    ------
    RelgymError
        Of the kind asked for: no such folder, no permission, no space left, or the path is that of a folder or of a
        special file (a pipe, a device, a socket). What was there before is untouched.
    """
    try:
        target = Path(os.path.realpath(path))
        mode = _mode_of(target, path, error)
        _clean(target)
        handle, temporary = _temporary(target)
        try:
            with os.fdopen(handle, "wb") as file:
                if mode is not None:
                    os.fchmod(file.fileno(), mode)
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
                os.replace(temporary, target)  # while the lock is held: nobody takes it for a leftover
        except BaseException:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise
        _sync(target.parent)
    except RelgymError:
        raise
    except (OSError, ValueError) as problem:  # ValueError: a null byte in the path
        raise error(f"{path} can't be written {_why(problem)}") from problem


def _why(problem: OSError | ValueError) -> str:
    if isinstance(problem, OSError) and problem.errno in _FULL:
        return f"(no space left: {problem.strerror}): make room, or choose a path on another disk, and write again"
    said = getattr(problem, "strerror", None) or str(problem)
    return f"({said}): expected a path in a folder that exists and may be written to"


def _mode_of(target: Path, path: str | os.PathLike[str], error: type[RelgymError]) -> int | None:
    """Mode bits of the file that is there, None if there is none; raises unless it may be replaced."""
    try:
        found = os.stat(target)
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(found.st_mode):
        raise error(f"{path} is a folder: expected the path of a file")
    if not stat.S_ISREG(found.st_mode):
        raise error(
            f"{path} is a special file (a pipe, a device or a socket): expected the path of a plain file"
        )
    if not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, "the file that is there is write-protected")
    return stat.S_IMODE(found.st_mode)


# ---------------------------------------------------------------------- temporary files
def _prefix(target: Path) -> str:
    return f".{target.name[:_STEM]}.{zlib.crc32(os.fsencode(target.name)):08x}."


def _temporary(target: Path) -> tuple[int, Path]:
    """A new file beside the target, open for writing and locked."""
    while True:
        path = target.with_name(f"{_prefix(target)}{secrets.token_hex(6)}.tmp")
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0), 0o666)
        try:
            _lock(handle, wait=True)
            # Before it was locked somebody who cleans up may have taken it for a leftover.
            if os.path.exists(path) and os.path.samestat(os.stat(path), os.fstat(handle)):
                return handle, path
            os.close(handle)
        except BaseException:
            os.close(handle)
            with suppress(OSError):
                path.unlink(missing_ok=True)
            raise


def _clean(target: Path) -> None:
    """Remove temporary files of this target that nobody is writing any more."""
    prefix = _prefix(target)
    with suppress(OSError):
        names = [entry.name for entry in os.scandir(target.parent) if entry.name.startswith(prefix)]
        for name in names:
            if name.endswith(".tmp"):
                _remove_leftover(target.with_name(name))


def _remove_leftover(path: Path) -> None:
    with suppress(OSError):
        handle = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
        try:
            if _lock(handle, wait=False):
                path.unlink(missing_ok=True)
        finally:
            os.close(handle)


def _lock(handle: int, *, wait: bool) -> bool:
    """Lock an open file; whether that worked. Where there are no locks, nothing is ever taken for a leftover."""
    try:
        import fcntl  # not on every platform
    except ImportError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError as problem:
        if wait and problem.errno not in _NO_LOCKS:
            raise
        return False
    return True


def _sync(folder: Path) -> None:
    """Have the folder's entries on the disk; some file systems can't, and need no telling."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as problem:
        if problem.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.EACCES):
            raise
    finally:
        os.close(handle)
