"""What `relgym reproduce` does, without the terminal's part: its options as a record, its steps as an iterator."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from relgym.experiments.benchmark import Made
from relgym.experiments.chapter4.catalogue import JOBS, chosen
from relgym.experiments.chapter4.job import Job
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.reproduce import compute, make
from relgym.experiments.jobs.run import Progress
from relgym.experiments.jobs.store import ResultStore

__all__ = ["Request", "listing", "remaining", "reproduce"]


@dataclass(frozen=True, slots=True)
class Request:
    """Which jobs to run, how thoroughly, and where.

    Attributes
    ----------
    names
        Jobs or groups of jobs.
    out
        Folder for what they show; results are kept in ``cache`` below it.
    batches, fast
        Size of the protocol; without `batches`, 50, or 2 where it is fast.
    workers, backend, address
        Where to compute (`relgym.experiments.jobs.run.run`).
    """

    names: tuple[str, ...]
    out: Path
    batches: int | None = None
    fast: bool = False
    workers: int | None = None
    backend: str = "local"
    address: str | None = None

    @property
    def jobs(self) -> list[Job]:
        """The jobs asked for; `ConfigError` for a name that is none."""
        return chosen(self.names)

    @property
    def protocol(self) -> Protocol:
        """How thoroughly."""
        if self.fast:
            return Protocol.fast(2 if self.batches is None else self.batches)
        return Protocol.thesis(50 if self.batches is None else self.batches)

    def command(self, name: str) -> str:
        """The command that makes one of the jobs as this request does."""
        parts = ["relgym", "reproduce", name]
        parts += [] if self.batches is None else ["--batches", str(self.batches)]
        return shlex.join([*parts, *(["--fast"] if self.fast else [])])


def reproduce(request: Request) -> Iterator[Progress | Made]:
    """Compute what is missing, then make every table and figure; progress and outputs as they come."""
    jobs, protocol, store = request.jobs, request.protocol, ResultStore(request.out / "cache")
    where = {"workers": request.workers, "backend": request.backend, "address": request.address}
    yield from compute(jobs, protocol, store, **where)
    for job in jobs:
        yield make(job, protocol, store, request.out, request.command(job.name))


def listing() -> dict[str, str]:
    """Caption and section of every job, by name."""
    return {name: f"{job.title} ({job.source}; {', '.join(job.groups)})" for name, job in JOBS.items()}


def remaining(progress: Progress) -> str:
    """Remaining time in words that claim no more than is known."""
    if progress.done == progress.total:
        return "done"
    if progress.seconds_left is None:
        return "no task timed yet"
    minutes = progress.seconds_left / 60.0
    words = f"{progress.seconds_left:.0f} s" if minutes < 1.5 else f"{minutes:.0f} min"
    doubt = f", {progress.guessed} tasks of kinds not timed yet" if progress.guessed else ""
    return f"at most about {words} left{doubt}" if not doubt else f"about {words} left{doubt}"
