"""The source tree as Python sees it once installed: module name → file, and what each module imports."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = {"relgym": ROOT / "relgym", "relgym.envs": ROOT / "envs", "relgym.wrappers": ROOT / "wrappers"}
"""Top-level folder of each package that pyproject.toml maps (`package-dir`)."""


@dataclass(frozen=True)
class Import:
    """One import statement's target: ``relgym.scene.objects.Scene`` for a name, ``numpy`` for a module."""

    target: str
    line: int


@dataclass(frozen=True)
class Module:
    """One file of the package."""

    name: str
    path: Path

    @property
    def package(self) -> str:
        """The part of relgym it belongs to: ``scene`` for relgym.scene.objects; empty for the façade."""
        return package_of(self.name)

    @property
    def file(self) -> str:
        return self.path.relative_to(ROOT).as_posix()

    @property
    def is_package(self) -> bool:
        return self.path.name == "__init__.py"

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.path.read_text(encoding="utf-8"), self.file)

    @cached_property
    def needed(self) -> tuple[Import, ...]:
        """What running it imports, sooner or later: all imports but those for type checkers."""
        typing = {
            id(node)
            for branch in ast.walk(self.tree)
            if isinstance(branch, ast.If) and ast.unparse(branch.test) == "TYPE_CHECKING"
            for statement in branch.body
            for node in ast.walk(statement)
        }
        return tuple(_imports(node for node in ast.walk(self.tree) if id(node) not in typing))

    @cached_property
    def imports(self) -> tuple[Import, ...]:
        """All imports; also those in functions, under TYPE_CHECKING and by `import_module("…")`."""
        return tuple(_imports(ast.walk(self.tree)))


def package_of(name: str) -> str:
    """Second part of a dotted name below relgym; empty for relgym itself."""
    return name.split(".")[1] if "." in name else ""


@cache
def modules() -> tuple[Module, ...]:
    """Every module of the installed package, sorted by name."""
    found = [
        Module(_dotted(package, path.relative_to(folder)), path)
        for package, folder in FOLDERS.items()
        for path in folder.rglob("*.py")
    ]
    return tuple(sorted(found, key=lambda module: module.name))


def _dotted(package: str, relative: Path) -> str:
    parts = relative.with_suffix("").parts
    return ".".join((package, *(parts[:-1] if parts[-1] == "__init__" else parts)))


def _imports(nodes: Iterable[ast.AST]) -> Iterator[Import]:
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (Import(alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            origin = "." * node.level + (node.module or "")
            yield from (Import(f"{origin}.{alias.name}", node.lineno) for alias in node.names)
        elif isinstance(node, ast.Call) and (literal := _imported_by_name(node)):
            yield Import(literal, node.lineno)


def _imported_by_name(call: ast.Call) -> str | None:
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", None)
    if name not in ("import_module", "__import__") or not call.args:
        return None
    first = call.args[0]
    return first.value if isinstance(first, ast.Constant) and isinstance(first.value, str) else None
