"""What a step costs, and how much memory, in worlds of many bodies, many kinds of objects and many properties.

Each world is learned in a process of its own, since a process' peak memory never falls (`relgym benchmark speed
sizes`).
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, Final

import numpy as np

from relgym.errors import RelgymError
from relgym.experiments.rooms import rooms
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Float2D, ObjectType, Scene, Transition
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box

__all__ = [
    "WORLDS",
    "cost",
    "many_bodies",
    "many_constants",
    "many_kinds",
    "many_properties",
    "trial",
]

_SHELL: Final = 5  # the ball, and floor, ceiling and walls
_STEPS: Final = 300


def many_bodies(bodies: int, steps: int = _STEPS) -> Iterator[Transition]:
    """A ball among so many bodies, itself and the room's four sides counted."""
    rng = np.random.default_rng(bodies)
    (found,) = rooms(1, objects=bodies - _SHELL, elasticity=0.9, friction=0.0, rng=rng, steps=steps)
    return found.transitions()


def many_kinds(kinds: int, steps: int = _STEPS) -> Iterator[Transition]:
    """A cart among bodies of so many types in all, which lie in a row and of which the cart alone moves."""
    names = ("px", "py", "vx", "sx", "sy")
    cart = ObjectType("cart", names, Box(), velocity=("vx", None, None))
    others = tuple(ObjectType(f"kind{k}", ("px", "py", "sx", "sy"), Box()) for k in range(1, kinds))
    schema = SceneSchema((cart, *others), (("cart", "cart"), *((kind.name, kind.name) for kind in others)))
    rng, layout = np.random.default_rng(kinds), schema.layout()
    rest = np.stack([3.0 * np.arange(1, kinds), *np.zeros((1, kinds - 1)), *np.ones((2, kinds - 1))], axis=1)
    for _ in range(steps):
        x, v = rng.uniform(-3.0, 3.0 * kinds), rng.normal()
        before, after = (
            np.concatenate([(a, 2.0, b, 1.0, 1.0), rest.ravel()]) for a, b in ((x, v), (x, 0.9 * v))
        )
        yield Transition(Scene(schema, layout, before), Scene(schema, layout, after))


def many_constants(properties: int, steps: int = _STEPS) -> Iterator[Transition]:
    """An object with so many properties: sixteen decay, sixteen are noise, the others never change."""
    return many_properties(properties, steps, every=properties // 16)


def many_properties(properties: int, steps: int = _STEPS, *, every: int = 8) -> Iterator[Transition]:
    """An object with so many properties: one in eight decays, one in eight is noise, the others never change."""
    wide = ObjectType("wide", tuple(f"p{k}" for k in range(properties)))
    schema = SceneSchema((wide,), (("wide", "wide"),))
    rng, layout = np.random.default_rng(properties), schema.layout()
    now = rng.normal(size=properties)
    for _ in range(steps):
        then: Float2D = now.copy()
        then[::every] *= 0.9
        then[1::every] = rng.normal(size=len(then[1::every]))
        yield Transition(Scene(schema, layout, now), Scene(schema, layout, then))
        now = then


WORLDS: Final[dict[str, tuple[Callable[[int], Iterator[Transition]], int]]] = {
    **{f"bodies-{count}": (many_bodies, count) for count in (12, 60, 200, 1000)},
    **{f"kinds-{count}": (many_kinds, count) for count in (20, 200)},
    **{f"properties-{count}": (many_properties, count) for count in (100, 400, 2800)},
    **{f"constants-{count}": (many_constants, count) for count in (400, 2800)},
}
"""What makes the transitions of each world, and of which size."""


def cost(name: str) -> dict[str, Any]:
    """Learn in one world, in this process.

    Parameters
    ----------
    name
        Of `WORLDS`.

    Returns
    -------
    How many ``steps``; ``mean`` and ``worst``, processor time of a step, predicted and learned from, in ms; ``memory``,
    peak memory of the process in MB, the making of the world included; ``refused``, what a typed error said, or empty.
    """
    make, size = WORLDS[name]
    lesson = list(make(size))
    spent: list[float] = []
    refused = ""
    try:
        model = WorldModel(lesson[0].before.schema)
        for transition in lesson:
            begin = time.thread_time()
            said = model.predict_one(transition.before)
            compare_and_learn(model, transition, said)
            spent.append(1e3 * (time.thread_time() - begin))
    except RelgymError as error:
        refused = str(error)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
    return {
        "steps": len(spent),
        "mean": float(np.mean(spent or 0.0)),
        "worst": max(spent, default=0.0),
        "memory": peak,
        "refused": refused,
    }


def trial(*, world: str) -> dict[str, Any]:
    """`cost` in a process of its own, as a task for the store of results."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(cost, world).result()
