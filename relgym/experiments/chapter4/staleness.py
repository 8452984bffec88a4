"""Is a page of results older than the code? Every section states a digest of the code that made it.

A change of the learner makes sections old; making all of them anew takes hours. So a page may be older, but only
if it says so at its top: `problem` names the sections that are, and `declared` writes the line. ::

    python -m relgym.experiments.chapter4.staleness docs/results.md          # which sections are old
    python -m relgym.experiments.chapter4.staleness docs/results.md --mark   # and say so at the page's top
"""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Final

from relgym.experiments.chapter4.catalogue import JOBS
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.jobs.code import code_version
from relgym.experiments.jobs.store import write_atomically

__all__ = ["OLDER", "declared", "digest_of", "outdated", "problem", "stamped"]

OLDER: Final = "**Older than the code.**"
"""How a page begins to say that it is."""

_SECTION: Final = re.compile(r"^## ([a-z]+(?:-\d[\d.]*)?): .*$", re.MULTILINE)
_STAMP: Final = re.compile(r"; code `([0-9a-f]{12})`")


@cache
def digest_of(name: str) -> str:
    """Twelve hexadecimal digits of the code behind a section: all that its tasks import, or else what draws it.

    Parameters
    ----------
    name
        Of a job, such as ``"table-4.2"``.
    """
    job = JOBS[name]
    show = getattr(job.show, "func", job.show)
    tasks = [task for group in job.plan(Protocol.fast(1)).values() for task in group]
    versions = sorted({task.version for task in tasks} or {code_version(show.__module__)})
    return hashlib.sha256(" ".join(versions).encode()).hexdigest()[:12]


def stamped(page: str) -> dict[str, str]:
    """Digest that each section of a page states, by name; empty if it states none."""
    found = {}
    parts = _SECTION.split(page)[1:]
    for name, text in zip(parts[::2], parts[1::2], strict=True):
        stamp = _STAMP.search(text)
        found[name] = stamp.group(1) if stamp else ""
    return found


def outdated(page: str, digests: Mapping[str, str] | None = None) -> list[str]:
    """Sections that were made with other code than there is now, or don't say with which.

    Parameters
    ----------
    page
        Markdown text.
    digests
        The code's, by name of a section; default: `digest_of` each.
    """
    found = []
    for name, stamp in stamped(page).items():
        if name in JOBS and stamp != (digests[name] if digests is not None else digest_of(name)):
            found.append(name)
    return found


def problem(page: str, path: str, digests: Mapping[str, str] | None = None) -> str:
    """What is wrong with a page, and the commands that mend it; empty if nothing is."""
    old = outdated(page, digests)
    if not old or declared(page, old) == page:
        return ""
    return (
        f"{path}: these sections were made with other code than there is now: {', '.join(old)}. Make them anew "
        f"(`relgym reproduce {' '.join(old)} --page {path}`), or say at the page's top that they are older "
        f"(`python -m relgym.experiments.chapter4.staleness {path} --mark`)."
    )


def declared(page: str, old: Sequence[str]) -> str:
    """The page with a line below its title that names the sections that are older than the code; none, no line."""
    title, _, rest = page.partition("\n")
    body = rest.lstrip("\n")
    if body.startswith(OLDER):
        body = body.partition("\n\n")[2]
    if not old:
        return f"{title}\n\n{body}"
    which = "All sections" if len(old) == len(stamped(page)) else ", ".join(old)
    line = f"{OLDER} {which}: made before the code behind them was last changed."
    return f"{title}\n\n{line}\n\n{body}"


def main(arguments: Sequence[str]) -> int:
    """Say which sections of a page are old; with ``--mark``, on the page."""
    (name,) = [a for a in arguments if a != "--mark"]
    path = Path(name)
    page = path.read_text(encoding="utf-8")
    old = outdated(page)
    print("\n".join(old) or "no section is older than the code")
    if "--mark" in arguments:
        write_atomically(path, declared(page, old).encode())
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
