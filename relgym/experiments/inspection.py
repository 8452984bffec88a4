"""What an env's scenes are made of, as text; and whether all that relgym needs is installed and works."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from inspect import signature
from pathlib import Path
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import load_env_creator

import relgym  # noqa: F401 - registers the envs
from relgym.errors import ConfigError
from relgym.model.text import Cell, indented, table
from relgym.scene.objects import Scene
from relgym.scene.schema import SceneSchema
from relgym.scene.state import relational_state

__all__ = ["Finding", "diagnosis", "inspected"]

_REQUIRED = ("numpy", "scipy", "gymnasium", "pymunk", "python-fcl", "typer", "rich")
_OPTIONAL = {
    "matplotlib": "viz",
    "pygame-ce": "viz",
    "stable-baselines3": "sb3",
    "torch": "sb3",
}
_OLDEST = (3, 11)


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was checked.

    Attributes
    ----------
    name
        What.
    ok
        Whether it is there and works.
    text
        Its version, what went wrong, or what to do.
    required
        Whether relgym can't do without it.
    """

    name: str
    ok: bool
    text: str
    required: bool = True


def inspected(env: gym.Env[Any, Any], *, seed: int = 0) -> str:
    """An env's schema and the relations of its first scene, as text.

    Parameters
    ----------
    env
        An env with a schema; it is reset.
    seed
        Of the reset.

    Raises
    ------
    ConfigError
        The env has no schema.
    """
    if not env.has_wrapper_attr("schema"):
        raise ConfigError(f"{env} has no attribute `schema`: only envs of scenes can be inspected")
    schema: SceneSchema = env.get_wrapper_attr("schema")
    _, info = env.reset(seed=seed)
    scene: Scene = info["scene"]
    relations: list[list[Cell]] = [
        [name, ", ".join(f"({', '.join(objects)})" for objects in sorted(found))]
        for name, found in relational_state(scene).relations.items()
        if found
    ]
    parts = {
        "types": table(["type", "parent", "shape", "properties"], _type_rows(schema)),
        "objects": table(["object", "type"], [list(pair) for pair in schema.objects]),
        "learned": "\n".join(map(str, schema.targets or ())) or "every property that changes",
        "derived": "\n".join(map(str, _laws(schema))) or "nothing",
        "relations in the first scene": "\n".join(f"{name}: {found}" for name, found in relations),
    }
    return "\n\n".join(f"{title}\n{indented(text)}" for title, text in parts.items())


def diagnosis() -> tuple[Finding, ...]:
    """Check Python, packages, both envs and the writing of files."""
    python = ".".join(map(str, sys.version_info[:3]))
    findings = [Finding("python", sys.version_info[:2] >= _OLDEST, python)]
    findings += [_package(name, "", required=True) for name in _REQUIRED]
    findings += [_package(name, extra, required=False) for name, extra in _OPTIONAL.items()]
    findings += [_tried(env_id, partial(_step, env_id)) for env_id in _plain_envs()]
    findings.append(_tried("temporary files", _write))
    return tuple(findings)


def _type_rows(schema: SceneSchema) -> list[list[Cell]]:
    return [
        [
            t.name,
            t.parent or "",
            type(t.shape).__name__.lower() if t.shape else "none",
            " ".join(t.properties),
        ]
        for t in schema.types
    ]


def _laws(schema: SceneSchema) -> list[str]:
    laws = []
    for k in schema.kinematics:
        rate = f"{k.rate}'" if k.uses_next else k.rate
        step = "" if k.step == 1.0 else f"{k.step:g} "
        laws.append(f"{k.type}.{k.property}' = {k.property} + {step}{rate}")
    return laws


def _package(name: str, extra: str, *, required: bool) -> Finding:
    try:
        return Finding(name, True, version(name), required)
    except PackageNotFoundError:
        what = f"pip install 'relgym[{extra}]'" if extra else "pip install relgym"
        return Finding(name, False, f"not installed: {what}", required)


def _tried(name: str, attempt: Callable[[], str]) -> Finding:
    try:
        return Finding(name, True, attempt())
    except Exception as error:  # whatever goes wrong is what the caller wants to read
        return Finding(name, False, f"{type(error).__name__}: {error}")


def _plain_envs() -> list[str]:
    """Ids of relgym's envs that need no argument."""
    own = [spec for spec in gym.registry.values() if spec.namespace == "relgym"]
    makers = {spec.id: load_env_creator(str(spec.entry_point)) for spec in own}
    needs = {
        i: [p for p in signature(m).parameters.values() if p.default is p.empty] for i, m in makers.items()
    }
    return sorted(env_id for env_id, required in needs.items() if not required)


def _step(env_id: str) -> str:
    env = gym.make(env_id)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()
    return "made, reset and stepped"


def _write() -> str:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "probe").write_text("relgym")
        return "written"
