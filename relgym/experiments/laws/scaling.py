"""What a step by laws costs: it must grow with the touching pairs, not with the objects."""

from __future__ import annotations

from statistics import median
from time import process_time
from typing import Final

import numpy as np

from relgym.experiments.criterion import Measure, measured
from relgym.experiments.laws.score import SEEDS, laws_of, taught
from relgym.experiments.laws.trials import trial_rooms
from relgym.experiments.laws.worlds import Ball, World
from relgym.laws.book import LawBook
from relgym.laws.touching import Contacts
from relgym.scene.objects import Float2D, SceneLayout
from relgym.scene.relations import Extractor

__all__ = ["on_the_floor", "scaling"]

_RADIUS: Final = 0.1
_FEW, _MANY = 2, 8
_SMALL, _LARGE = 12, 60
_REPEATS: Final = 200


def on_the_floor(touching: int, objects: int) -> tuple[World, SceneLayout, Float2D]:
    """A scene of so many objects, of which so many are balls that lie on the floor; as a row.

    Parameters
    ----------
    touching
        Number of balls, each of which touches the floor and nothing else.
    objects
        Number of all objects; those that are no balls, but for the floor, lie far below it.
    """
    world = World(2, (Ball(radius=_RADIUS),) * touching, ("block",) * (objects - touching))
    layout = world.schema().layout()
    values: list[float] = []
    for k in range(touching):
        values += [0.5 * k, 0.999 * _RADIUS, 0, 0, 0, 0, *[2 * _RADIUS] * 3, 0.01, -0.02]
    for k in range(objects - touching):
        values += [0, -0.5 - 3.0 * k, 0, 0, 0, 0, 100.0, 1.0, 1.0]
    return world, layout, np.array([values], dtype=np.float64)


def scaling() -> list[Measure]:
    """Times of a step by laws alone, the relations being known: eight pairs against two, 60 objects against 12."""
    book = laws_of(taught(trial_rooms(World(2), 10, seed=SEEDS[0])))
    few, many, large = (
        _seconds(book, pairs, objects) for pairs, objects in ((_FEW, _SMALL), (_MANY, _SMALL), (_FEW, _LARGE))
    )
    return [
        measured(
            f"a step's time per touching pair, {_MANY} pairs against {_FEW}", 1.2, [many / few * _FEW / _MANY]
        ),
        measured(f"a step's time, {_LARGE} objects against {_SMALL}", 1.2, [large / few]),
    ]


def _seconds(book: LawBook, touching: int, objects: int) -> float:
    """Median processor time of a step by laws."""
    world, layout, vectors = on_the_floor(touching, objects)
    relations = Extractor(world.schema()).extract(layout, vectors)
    spent = []
    for _ in range(_REPEATS):
        start = process_time()
        book.motion(Contacts.of(book.cast(layout), relations, vectors), vectors)
        spent.append(process_time() - start)
    return median(spent)
