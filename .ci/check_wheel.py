"""Is the installed wheel whole? Run with the wheel's own Python, in a folder that isn't the checkout."""

from __future__ import annotations

import importlib
import pkgutil
from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path

import gymnasium as gym

import relgym
import relgym.envs
import relgym.wrappers
from relgym.experiments.chapter4.published import published_pairs

NEEDS_EXTRA = {"sb3": "stable_baselines3"}
"""Subpackages that import a library of an extra, which the bare wheel hasn't got."""

NEEDS_ARGUMENTS = {"relgym/LearnedModel-v0"}
"""Ids that `gym.make` can't make alone: this one wants a model."""


def main() -> None:
    """Import every module, make and step every env, and say what was checked."""
    home = Path(relgym.__file__).parent
    assert "site-packages" in home.parts, f"not the wheel: {home}"
    assert (home / "py.typed").is_file(), "py.typed is missing: type checkers would ignore the annotations"
    for package in (relgym.envs, relgym.wrappers):
        assert Path(package.__file__ or "").parent.parent == home, f"not the wheel: {package.__file__}"
    modules = [
        found.name for found in pkgutil.walk_packages(relgym.__path__, "relgym.") if _usable(found.name)
    ]
    for name in modules:
        importlib.import_module(name)
    assert published_pairs("4.3"), "the thesis' clauses are missing: its tables couldn't be compared with"
    made = [_step_once(name) for name in sorted(gym.registry) if name.startswith("relgym/")]
    scripts = [entry.name for entry in distribution("relgym").entry_points]
    assert made, "no env is registered"
    assert scripts == ["relgym"], f"expected the console script relgym, got {scripts}"
    print(f"wheel {relgym.__file__}: {len(modules)} modules imported; envs: {', '.join(made)}")


def _usable(name: str) -> bool:
    library = next((NEEDS_EXTRA[part] for part in name.split(".") if part in NEEDS_EXTRA), None)
    return not name.endswith("__main__") and (library is None or find_spec(library) is not None)


def _step_once(name: str) -> str:
    if name in NEEDS_ARGUMENTS:
        return f"{name} (registered)"
    env = gym.make(name)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()
    return name


if __name__ == "__main__":
    main()
