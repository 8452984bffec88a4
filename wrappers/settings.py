"""What the learners are told about their models, as plain data: targets, parameters, a file to go on from."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from relgym.config import ModelConfig
from relgym.errors import ConfigError
from relgym.model.files.storage import target_from_json
from relgym.model.percepts.scenes import mismatch
from relgym.model.protocol import SceneLearner
from relgym.model.world_model import WorldModel
from relgym.scene.objects import TASK, Target
from relgym.scene.schema import SceneSchema

__all__ = ["PlainTarget", "check_model", "model_of", "targets_of"]

PlainTarget: TypeAlias = Target | str | Sequence[Any]
"""A target, its name (``"ball.vx"``), or ``(type, property)``."""


def targets_of(given: Iterable[PlainTarget] | None) -> list[Target] | None:
    """The targets that are meant; `ConfigError` where some are none."""
    if isinstance(given, (str, Target)) or not (given is None or isinstance(given, Iterable)):
        raise ConfigError(f"targets={given!r}: expected several, such as [{given!r}]")
    return None if given is None else [target_of(t) for t in given]


def target_of(given: PlainTarget) -> Target:
    """The target that is meant; `ConfigError` where none is."""
    if isinstance(given, Target):
        return given
    if isinstance(given, str):
        type_name, dot, prop = given.rpartition(".")  # type names may hold dots
        if dot and type_name and prop:
            return Target(type_name, prop)
    elif isinstance(given, (tuple, list)) and len(given) in (2, 3):
        return target_from_json([*given, []] if len(given) == 2 else list(given))
    raise ConfigError(f"target {given!r}: expected 'ball.vx', ('ball', 'vx') or a Target")


def model_of(
    schema: SceneSchema,
    *,
    config: ModelConfig | None,
    targets: Sequence[Target] | None,
    given: SceneLearner | str | os.PathLike[str] | None,
) -> SceneLearner:
    """An empty model, the one that was given, or the one in a file.

    Raises
    ------
    ConfigError
        The model was learned in another world, it is none, or targets or config are given beside it.
    """
    if given is None:
        return WorldModel(schema, config, targets=targets)
    if config is not None or targets is not None:
        raise ConfigError("a model keeps its targets and config: pass either model or those")
    check_model(given)
    model: SceneLearner
    what: str | os.PathLike[str]
    if isinstance(given, (str, os.PathLike)):
        model, what = WorldModel.load(given), given
    else:
        model, what = given, "model"
    if replace(model.schema, precision=schema.precision) != schema:  # it keeps its own
        raise ConfigError(_another_world(what, schema, model.schema))
    return model


def check_model(given: Any) -> None:
    """Raise `ConfigError` unless it is a model, the path of one, or None."""
    if given is not None and not isinstance(given, (SceneLearner, str, os.PathLike)):
        raise ConfigError(
            f"model={given!r}: expected a WorldModel or the path of a model file, got {type(given).__name__}"
        )


def _another_world(what: str | os.PathLike[str], schema: SceneSchema, known: SceneSchema) -> str:
    """What differs, and what to do about it."""
    if set(known.order) ^ set(schema.order) == {TASK}:
        then, now = ("with", "without") if TASK in known.order else ("without", "with")
        return (
            f"{what}: the model was learned {then} reward or termination, and the env is wrapped {now}: in another "
            "world; pass the learn_reward and learn_termination that it was learned with"
        )
    difference = mismatch(schema, known) or f"objects {list(schema.order)}, expected {list(known.order)}"
    return (
        f"{what}: the model was learned in another world than the env's: {difference}; make and wrap the env with the "
        "arguments it was learned with"
    )
