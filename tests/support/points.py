"""Worlds of one object without a body, whose next numbers are a function of its numbers and the action's."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from relgym.config import ModelConfig
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, TASK, ObjectType, Transition
from relgym.scene.schema import SceneSchema

Step = Callable[[np.ndarray, np.ndarray], Sequence[float]]


def schema_of(
    props: tuple[str, ...],
    actions: tuple[str, ...] = (),
    task: tuple[str, ...] = (),
    angles: tuple[str, ...] = (),
) -> SceneSchema:
    """An object `self`, an action and, if asked for, a task; targets are found while learning."""
    types = [ObjectType("self", props, angles=angles), ObjectType(ACTION, actions)]
    types += [ObjectType(TASK, task)] if task else []
    return SceneSchema(tuple(types), tuple((t.name, t.name) for t in types))


def transitions(
    schema: SceneSchema,
    step: Step,
    starts: np.ndarray,
    actions: np.ndarray,
    worth: Callable[[np.ndarray, np.ndarray, np.ndarray], Sequence[float]] | None = None,
) -> list[Transition]:
    """One transition from each start, shape ``(n, properties)``, under each action."""
    found = []
    for x, u in zip(starts, actions, strict=True):
        y = np.asarray(step(x, u), dtype=float)
        before, after = {"self": x, ACTION: u}, {"self": y, ACTION: u}
        if worth is not None:
            paid = worth(x, u, y)
            before[TASK], after[TASK] = np.zeros(len(paid)), np.asarray(paid, dtype=float)
        found.append(Transition(schema.scene(before), schema.scene(after)))
    return found


def learned(schema: SceneSchema, steps: list[Transition], **config: object) -> WorldModel:
    """A model of the transitions, classifiers up to date."""
    model = WorldModel(schema, ModelConfig(**config))  # type: ignore[arg-type]
    for transition in steps:
        model.learn_one(transition)
    model.finish()
    return model


def formulas(model: WorldModel, prop: str, digits: int = 4) -> list[str]:
    """Functions of a property's modes, by id."""
    return [mode.formula(digits) for mode in model.modes("self", prop)]
