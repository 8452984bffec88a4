"""The architecture as tests: who may import whom (docs/architecture.md), and what the wheel holds."""

from __future__ import annotations

import ast
import importlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import TypeGuard

import pytest
from source_tree import FOLDERS, ROOT, Import, Module, modules, package_of

FOUNDATION = frozenset(
    {"errors", "arguments", "config", "files", "html", "hypotheses", "mixing", "scheduling"}
)
ENGINES = FOUNDATION | {"scene", "numeric", "logic"}
LEARNERS = ENGINES | {"clustering", "classification", "laws"}
CORE = LEARNERS | {"reporting", "program", "model"}

MAY_IMPORT = {
    "errors": frozenset(),
    "arguments": frozenset({"errors"}),
    "config": frozenset({"errors", "arguments"}),
    "files": frozenset({"errors"}),
    "html": frozenset(),
    "hypotheses": frozenset({"errors", "arguments"}),
    "mixing": frozenset(),
    "scheduling": frozenset(),
    "scene": FOUNDATION,
    "numeric": FOUNDATION,
    "logic": FOUNDATION,
    "clustering": ENGINES,
    "classification": ENGINES,
    "laws": ENGINES | {"clustering"},
    "reporting": ENGINES | {"clustering", "laws"},
    "program": frozenset({"errors"}),
    "model": LEARNERS | {"program", "reporting"},
    "thesis": CORE,
    "baselines": CORE | {"thesis"},
    "envs": CORE,
    "wrappers": CORE | {"envs"},
    "data": CORE | {"envs", "wrappers"},
    "planning": CORE | {"envs", "wrappers"},
    "experiments": CORE | {"baselines", "data", "envs", "planning", "thesis", "wrappers"},
    "console": CORE | {"data", "envs", "wrappers", "experiments"},
    "cli": CORE | {"baselines", "data", "envs", "wrappers", "experiments", "console"},
    "__main__": frozenset({"cli"}),
}
"""Other packages each package may import; a line here is a decision about the design, not a way to pass."""

FACADE_USERS = frozenset({"experiments", "console", "cli"})
"""Packages that may `import relgym` itself: those above everything that the façade offers."""

CORE_LIBRARIES = frozenset({"msgspec", "numpy", "scipy"})
FCL = "relgym.scene.geometry.fcl"
"""The only module that may import python-fcl."""
MACHINE = "relgym.program.machine"
"""The only module that may import llvmlite."""
GPU = "relgym.program.gpu"
"""The only module that may import CuPy."""
ALONE = (("fcl", FCL), ("llvmlite", MACHINE), ("cupy", GPU))

HEAVY = (
    "cupy",
    "fcl",
    "llvmlite",
    "matplotlib",
    "msgspec",
    "pygame",
    "pymunk",
    "scipy.spatial",
    "sklearn",
    "stable_baselines3",
    "torch",
)
"""What a bare `import relgym` must not load: each costs tenths of a second or more."""

WORLD_WORDS = frozenset(
    {"ball", "ceiling", "elasticity", "floor", "force", "friction", "ramp", "truck", "vx", "vy", "vz", "wall"}
)
"""Names of the two worlds' objects and properties; a learner that knows one has peeked."""


def _packages() -> list[str]:
    return sorted({module.package for module in modules()} - {""})


@pytest.mark.parametrize("package", _packages())
def test_packages_import_only_what_lies_below(package: str) -> None:
    assert package in MAY_IMPORT, f"relgym.{package} has no line in MAY_IMPORT: decide what lies below it"
    wrong = [
        _sentence(m, i) for m in modules() if m.package == package for i in m.imports if _upward(package, i)
    ]
    below = ", ".join(sorted(MAY_IMPORT[package])) or "nothing"
    assert not wrong, f"relgym.{package} may import of relgym only: {below}\n" + "\n".join(wrong)


def test_no_imports_in_a_circle() -> None:
    names = {module.name for module in modules()}
    needs = {m.name: sorted({_module_of(i, names) for i in m.needed} - {m.name, ""}) for m in modules()}
    circle = _circle(needs)
    assert not circle, "modules import one another, inside functions or not: " + " -> ".join(circle)


