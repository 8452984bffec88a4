"""Running tasks: here, in several processes, or on a cluster that is already there."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from relgym.errors import ConfigError, StoreError
from relgym.experiments.jobs.clusters import STREAMING, cluster
from relgym.experiments.jobs.pace import Pace
from relgym.experiments.jobs.store import Result, ResultStore
from relgym.experiments.jobs.task import Task

__all__ = ["Progress", "require_joblib", "results", "run"]


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a run stands.

    Attributes
    ----------
    task
        The task that was just finished.
    done, total
        Tasks finished and tasks in all, those that were found in the store included.
    reused
        How many were found in the store.
    seconds_left
        Estimate; none as long as nothing has been timed.
    guessed
        How many of the waiting tasks are of a kind that hasn't been timed.
    """

    task: Task | None
    done: int
    total: int
    reused: int
    seconds_left: float | None
    guessed: int


def run(
    tasks: Sequence[Task],
    store: ResultStore,
    *,
    workers: int | None = None,
    backend: str = "local",
    address: str | None = None,
) -> Iterator[Progress]:
    """Compute every result that isn't in the store yet; each one is kept as soon as it is there.

    Parameters
    ----------
    tasks
        What to compute; the same task twice is computed once.
    store
        Where results are kept. An interrupted run picks up where it was.
    workers
        Processes on this machine, at least 1; default: one per core. A cluster uses all it has.
    backend
        ``"local"``, ``"dask"`` or ``"ray"``.
    address
        Where the cluster's scheduler listens.

    Yields
    ------
    Where the run stands: at the beginning, then after every task.

    Raises
    ------
    StoreError
        An entry is damaged, or a result can't be kept.
    ClusterError
        The cluster can't be reached.
    ConfigError
        An unknown backend, or a library that isn't installed.
    """
    chosen = workers or os.cpu_count() or 1
    distinct = list(dict.fromkeys(tasks))
    known = {task: found for task in distinct if (found := store.get(task)) is not None}
    waiting = [task for task in distinct if task not in known]
    pace = Pace(waiting, chosen)
    for task, found in known.items():
        pace.learn(task, found.seconds)
    done = len(known)

    def standing(task: Task | None) -> Progress:
        return Progress(task, done, len(distinct), len(known), pace.left(), pace.guessed)

    yield standing(None)
    for task, result in _computed(waiting, chosen, backend, address):
        store.put(task, result)
        pace.took(task, result.seconds)
        done += 1
        yield standing(task)


def results(tasks: Sequence[Task], store: ResultStore) -> list[Any]:
    """Values of tasks that have been run, in their order; `StoreError` where one is missing."""
    values = []
    for task in tasks:
        found = store.get(task)
        if found is None:
            raise StoreError(f"{store.path(task)}: no result yet; run the task first")
        values.append(found.value)
    return values


def require_joblib() -> None:
    """Raise `ConfigError`, which says what to install, if joblib is missing."""
    try:
        import joblib  # noqa: F401
        import threadpoolctl  # noqa: F401
    except ImportError:
        raise ConfigError(
            "experiments need joblib and scikit-learn, which are not installed: pip install 'relgym[baselines]'"
        ) from None


def _computed(
    tasks: Sequence[Task], workers: int, backend: str, address: str | None
) -> Iterator[tuple[Task, Result]]:
    """Tasks with their results, as they come."""
    require_joblib()
    with cluster(backend, address, workers) as jobs:
        if backend == "local" and (jobs == 1 or len(tasks) <= 1):
            yield from map(_compute, tasks)
            return
        yield from _streamed(tasks, jobs) if backend in STREAMING else _in_rounds(tasks, jobs)


def _streamed(tasks: Sequence[Task], jobs: int) -> Iterator[tuple[Task, Result]]:
    """Results in the order in which they come."""
    import joblib

    parallel = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
    yield from parallel(joblib.delayed(_compute)(task) for task in tasks)


def _in_rounds(tasks: Sequence[Task], jobs: int) -> Iterator[tuple[Task, Result]]:
    """Results round by round, as many tasks in each as there are workers: what is done is kept before all is done."""
    import joblib

    each = max(1, joblib.effective_n_jobs(jobs))
    for k in range(0, len(tasks), each):
        yield from joblib.Parallel(n_jobs=jobs, batch_size=1)(
            joblib.delayed(_compute)(task) for task in tasks[k : k + each]
        )


def _compute(task: Task) -> tuple[Task, Result]:
    value, seconds = task.run()
    return task, Result(value, seconds)
