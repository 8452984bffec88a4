"""The same results on clusters as here; each test starts one of two workers on this machine."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import pytest

from relgym.errors import ClusterError
from relgym.experiments.jobs.run import results, run
from relgym.experiments.jobs.store import ResultStore
from relgym.experiments.jobs.task import Task

TASKS = [
    Task(
        "relgym.experiments.chapter4.lesson:lesson",
        {
            "learner": learner,
            "experiment": 1,
            "seed": 100,
            "order": 0,
            "checkpoints": [1, 2],
            "tests": {"seeds": [110], "episodes": 2},
        },
    )
    for learner in ("world", "default")
]


def _values(folder: Path, **options: Any) -> list[Any]:
    store = ResultStore(folder)
    list(run(TASKS, store, **options))
    return [{**value, "seconds": None, "bytes": None} for value in results(TASKS, store)]


@pytest.mark.cluster
@pytest.mark.filterwarnings("ignore")  # theirs, not ours
def test_one_process_two_processes_dask_and_ray_agree(tmp_path: Path) -> None:
    here = _values(tmp_path / "one", workers=1)
    assert _values(tmp_path / "two", workers=2) == here
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None) as started:
        address = started.scheduler_address
        assert _values(tmp_path / "dask", backend="dask", address=address) == here
    ray = pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    started = Cluster(initialize_head=True, head_node_args={"num_cpus": 2, "include_dashboard": False})
    try:
        assert _values(tmp_path / "ray", backend="ray", address=started.address) == here
    finally:
        ray.shutdown()
        started.shutdown()


@pytest.mark.cluster
@pytest.mark.parametrize("backend", ["dask", "ray"])
def test_nobody_answers(backend: str, tmp_path: Path) -> None:
    pytest.importorskip({"dask": "distributed"}.get(backend, backend))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(
            ClusterError, match=r"answers at '127.0.0.1:9'.* start the cluster, or check --address"
        ):
            list(run(TASKS, ResultStore(tmp_path), backend=backend, address="127.0.0.1:9"))
    assert not list(tmp_path.iterdir())
