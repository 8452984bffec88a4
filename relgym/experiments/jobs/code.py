"""Which code does a result depend on? A digest of a module and of all of relgym that it imports, step by step."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from relgym.errors import ConfigError

__all__ = ["LEARNER", "code_version", "modules_behind"]

_PACKAGE: Final = "relgym"

_LIBRARIES: Final = {
    "fcl": "python-fcl",
    "numpy": "numpy",
    "pymunk": "pymunk",
    "river": "river",
    "scipy": "scipy",
    "sklearn": "scikit-learn",
    "torch": "torch",
}
"""Libraries that results depend on: import name and distribution."""

LEARNER: Final = (
    "relgym.classification",
    "relgym.clustering.columns",
    "relgym.clustering.population",
    "relgym.clustering.roles",
    "relgym.envs.dreams",
    "relgym.envs.model_files",
    "relgym.laws",
    "relgym.logic",
    "relgym.model.predicting.calibration",
    "relgym.model.learning.transition",
    "relgym.model.parts",
    "relgym.model.percepts.perception",
    "relgym.model.reports.advice",
    "relgym.model.reports.distant",
    "relgym.model.reports.report",
    "relgym.model.target",
    "relgym.model.world_model",
    "relgym.program",
    "relgym.thesis.files",
)
"""Modules and packages of relgym's own learner, and of files: other learners are imported beside them and run none of
their functions. `tests/experiments/chapter4/test_apart.py` looks at what is run."""


@cache
def code_version(module: str, without: tuple[str, ...] = ()) -> str:
    """Hexadecimal digest of the code behind a module, and of the versions of the libraries that they import.

    A change anywhere else leaves it as it is (what draws a figure isn't what measured it), and so does one of comments
    and docstrings.

    Parameters
    ----------
    module
        Its name.
    without
        As of `modules_behind`.

    Raises
    ------
    ConfigError
        There is no such module.
    """
    digest = hashlib.sha256()
    libraries: set[str] = set()
    for name in modules_behind(module, without):
        digest.update(f"{name} {_content(name)}\n".encode())
        libraries |= {found.split(".")[0] for found in _imports(name)} & _LIBRARIES.keys()
    for library in sorted(libraries):
        digest.update(f"{library} {_version(_LIBRARIES[library])}\n".encode())
    return digest.hexdigest()


def modules_behind(module: str, without: tuple[str, ...] = ()) -> tuple[str, ...]:
    """The module itself and every module of relgym that it imports, directly or not, sorted by name.

    Imports inside functions count.

    Parameters
    ----------
    module
        Its name.
    without
        Modules and packages of which nothing is run, though they are imported; what only they import is left out, too.

    Raises
    ------
    ConfigError
        There is no such module.
    """
    if _source(module) is None:
        raise ConfigError(f"no module {module!r} to take the version of")
    known: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in known:
            continue
        known.add(name)
        waiting += [
            found
            for found in _imports(name)
            if found.split(".")[0] == _PACKAGE
            and not any(f"{found}.".startswith(f"{each}.") for each in without)
            and _source(found) is not None
        ]
    return tuple(sorted(known))


@cache
def _imports(module: str) -> frozenset[str]:
    """Dotted names that a module imports, and those of what it takes from them: modules, or names in them."""
    return frozenset(_found(ast.parse(_source(module) or b"")))


@cache
def _content(module: str) -> str:
    """Digest of a module's code; cached, for most modules are behind several others."""
    return hashlib.sha256(ast.dump(_bare(module)).encode()).hexdigest()


def _bare(module: str) -> ast.Module:
    """A module without docstrings and other strings that nothing is done with."""
    tree = ast.parse(_source(module) or b"")
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [line for line in node.body if not _idle(line)] or [ast.Pass()]
    return tree


def _idle(line: ast.stmt) -> bool:
    return (
        isinstance(line, ast.Expr)
        and isinstance(line.value, ast.Constant)
        and isinstance(line.value.value, str)
    )


def _found(tree: ast.Module) -> Iterator[str]:
    for node in _run(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _run(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those that only type checkers see: a package that loads its names on first use lists them all."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            for line in node.orelse:
                yield line
                yield from _run(line)
            continue
        yield node
        yield from _run(node)


@cache
def _source(module: str) -> bytes | None:
    """Text of a module's file; none if there is no such module."""
    try:
        spec = find_spec(module)
    except (ModuleNotFoundError, ValueError):  # the parent is no package, or no module at all
        return None
    return None if spec is None or spec.origin is None else Path(spec.origin).read_bytes()


def _version(distribution: str) -> str:
    """The installed version, or else the one that a checkout pins: a page is as old wherever it is looked at."""
    try:
        return version(distribution).partition("+")[0]  # of PyTorch's builds any
    except PackageNotFoundError:
        return _pinned().get(distribution, "none")


@cache
def _pinned() -> Mapping[str, str]:
    """Versions in ``constraints.txt``, by distribution; empty away from a checkout."""
    file = Path(__file__).resolve().parents[3] / "constraints.txt"
    lines = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
    return {name: number for name, found, number in (line.partition("==") for line in lines) if found}