def test_circles_are_found() -> None:
    assert _circle({"a": ["b", "c"], "b": ["c"], "c": []}) == []
    assert _circle({"a": ["b"], "b": ["c", "d"], "c": [], "d": ["b"]}) == ["b", "d", "b"]


def test_no_relative_imports() -> None:
    wrong = [_sentence(m, i) for m in modules() for i in m.imports if i.target.startswith(".")]
    assert not wrong, "write the whole name: envs/ and wrappers/ are packages of relgym\n" + "\n".join(wrong)


def test_nobody_imports_from_the_root() -> None:
    top = {"envs", "wrappers", "tests", "examples"}
    wrong = [_sentence(m, i) for m in modules() for i in m.imports if i.target.split(".")[0] in top]
    assert not wrong, "import relgym.envs, relgym.wrappers; never tests or examples\n" + "\n".join(wrong)


def test_the_core_needs_five_libraries_alone() -> None:
    wrong = [
        _sentence(m, i)
        for m in modules()
        if m.package in CORE
        for i in m.imports
        if _third_party(i) and (m.name, _distribution(i)) not in {(user, library) for library, user in ALONE}
    ]
    assert not wrong, f"only {sorted(CORE_LIBRARIES)}, and {dict(ALONE)}\n" + "\n".join(wrong)


@pytest.mark.parametrize(("library", "user"), ALONE)
def test_only_one_module_imports(library: str, user: str) -> None:
    users = {module.name for module in modules() if any(_distribution(i) == library for i in module.imports)}
    assert users == {user}


def test_the_core_knows_no_world_by_name() -> None:
    wrong = [
        f"{module.file}:{node.lineno} holds {node.value!r}"
        for module in modules()
        if module.package in CORE
        for node in _strings_but_docstrings(module.tree)
        if node.value in WORLD_WORDS
    ]
    assert not wrong, "the core may not test an object's, type's or property's name\n" + "\n".join(wrong)


def test_adapters_with_pins_of_their_own_get_the_libraries_that_models_need() -> None:
    # numpy comes with the emulator; the ball's engine isn't asked for.
    every = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    needed = {re.split(r"[<>=~!]", each)[0] for each in every}
    _, _, rest = (
        (ROOT / "Makefile").read_text(encoding="utf-8").partition("$(VENV)-ocatari/.installed: pyproject")
    )
    rule = rest.partition("\n\n")[0]
    assert "--no-deps" in rule
    missing = {
        name for name in needed - {"numpy", "pymunk"} if not re.search(rf"[ ']{re.escape(name)}\b", rule)
    }
    assert not missing, f"add to what example-ocatari installs: {sorted(missing)}"


def test_every_package_on_disk_is_installed() -> None:
    declared = _pyproject()["tool"]["setuptools"]["packages"]
    on_disk = {module.name for module in modules() if module.is_package}
    # A package that pyproject.toml forgets works in the editable install and is missing from the wheel.
    assert not (new := on_disk - set(declared)), f"add to pyproject.toml's packages: {sorted(new)}"
    assert not (gone := set(declared) - on_disk), f"take out of pyproject.toml's packages: {sorted(gone)}"
    assert len(declared) == len(on_disk), "a package is listed twice"


def test_every_module_lies_in_a_package() -> None:
    bare = sorted({m.path.parent for m in modules() if not (m.path.parent / "__init__.py").is_file()})
    assert not bare, f"folders without __init__.py are left out of the wheel: {[str(path) for path in bare]}"


def test_tests_do_not_shadow_the_package() -> None:
    assert not (ROOT / "tests" / "relgym").exists(), (
        "mirror relgym/ in tests/ itself: tests/relgym would shadow the package"
    )


def test_import_is_light(tmp_path: Path) -> None:
    code = f"import relgym, sys; print([name for name in {HEAVY!r} if name in sys.modules])"
    assert _python(code, cwd=tmp_path).stdout.strip() == "[]"


@pytest.mark.parametrize("name", ["envs", "wrappers"])
def test_second_copies_refuse_to_be_imported(name: str) -> None:
    run = _python(f"import {name}", cwd=ROOT)
    assert run.returncode == 1
    assert f"relgym.{name}" in run.stderr.splitlines()[-1]


