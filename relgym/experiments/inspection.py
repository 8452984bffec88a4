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
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import load_env_creator

import relgym  # noqa: F401 - registers the envs
from relgym.envs.views import View
from relgym.errors import RelgymError
from relgym.model.reports.text import Cell, indented, table
from relgym.scene.objects import Scene
from relgym.scene.schema import SceneSchema
from relgym.scene.state import relational_state
from relgym.wrappers.views import settled, view_of

__all__ = ["Finding", "diagnosis", "inspected", "space_text"]

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


def inspected(env: gym.Env[Any, Any], view: View | None = None, *, seed: int = 0) -> str:
    """What relgym sees of an env, as text: spaces, view, objects, and the first scene with its relations.

    Parameters
    ----------
    env
        Any env; it is reset.
    view
        How it is seen; default: as `relgym.wrappers.ModelLearner` does by default.
    seed
        Of the reset.

    Raises
    ------
    ConfigError
        Spaces that need a view of the user's.
    """
    view = view_of(env) if view is None else view
    observation, info = env.reset(seed=seed)
    view = settled(view, [observation])
    schema, scene = view.schema, view.scene(observation, info)
    env.action_space.seed(seed)
    scene = view.with_action(scene, env.action_space.sample())
    related = relational_state(scene).relations if scene.layout.bodies else {}
    relations = [
        f"{name}: {', '.join('(' + ', '.join(objects) + ')' for objects in sorted(found))}"
        for name, found in related.items()
        if found
    ]
    parts = {
        "observations": space_text(env.observation_space),
        "actions": space_text(env.action_space),
        "seen as": _manner(view),
        "types": table(["type", "parent", "shape", "properties"], _type_rows(schema)),
        "objects": table(["object", "type"], [list(pair) for pair in schema.objects]),
        "learned": "\n".join(map(str, schema.targets or ())) or "every property that changes",
        "derived": "\n".join(map(str, _laws(schema))) or "nothing",
        "the first scene, with an action": "\n".join(_values(scene)),
        "relations in it": "\n".join(relations) or "none: spatial relations hold between bodies",
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


_MANNERS: dict[str, str] = {
    "scene": "scenes: the env's own objects",
    "flat": "numbers: properties of one object, or of one per key",
    "table": "a table: its rows are objects, its columns their properties",
    "task": "reward or termination beside the state",
}


def _manner(view: View) -> str:
    """What kind of view it is, for people; one of the user's own goes by its class."""
    own = type(view).__name__
    try:
        kind = view.to_json().get("kind", "")
    except RelgymError:
        kind = ""
    return f"{_MANNERS.get(kind, 'what a function of your own finds')}  ({own})"


def space_text(space: spaces.Space[Any]) -> str:
    """What a space holds, in a line: Gymnasium writes down every bound.

    Examples
    --------
    >>> space_text(spaces.Box(-2.0, 2.0, (1,)))
    '1 number from -2 to 2 (float32)'
    >>> space_text(spaces.Dict(car=spaces.Box(-np.inf, np.inf, (3,), np.float64), gear=spaces.Discrete(5)))
    'Dict of car: 3 numbers (float64); gear: Discrete(5)'
    """
    if isinstance(space, spaces.Dict):
        return "Dict of " + "; ".join(f"{key}: {space_text(part)}" for key, part in space.items())
    if not isinstance(space, spaces.Box):
        return str(space)
    low, high = float(space.low.min()), float(space.high.max())
    same = (space.low == low).all() and (space.high == high).all() and np.isfinite([low, high]).all()
    count = " x ".join(map(str, space.shape)) or "1"
    limits = f" from {low:g} to {high:g}" if same else ""
    return f"{count} number{'' if count == '1' else 's'}{limits} ({space.dtype})"


def _values(scene: Scene) -> list[str]:
    shown = []
    for o in scene:
        values = zip(o.type.properties, o.values.tolist(), strict=True)
        shown.append(f"{o.name}: " + ", ".join(f"{prop} = {value:.4g}" for prop, value in values))
    return shown


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
