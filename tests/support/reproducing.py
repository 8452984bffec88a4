"""A small run of the thesis' experiments that another process can import by name, and that can be killed."""

from __future__ import annotations

from pathlib import Path

from relgym.experiments.chapter4.catalogue import chosen
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.chapter4.reproduce import compute, make
from relgym.experiments.jobs.store import ResultStore

__all__ = ["SMALL", "reproduced"]

SMALL = Protocol(
    batches=1,
    test_episodes=3,
    checkpoints={1: (1,), 2: (1,), 3: (1,)},
    transfer_batches=2,
    trials=2,
)


def reproduced(names: tuple[str, ...], folder: str) -> None:
    """Make some tables and figures in a folder, its cache beside them."""
    out = Path(folder)
    jobs, store = chosen(names), ResultStore(out / "cache")
    list(compute(jobs, SMALL, store, workers=1))
    for job in jobs:
        make(job, SMALL, store, out, f"relgym reproduce {job.name}")
