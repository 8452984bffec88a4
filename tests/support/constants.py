"""The numbers that the learner was tuned with, counted: `python tests/support/constants.py` lists them."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

from source_tree import Module, modules

PACKAGES = ("classification", "clustering", "hypotheses", "laws", "logic", "model", "numeric", "scheduling")
"""What learns and decides."""

CONFIG = "relgym.config.constants"
"""Where constants belong; what is written there as what it follows from isn't counted."""

LEFT_OUT = ("relgym.model.files", "relgym.model.reports")
"""What checks files and what prints: widths, digits and versions tune nothing."""

PLAIN = frozenset({0, 1, 2, 0.5})
"""Numbers that say nothing by themselves: none, one, both, half. Under a name of their own only none and one do."""


@dataclass(frozen=True)
class Constant:
    """A number in the code.

    Attributes
    ----------
    place
        File and line.
    package
        Part of relgym.
    text
        The statement's first line, or the literal.
    named
        Whether it stands at module level under a name of its own.
    """

    place: str
    package: str
    text: str
    named: bool


def constants() -> tuple[Constant, ...]:
    """All constants of the learner, in the order of the files."""
    return tuple(
        c
        for module in modules()
        if module.name == CONFIG or (module.package in PACKAGES and not module.name.startswith(LEFT_OUT))
        for c in _constants(module)
    )


def counted() -> dict[str, tuple[int, int]]:
    """Constants of each package: named ones, and numbers in the code besides."""
    found = {package: [0, 0] for package in (*PACKAGES, "config")}
    for constant in constants():
        found[constant.package][0 if constant.named else 1] += 1
    return {package: (named, inline) for package, (named, inline) in found.items()}


def _constants(module: Module) -> Iterator[Constant]:
    for statement in module.tree.body:
        if names := _names(statement):
            sizes = {abs(number.value) for number in _numbers(statement)}
            if sizes - (PLAIN if _follows(statement) else {0, 1}):
                for name in names:
                    yield Constant(f"{module.file}:{statement.lineno}", module.package, name, named=True)
            continue
        for node in _numbers(statement):
            if abs(node.value) not in PLAIN:
                yield Constant(f"{module.file}:{node.lineno}", module.package, repr(node.value), named=False)


def _follows(statement: ast.stmt) -> bool:
    """Whether a constant is worked out from others, or from the machine's numbers."""
    value = getattr(statement, "value", None)
    return value is not None and any(
        isinstance(node, ast.Name) and (node.id == "sys" or node.id.lstrip("_").isupper())
        for node in ast.walk(value)
    )


def _names(statement: ast.stmt) -> list[str]:
    """Names in capitals that a statement at module level gives."""
    targets: list[ast.expr] = []
    if isinstance(statement, ast.Assign):
        targets = statement.targets
    elif isinstance(statement, ast.AnnAssign):
        targets = [statement.target]
    found = [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]
    return found if found and all(name.lstrip("_").isupper() for name in found) else []


def _numbers(statement: ast.AST) -> Iterator[ast.Constant]:
    """Literals that are numbers; those in subscripts, which are places, are left aside."""
    if isinstance(statement, ast.Constant):
        if isinstance(statement.value, int | float) and not isinstance(statement.value, bool):
            yield statement
        return
    for name, value in ast.iter_fields(statement):
        if isinstance(statement, ast.Subscript) and name == "slice":
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _numbers(child)


if __name__ == "__main__":
    for constant in constants():
        print(f"{constant.place:60} {'named ' if constant.named else 'inline'} {constant.text}")
    for package, (named, inline) in counted().items():
        print(f"{package:16} {named:4} named {inline:4} inline")
    named, inline = (sum(each) for each in zip(*counted().values(), strict=True))
    print(f"{'in all':16} {named:4} named {inline:4} inline")
