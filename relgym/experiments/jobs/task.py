"""A task: a function of relgym's, by name, and its arguments; its key says all that its result depends on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from time import perf_counter
from typing import Any

from relgym.errors import ConfigError
from relgym.experiments.jobs.code import code_version

__all__ = ["Task", "canonical"]


@dataclass(frozen=True)
class Task:
    """A unit of work whose result is plain data.

    Parameters
    ----------
    function
        ``"package.module:name"`` of a function that takes the arguments by keyword and returns plain data (what JSON
        can hold). Everything random in it follows from seeds among the arguments.
    arguments
        Plain data.
    kind
        What it has in common with others that take about as long; for the estimate of the remaining time.
    without
        Modules and packages that it imports and of which it runs nothing (`relgym.experiments.jobs.code.LEARNER`): a
        change of those leaves its result as it is.
    """

    function: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    kind: str = ""
    without: tuple[str, ...] = ()

    def __hash__(self) -> int:
        return hash(self.key)

    @cached_property
    def key(self) -> str:
        """Hexadecimal digest of function, arguments and the version of all code behind them."""
        content = [self.function, self.arguments, self.version]
        return hashlib.sha256(canonical(content).encode()).hexdigest()

    @property
    def version(self) -> str:
        """Hexadecimal digest of the code behind it."""
        return code_version(self._module, self.without)

    @property
    def name(self) -> str:
        """Name of the function alone."""
        return self.function.rpartition(":")[2]

    @property
    def _module(self) -> str:
        module, colon, name = self.function.partition(":")
        if not (colon and module and name):
            raise ConfigError(f"task function {self.function!r}: expected 'package.module:name'")
        return module

    def run(self) -> tuple[Any, float]:
        """The function's result and how many seconds it took, with one thread, wherever it runs.

        Results must not depend on how many threads a machine's linear algebra happens to use.
        """
        from threadpoolctl import threadpool_limits

        function = getattr(import_module(self._module), self.name)
        start = perf_counter()
        with threadpool_limits(1):
            # Through JSON and back: a result is the same whether it was just computed or read from the store.
            value = json.loads(canonical(function(**self.arguments)))
        return value, perf_counter() - start


def canonical(data: Any) -> str:
    """The one JSON text of plain data; raises `ConfigError` for anything else."""
    try:
        return json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    except TypeError as error:
        raise ConfigError(f"tasks take and return plain data (what JSON can hold): {error}") from error
