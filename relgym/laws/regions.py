"""Free motion that differs from region to region: where wind blows, the same law holds with another constant.

What a body does that touches nothing may depend on where it is, though nothing marks the place. In a region one
linear law explains everything; which laws there are is found in stretches of neighbouring examples, of which some lie
in a single region. Then a decision tree over positions tells the regions apart. Between the last example on one side
of a boundary and the first one on the other nothing is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ALTERNATIVES, ROUNDS
from relgym.laws.records import Bound, Piece, Region
from relgym.numeric.tree import DecisionTree, learn_tree

__all__ = ["find_laws", "find_regions"]

_Laws = Sequence[tuple[Piece, ...]]


def find_laws(
    fit: Callable[[NDArray[np.intp]], tuple[Piece, ...] | None],
    obeys: Callable[[tuple[Piece, ...]], NDArray[np.bool_]],
    place: NDArray[np.float64],
    *,
    fewest: int,
) -> list[tuple[Piece, ...]]:
    """Laws of which each explains some stretch of neighbouring examples, those that explain most first.

    Parameters
    ----------
    fit
        The law of some examples, given by number; None if it doesn't explain nearly all of them.
    obeys
        Which of all examples a law explains, shape ``(n,)``.
    place
        Positions, shape ``(n, d)``.
    fewest
        Examples in a stretch at least.

    Notes
    -----
    Cost: up to 14 fits for each component of a position and each law.
    """
    laws: list[tuple[Piece, ...]] = []
    left = np.ones(len(place), dtype=bool)
    while len(laws) < ALTERNATIVES and left.sum() >= fewest:
        found = _most_telling(fit, obeys, place, left, fewest)
        if found is None:
            break
        laws.append(found)
        left &= ~obeys(found)
    return sorted(laws, key=lambda law: -int(obeys(law).sum()))


def _most_telling(
    fit: Callable[[NDArray[np.intp]], tuple[Piece, ...] | None],
    obeys: Callable[[tuple[Piece, ...]], NDArray[np.bool_]],
    place: NDArray[np.float64],
    left: NDArray[np.bool_],
    fewest: int,
) -> tuple[Piece, ...] | None:
    """The law of a stretch that explains most of what is left."""
    best: tuple[int, tuple[Piece, ...]] | None = None
    for rows in _stretches(place, np.flatnonzero(left), fewest):
        law = fit(rows)
        if law is None:
            continue
        count = int((obeys(law) & left).sum())
        if best is None or count > best[0]:
            best = count, law
            if 2 * count >= int(left.sum()):
                break
    return None if best is None else best[1]


def _stretches(place: NDArray[np.float64], rows: NDArray[np.intp], fewest: int) -> Iterator[NDArray[np.intp]]:
    # Halves, quarters, eighths. Narrower regions are found once others are explained: what is left is cut anew.
    parts = 1
    for _ in range(ROUNDS):
        parts *= 2
        for column in range(place.shape[1]):
            order = rows[np.argsort(place[rows, column], kind="stable")]
            yield from (stretch for stretch in np.array_split(order, parts) if len(stretch) >= fewest)


def find_regions(
    laws: _Laws,
    held: Sequence[NDArray[np.bool_]],
    place: NDArray[np.float64],
    names: tuple[str, ...],
) -> tuple[Region, ...]:
    """Where each law but the first one holds; none of a law that positions don't tell from those before it.

    Each law is told from all before it, and not from those that follow. So the last law's regions come first: of
    several that a body is in the first one counts.

    Parameters
    ----------
    laws
        The laws, the one that holds elsewhere first.
    held
        Which examples each explains, shape ``(n,)``.
    place, names
        Positions, shape ``(n, d)``, and the names of their components.
    """
    found: list[Region] = []
    known = held[0].copy()
    for law, own in zip(laws[1:], held[1:], strict=True):
        # Examples that both explain (a body at rest, perhaps) don't tell where a region ends.
        rows = np.flatnonzero(own ^ known)
        tree = learn_tree(place[rows], own[rows], columns=names)
        found[:0] = [Region(bounds, law) for bounds in _leaves(tree, place[rows])]
        known |= own
    return tuple(found)


def _leaves(tree: DecisionTree, place: NDArray[np.float64]) -> Iterator[tuple[Bound, ...]]:
    """The tests that lead to each leaf that says yes; a tree of one leaf has none."""

    def follow(node: int, rows: NDArray[np.intp], bounds: tuple[Bound, ...]) -> Iterator[tuple[Bound, ...]]:
        column = tree.column[node]
        if column < 0:
            if bounds and tree.says_yes(node):
                yield bounds
            return
        values = place[rows, column]
        down = values <= tree.threshold[node]
        low, high = float(values[down].max()), float(values[~down].min())
        for above, part, child in ((False, down, tree.below[node]), (True, ~down, tree.above[node])):
            yield from follow(child, rows[part], (*bounds, Bound(tree.columns[column], above, low, high)))

    yield from follow(0, np.arange(len(place)), ())
