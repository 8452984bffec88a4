"""Learning again, in other orders, from what was met in the order of life; and what a model misses of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.model.predicting.prediction import BatchPrediction
from relgym.model.world_model import WorldModel
from relgym.scene.objects import SceneLayout, Transition

__all__ = ["learned_again", "length", "missed", "mixed", "off_by", "right"]

_LITERALS: Final = 5
"""So many literals of clauses take as many bits as a number: some four each (which relation, of which objects), and a
number that is right to the tolerance within the range of its target some twenty."""


def right(
    model: WorldModel, transitions: Sequence[Transition], *, tolerance: float = 1e-6
) -> NDArray[np.bool_]:
    """Which transitions a model predicts, all its targets.

    Parameters
    ----------
    model
        The model.
    transitions
        n of them.
    tolerance
        How far a prediction may be off, relative to its size (absolute below 1).

    Returns
    -------
    Shape ``(n,)``.
    """
    claimed, off = _off(model, transitions, tolerance)
    return claimed & np.array([not len(rest) for rest in off], dtype=np.bool_)


def off_by(
    model: WorldModel, transitions: Sequence[Transition], ratio: Callable[[tuple[str, str], float], float]
) -> NDArray[np.float64]:
    """How far a model's values are off, those that it only guesses included, as the largest ratio of a step.

    Parameters
    ----------
    model, transitions
        As for `right`.
    ratio
        Of (type, property) and how far a value is off; see `relgym.wrappers.dyna.acceptance.ModelAcceptance.ratio`.

    Returns
    -------
    Shape ``(n,)``.
    """
    found = np.zeros(len(transitions))
    for rows, _, parts, off, _ in _compared(model, transitions):
        for k, row in zip(rows, off, strict=True):
            found[k] = max(map(ratio, parts, row.tolist()), default=1.0)
    return found


def missed(
    model: WorldModel,
    transitions: Sequence[Transition],
    episodes: NDArray[np.intp],
    *,
    tolerance: float = 1e-6,
) -> int:
    """How many values it takes to state what a model misses of each episode.

    A law that is off by the same in all of an episode, since it has a friction wrong, misses one value, not one for
    each step: so it is corrected where plans are made (`Planner`), and so little evidence the episode is for one
    that has a number for each episode instead.

    Parameters
    ----------
    model, transitions, tolerance
        As for `right`; where the model abstains, what it would have said counts.
    episodes
        To which episode each transition belongs, shape ``(n,)``.
    """
    _, off = _off(model, transitions, tolerance)
    return len({(int(episode), rest) for episode, rest in zip(episodes, off, strict=True) if rest})


def _off(
    model: WorldModel, transitions: Sequence[Transition], tolerance: float
) -> tuple[NDArray[np.bool_], list[bytes]]:
    """Which of n transitions a model claims to predict, and by how much it is off, empty where it is right."""
    claimed = np.zeros(len(transitions), dtype=np.bool_)
    found = [b""] * len(transitions)
    for rows, told, _, off, real in _compared(model, transitions):
        size = np.maximum(1.0, np.abs(real))
        # A hundred tolerances apart errors aren't the same one, rounded.
        step = 100.0 * tolerance * size.max(axis=0, initial=1.0)
        off = np.where(np.abs(off) <= tolerance * size, 0.0, np.round(off / step) + np.copysign(0.5, off))
        claimed[rows] = told.ok
        for k, rest in zip(rows, off, strict=True):
            found[k] = rest.tobytes() if rest.any() else b""
    return claimed, found


def _compared(
    model: WorldModel, transitions: Sequence[Transition]
) -> Iterator[
    tuple[list[int], BatchPrediction, list[tuple[str, str]], NDArray[np.float64], NDArray[np.float64]]
]:
    """Transitions of one layout after the other: which, what is predicted, and of all targets kinds, errors, values."""
    order = sorted(range(len(transitions)), key=lambda k: _layouts(transitions[k])[0].names)
    for _, group in groupby(order, key=lambda k: _layouts(transitions[k])):
        rows = list(group)
        before, after = _layouts(transitions[rows[0]])
        told = model.predict_batch(before, np.stack([transitions[k].before.vector for k in rows]))
        seen = np.stack([transitions[k].after.vector for k in rows])
        parts = [
            (
                (target.type, target.property),
                before.column(before.index(name), target.property),
                after.column(after.index(name), target.property),
            )
            for target in model.targets
            for name in (before.names[k] for k in before.of_type(target.type))
            if name in after.names
        ]
        real = seen[:, [column for _, _, column in parts]]
        off = real - told.vectors[:, [column for _, column, _ in parts]]
        yield rows, told, [key for key, _, _ in parts], off, real


def length(model: WorldModel) -> float:
    """How long a model is, in numbers: what it takes to state its functions, and when each of them holds.

    What a model misses has to be stated as well (`missed`), so a number that is part of it has to save more than one
    value: the sum of both is its minimum description length (Rissanen 1978). Weights that are equal within a mode are
    stated once. It tells laws from functions that fit each episode by numbers of its own.
    """
    found = 0.0
    for target in model.targets:
        known = model.property_model(target.type, target.property)
        for mode in known.modes:
            weights = {round(weight, 9) for role in mode.roles for _, weight in role.terms}
            found += len(weights) + (mode.intercept != 0.0)
        for pair in known.classifier.classifiers:
            found += sum(len(clause) for clause in pair.definition.clauses) / _LITERALS
    return found


def mixed(episodes: NDArray[np.intp], rng: np.random.Generator) -> list[int]:
    """A random order in which the steps of all episodes take turns.

    Parameters
    ----------
    episodes
        To which episode each of n steps belongs, shape ``(n,)``.
    rng
        Draws the order.
    """
    drawn = rng.permutation(len(episodes))
    rounds = np.zeros(len(drawn), dtype=np.intp)
    for episode in np.unique(episodes):
        own = episodes[drawn] == episode
        rounds[own] = np.arange(own.sum())
    return [int(k) for k in drawn[np.argsort(rounds, kind="stable")]]


def learned_again(
    model: WorldModel,
    transitions: Sequence[Transition],
    *,
    rng: np.random.Generator,
    episodes: NDArray[np.intp] | None = None,
) -> WorldModel:
    """A new model of the same world that has met the same transitions in random order, one of each episode in turn.

    Throughout an episode much stays as it is: which objects there are, where they stand, what they are made of. Laws
    that are found while only a few episodes were seen have that in them as if it were a constant. In turns the first
    examples already are of all episodes: of 200 steps of TruckPush (one seed) four models of five that learned them so
    got all of them right, two of five in random orders, and not the one that had learned them in the order of life.

    Parameters
    ----------
    model
        Gives schema, configuration and targets.
    transitions
        What to learn from, n of them.
    rng
        Draws the order.
    episodes
        To which episode each of them belongs, shape ``(n,)``; default: each is its own.
    """
    fresh = model.untaught()
    for k in mixed(np.arange(len(transitions)) if episodes is None else episodes, rng):
        fresh.learn_one(transitions[k])
    fresh.finish()
    return fresh


def _layouts(transition: Transition) -> tuple[SceneLayout, SceneLayout]:
    return transition.before.layout, transition.after.layout
