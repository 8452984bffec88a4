"""The public interface, read and not imported."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FACADES = {
    "relgym.config": "relgym/config/__init__.py",
    "relgym.data": "relgym/data/__init__.py",
    "relgym.hypotheses": "relgym/hypotheses.py",
    "relgym.envs": "envs/__init__.py",
    "relgym.envs.views": "envs/views/__init__.py",
    "relgym.errors": "relgym/errors.py",
    "relgym.logic": "relgym/logic/__init__.py",
    "relgym.planning": "relgym/planning/__init__.py",
    "relgym.scene": "relgym/scene/__init__.py",
    "relgym.wrappers": "wrappers/__init__.py",
    "relgym.wrappers.sb3": "wrappers/sb3/__init__.py",
    "relgym": "relgym/__init__.py",
}
"""The modules that users import from; their ``__all__`` is the public interface. A name that two offer is described
with the first."""


@cache
def public_names() -> dict[str, str]:
    """Name → where it is described."""
    found: dict[str, str] = {}
    for facade, file in FACADES.items():
        for name in names_in((ROOT / file).read_text(encoding="utf-8")):
            if not name.startswith("__"):
                found.setdefault(name, f"{facade}.{name}")
    return found


def names_in(source: str) -> list[str]:
    """What a module's ``__all__`` lists."""
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return list(ast.literal_eval(node.value))
    raise ValueError("the module has no __all__")
