"""Clusters that are already there: joblib's Dask and Ray backends, connected to for as long as a run takes."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from relgym.errors import ClusterError, ConfigError

__all__ = ["BACKENDS", "STREAMING", "cluster"]

BACKENDS: Final = ("local", "dask", "ray")

STREAMING: Final = ("local", "dask")
"""Backends that hand over each result as it comes; joblib's Ray backend hands over all at once."""

_PATIENCE: Final = 10
"""Seconds to wait for a scheduler's answer."""


@contextmanager
def cluster(backend: str, address: str | None, workers: int) -> Iterator[int]:
    """Let joblib run on a cluster inside a ``with`` block; gives how many jobs to ask joblib for.

    Parameters
    ----------
    backend
        One of `BACKENDS`. relgym must be installed on every worker, in the same version.
    address
        Of Dask's scheduler (``tcp://host:8786``) or of Ray's head node (``host:6379``, ``auto``).
    workers
        Processes where the backend is local.

    Raises
    ------
    ConfigError
        An unknown backend, a missing address, or a library that isn't installed.
    ClusterError
        Nothing answers at the address.
    """
    if backend not in BACKENDS:
        raise ConfigError(f"backend {backend!r}: expected one of {BACKENDS}")
    if backend == "local":
        if address is not None:
            raise ConfigError(
                f"address {address!r} without a cluster: choose --backend dask or --backend ray"
            )
        yield workers
        return
    if address is None:
        raise ConfigError(f"backend {backend!r} needs the address of a running cluster: --address HOST:PORT")
    with (_dask if backend == "dask" else _ray)(address):
        yield -1


@contextmanager
def _dask(address: str) -> Iterator[None]:
    joblib, distributed = _library("joblib"), _library("distributed", extra="dask")
    try:
        client = distributed.Client(address, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise _unreachable("Dask scheduler", address, error) from error
    with client, joblib.parallel_config(backend="dask", wait_for_workers_timeout=_PATIENCE):
        yield


@contextmanager
def _ray(address: str) -> Iterator[None]:
    joblib, ray = _library("joblib"), _library("ray", extra="ray")
    _knock(address)
    try:
        ray.init(address=address, log_to_driver=False, logging_level="ERROR")
    except (OSError, ValueError, RuntimeError) as error:
        raise _unreachable("Ray head node", address, error) from error
    try:
        _library("ray.util.joblib", extra="ray").register_ray()
        with joblib.parallel_config(backend="ray"):
            yield
    finally:
        ray.shutdown()


def _knock(address: str) -> None:
    """Raise `ClusterError` if nothing listens; Ray itself would go on asking for a minute, then end the process."""
    host, _, port = address.rpartition(":")
    if not port.isdigit():  # "auto", or a client address: Ray knows where that is
        return
    try:
        socket.create_connection((host, int(port)), timeout=_PATIENCE).close()
    except OSError as error:
        raise _unreachable("Ray head node", address, error) from error


def _library(name: str, extra: str = "baselines") -> Any:
    from importlib import import_module

    try:
        return import_module(name)
    except ImportError:
        raise ConfigError(f"{name} is not installed: pip install 'relgym[{extra}]'") from None


def _unreachable(what: str, address: str, error: Exception) -> ClusterError:
    return ClusterError(
        f"no {what} answers at {address!r} ({error}); start the cluster, or check --address and the network"
    )
