"""Pong through its list of objects, as a benchmark: what the ball does in the air, at walls and at paddles.

Predicted are the ball's displacements per frame, whole pixels: exact or wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.any_env.recorded import live, stream
from relgym.experiments.criterion import Figure
from relgym.experiments.recording import Recording
from relgym.model.reports.text import Cell, table
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Target

__all__ = ["KINDS", "kinds_of", "names", "pong"]

KINDS: Final = ("flight", "wall", "paddle", "other change")
"""What can happen to the ball."""

WALLS: Final = (14.0, 179.0)
"""Heights at which the ball touches floor and ceiling, in pixels."""

NEAR: Final = 8.0
"""A ball that is thrown back so near to them was thrown back by them; else a paddle did it, in two frames."""

HEIGHT: Final = 1
"""Column of the ball's height among what other learners are shown."""

STREAM: Final = 5_000
"""Steps of the stream on which other learners go along."""

_TARGETS: Final = (Target("ball", "dx"), Target("ball", "dy"))


def pong(folder: Path, seeds: Sequence[int], *, batch: bool = True) -> Iterator[Figure]:
    """Learned from one recording and tested on another; and the stream as it comes.

    Parameters
    ----------
    folder
        Of ``pong-SEED.npz`` and ``pong-test-SEED.npz``.
    seeds
        Which recordings.
    batch
        Whether learners that are fitted once are listed too.
    """
    for number, seed in enumerate(seeds):
        lesson, fresh = (Recording.load(folder / f"pong{part}-{seed}.npz") for part in ("", "-test"))
        model, rows = live(lesson, _TARGETS)
        _, tested = live(fresh, (), model=model, learn=False)
        if not number:
            print(f"{len(lesson):,} steps", model.describe(digits=4), sep="\n", flush=True)
        yield from _shares(tested["ball"].columns(), verbose=not number)
        for kind in ("paddle", "wall"):
            named = any(names(model, target, kind) for target in _TARGETS)
            yield f"a clause names the {kind}", 1.0, float(named), ">="
        yield from stream("ball", rows["ball"].until(STREAM), verbose=not number, batch=batch)


def kinds_of(
    before: NDArray[np.float64], after: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.intp]:
    """What happened, as places in `KINDS`, from displacements before and after, ``(n, 2)`` each, and heights, ``(n,)``.

    Told after the fact, to tell errors apart: what turns the ball round is a paddle, what throws it back at a wall is
    the wall. The frame after that, serves and goals are other changes.
    """
    turned, same = before * after < 0.0, (before == after).all(axis=1)
    wall = turned[:, 1] & (np.abs(y[:, None] - WALLS).min(axis=1) <= NEAR)
    return np.select([turned[:, 0], wall, same], [2, 1, 0], 3)


def _shares(columns: dict[str, NDArray[np.float64]], *, verbose: bool) -> Iterator[Figure]:
    before = columns["now"]
    after, said = before + columns["change"], before + columns["said"]
    exact, kinds = np.abs(said - after) < 0.5, kinds_of(before, after, columns["seen"][:, HEIGHT])
    sign = np.sign(np.round(said[:, 0])) == np.sign(after[:, 0])
    if verbose:
        lines: list[list[Cell]] = [
            [kind, int(k.sum()), *(f"{x[k].mean():.2%}" for x in (exact.all(axis=1), *exact.T, sign))]
            for kind, k in ((kind, kinds == number) for number, kind in enumerate(KINDS))
            if k.any()
        ]
        print(table(["fresh games", "frames", "exact", "dx", "dy", "sign of dx"], lines), "\n", flush=True)
    flight, wall, paddle = (kinds == number for number in range(3))
    yield "flight, exact", 0.999, _share(exact[flight].all(axis=1)), ">="
    yield "walls, exact", 0.99, _share(exact[wall].all(axis=1)), ">="
    yield "paddles, sign of dx", 0.95, _share(sign[paddle]), ">="
    yield "paddles, dy exact", 0.64, _share(exact[paddle, 1]), ">="


def _share(right: NDArray[np.bool_]) -> float:
    return float(right.mean()) if len(right) else float("nan")


def names(model: WorldModel, target: Target, relation: str) -> bool:
    """Whether a clause of a target's preconditions asks for a relation."""
    part = model.property_model(target.type, target.property)
    return any(
        literal.relation == relation
        for pair in part.classifier.classifiers
        for clause in pair.definition.clauses
        for literal in clause.literals
    )