def test_a_checkout_that_shadows_the_wheel_is_whole() -> None:
    # -S: no editable install, so that ./relgym is all there is, as when a wheel is installed elsewhere.
    libraries = os.pathsep.join(path for path in sys.path if Path(path).name == "site-packages")
    code = "import relgym.envs, relgym.wrappers; print(relgym.envs.__file__, relgym.wrappers.__file__)"
    run = _python(code, "-S", cwd=ROOT, PYTHONPATH=libraries)
    found = [Path(file).resolve() for file in run.stdout.split()]
    assert found == [FOLDERS[p] / "__init__.py" for p in ("relgym.envs", "relgym.wrappers")]


@pytest.mark.parametrize("package", ["envs", "wrappers"])
def test_mypy_sees_what_is_wrong(package: str, tmp_path: Path) -> None:
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for folder in ("relgym", "envs", "wrappers"):
        (tmp_path / folder).mkdir()
        planted = 'number: int = "text"\n' if folder == package else ""
        (tmp_path / folder / "__init__.py").write_text(planted)
    for link in ("envs", "wrappers"):
        (tmp_path / "relgym" / link).symlink_to((ROOT / "relgym" / link).readlink())
    run = subprocess.run(
        [sys.executable, "-m", "mypy"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert f"{package}/__init__.py:1: error: Incompatible types in assignment" in run.stdout, (
        run.stdout + run.stderr
    )
    assert "Found 1 error in 1 file (checked 3 source files)" in run.stdout


def test_installing_the_checkout_puts_one_package_on_the_path() -> None:
    assert _pyproject()["tool"]["setuptools"]["package-dir"] == {"": "src"}
    assert [path.name for path in (ROOT / "src").iterdir() if path.suffix != ".egg-info"] == ["relgym"]
    for name, folder in FOLDERS.items():
        assert (ROOT / "src").joinpath(*name.split(".")).resolve() == folder


@pytest.mark.parametrize("package", ["relgym", "relgym.envs", "relgym.wrappers", "relgym.wrappers.sb3"])
def test_type_checkers_see_every_name_that_is_loaded_on_first_use(package: str) -> None:
    (facade,) = [module for module in modules() if module.name == package]
    (seen,) = [node for node in facade.tree.body if _for_checkers(node)]
    loaded = {
        alias.name: line.module
        for line in seen.body
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }
    told = vars(importlib.import_module(package))
    homes = told.get("_HOMES") or told["_LAZY_NAMES"] | dict.fromkeys(told["_LAZY_MODULES"], "relgym")
    assert loaded == homes
    assert loaded.keys() == set(told["__all__"]) - {"__version__"}


def _for_checkers(node: ast.stmt) -> TypeGuard[ast.If]:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def _upward(package: str, found: Import) -> bool:
    if _distribution(found) != "relgym":
        return False
    target = package_of(found.target)
    if target not in MAY_IMPORT:  # `import relgym`, or a name of the façade
        return package not in FACADE_USERS
    return target != package and target not in MAY_IMPORT[package]


def _module_of(found: Import, names: set[str]) -> str:
    """The module of relgym that an import reads: that of a name in it, too; empty for other libraries."""
    if found.target in names:
        return found.target
    parent = found.target.rpartition(".")[0]
    return parent if parent in names else ""


def _circle(needs: dict[str, list[str]]) -> list[str]:
    """A way from a module back to itself, along what each needs; empty where there is none."""
    sorter = TopologicalSorter(needs)
    try:
        sorter.prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))  # each is needed by the next one there
    return []


def _third_party(found: Import) -> bool:
    return _distribution(found) not in {"relgym", *CORE_LIBRARIES, *sys.stdlib_module_names}


def _distribution(found: Import) -> str:
    return found.target.split(".")[0]


def _sentence(module: Module, found: Import) -> str:
    return f"{module.file}:{found.line} imports {found.target}"


def _strings_but_docstrings(tree: ast.Module) -> Iterator[ast.Constant]:
    prose = {node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in prose:
            yield node


def _pyproject() -> dict[str, dict[str, dict[str, list[str]]]]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def _python(code: str, *options: str, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *options, "-c", code]
    environ = os.environ | variables
    return subprocess.run(command, cwd=cwd, env=environ, capture_output=True, text=True, check=False)
