"""Finding the linear pieces of one axis' law among its examples.

Features are few, so that every subset of one or two of them is tried, many random samples each: forward
selection fails where features are collinear, and in contacts they often are (a slide's normal velocity is 0).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import (
    ACTING,
    ALIKE,
    ALTERNATIVES,
    DRAWS,
    EXTRAPOLATED,
    FEWEST,
    ROUNDED,
    ROUNDS,
    SEARCHED_ROWS,
)
from relgym.laws.description import CONSTANT_BITS, EXCEPTION_BITS
from relgym.laws.records import Piece
from relgym.numeric.stepwise import least_squares
from relgym.scene.geometry.vectors import FloatArray

__all__ = ["AxisExamples", "find_pieces", "fitted"]


@dataclass(frozen=True, slots=True)
class AxisExamples:
    """Examples of one axis of a frame.

    Attributes
    ----------
    names
        Names of the features, in order of preference, the constant last.
    x
        Features, shape ``(n, len(names))``.
    y
        Velocity after the contact along the axis, shape ``(n,)``.
    free
        Name of the feature that is the free motion along the axis.
    tolerance
        Largest residual of an explained example.
    """

    names: tuple[str, ...]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    free: str
    tolerance: float

    def __len__(self) -> int:
        return len(self.y)

    def rows(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> AxisExamples:
        """Some of the examples."""
        return AxisExamples(self.names, self.x[chosen], self.y[chosen], self.free, self.tolerance)

    def values(self, piece: Piece) -> FloatArray:
        """A piece's values, shape ``(n,)``."""
        columns = {name: self.x[:, k] for k, name in enumerate(self.names)}
        return piece.values(columns, self.y)

    def explains(self, piece: Piece) -> NDArray[np.bool_]:
        """Which examples a piece explains."""
        return self.near(piece, 1.0)

    def near(self, piece: Piece, factor: float) -> NDArray[np.bool_]:
        """Which examples a piece explains within so many tolerances."""
        fits: NDArray[np.bool_] = np.abs(self.y - self.values(piece)) <= factor * self.tolerance
        return fits


def find_pieces(examples: AxisExamples, known: list[Piece], *, rng: np.random.Generator) -> list[Piece]:
    """Pieces that explain what `known` ones don't, the most telling first; each with its equals behind it.

    Parameters
    ----------
    examples
        The examples.
    known
        Pieces that need no search.
    rng
        Source of the random samples.
    """
    found: list[Piece] = []
    left = np.ones(len(examples), dtype=bool)
    for piece in known:
        left &= ~examples.explains(piece)
    for _ in range(ALTERNATIVES):
        if not left.any():
            break
        told = _search(examples.rows(left), examples, rng=rng)
        if told is None:
            break
        piece = told
        found += [piece, *_equals(piece, examples.rows(left & examples.explains(piece)))]
        left &= ~examples.explains(piece)
    return found


def _search(part: AxisExamples, everything: AxisExamples, *, rng: np.random.Generator) -> Piece | None:
    """The function that saves most bits on some examples, or None if none saves any."""
    sample = part
    if len(part) > SEARCHED_ROWS:
        sample = part.rows(np.sort(rng.choice(len(part), SEARCHED_ROWS, replace=False)))
    best: tuple[float, Piece] | None = None
    every = list(_subsets(part))
    for base, columns in every:
        spare = _spare(everything, len(part), len(columns), len(every))
        for weights in _promising(sample, base, columns, spare, rng=rng):
            rough = _piece(part, base, columns, weights)
            loose = part.near(rough, EXTRAPOLATED)
            least = 0.0 if best is None else best[0] + 1.0
            if EXCEPTION_BITS * int(loose.sum()) <= least:
                continue  # no fit would save more
            piece = _refined(rough, loose, base, part, spare)
            if piece is None:
                continue
            saved = EXCEPTION_BITS * int(part.explains(piece).sum())
            saved -= (CONSTANT_BITS + 0.5 * np.log2(len(everything))) * piece.free_parameters()
            saved -= 2.0 * len(piece.terms)
            if saved > least:
                best = (saved, piece)
    return None if best is None else best[1]


def _subsets(examples: AxisExamples) -> Iterator[tuple[bool, tuple[int, ...]]]:
    """Which features to combine; with the flag, they are added to the free motion."""
    every = range(len(examples.names))
    free = examples.names.index(examples.free)
    for size in (1, 2):
        yield from ((False, columns) for columns in combinations(every, size))
        others = [k for k in every if k != free]
        yield from ((True, columns) for columns in combinations(others, size) if size < 2)


def _spare(everything: AxisExamples, n: int, p: int, functions: int) -> int:
    """Examples that must verify a function of p weights, beside the p that fix them.

    By chance an example agrees with probability tolerance / largest velocity. A function and the examples that fix it,
    p of n, are chosen in at most ``functions * n**p`` ways. So many must agree that less than one of these is expected
    to get there by chance: one where states are exact, more through noise.
    """
    largest = float(np.abs(everything.y).max(initial=0.0))
    told = math.log2(max(2.0, largest / max(everything.tolerance, np.finfo(np.float64).tiny)))
    return max(1, math.ceil((math.log2(functions) + p * math.log2(n)) / told))


def _promising(
    sample: AxisExamples, base: bool, columns: tuple[int, ...], spare: int, *, rng: np.random.Generator
) -> list[NDArray[np.float64]]:
    """Weights through random samples of as many examples: the set that reproduces most others, if enough."""
    n, p = len(sample), len(columns)
    if n < p + spare:
        return []
    x, y = sample.x[:, columns], _response(sample, base)
    picks = _picks(n, p, rng=rng)
    weights, solved = _solve(x[picks], y[picks])
    if not solved.any():
        return []
    weights = weights[solved]
    hits, left = np.ones((len(weights), n), dtype=bool), y
    for k in range(p):
        contribution = weights[:, k, None] * x[:, k]
        hits &= np.abs(contribution) > ACTING * sample.tolerance
        left = left - contribution
    hits &= np.abs(left) <= EXTRAPOLATED * sample.tolerance
    counts = np.count_nonzero(hits, axis=1)
    best = int(counts.argmax())
    return [weights[best]] if counts[best] >= p + spare else []


def _picks(n: int, p: int, *, rng: np.random.Generator) -> NDArray[np.intp]:
    if p == 1:
        return np.arange(n)[:, None] if n <= DRAWS else rng.choice(n, (DRAWS, 1))
    first = rng.integers(0, n, 2 * DRAWS)
    # Half of the partners are close in time: neighbours tend to obey the same piece, and those next to one another
    # differ by too little to tell it where there is noise.
    near = rng.integers(1, FEWEST, 2 * DRAWS)
    step = np.where(np.arange(2 * DRAWS) % 2 == 0, rng.integers(1, n, 2 * DRAWS), near)
    return np.stack([first, (first + step) % n], axis=1)


def _solve(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Solve many systems of one or two equations: weights ``(m, p)``, and which of them are determined."""
    if x.shape[2] == 1:
        pivot = x[:, 0, 0]
        solved = np.abs(pivot) > 0.0
        return (y / np.where(solved[:, None], x[:, :, 0], 1.0)), solved
    (a, b), (c, d) = x[:, 0].T, x[:, 1].T
    determinant = a * d - b * c
    size = np.hypot(a, b) * np.hypot(c, d)
    solved = np.abs(determinant) > ALIKE * size
    safe = np.where(solved, determinant, 1.0)
    weights = np.stack([(d * y[:, 0] - b * y[:, 1]) / safe, (a * y[:, 1] - c * y[:, 0]) / safe], axis=1)
    return weights, solved


def _response(examples: AxisExamples, base: bool) -> NDArray[np.float64]:
    """What the weighted features must give: the velocity, or its change by the contact."""
    if not base:
        return examples.y
    change: NDArray[np.float64] = examples.y - examples.x[:, examples.names.index(examples.free)]
    return change


def _piece(
    examples: AxisExamples, base: bool, columns: tuple[int, ...], weights: NDArray[np.float64]
) -> Piece:
    terms = [(examples.names[c], float(w)) for c, w in zip(columns, weights, strict=True)]
    return Piece(((examples.free, 1.0), *terms) if base else tuple(terms))


def _refined(
    piece: Piece, loose: NDArray[np.bool_], base: bool, examples: AxisExamples, spare: int
) -> Piece | None:
    """The piece fitted to what it explains, `loose` at first, as far as that determines it."""
    for _ in range(ROUNDS):
        if loose.sum() < len(piece.terms) + 1:
            return None
        refitted = fitted(piece, examples.rows(loose))
        again = examples.explains(refitted)
        piece, same = refitted, bool((again == loose).all())
        loose = again
        if same:
            break
    return piece if _determined(piece, base, examples.rows(loose), spare) else None


def fitted(piece: Piece, examples: AxisExamples) -> Piece:
    """The piece with its weights fitted to examples; weights within 1e-9 of 1 or -1 are exactly that.

    A first term that is the free motion itself, with weight 1, keeps it.
    """
    base = len(piece.terms) > 1 and piece.terms[0] == (examples.free, 1.0)
    names = [name for name, _ in piece.terms][base:]
    columns = tuple(examples.names.index(name) for name in names)
    if not columns:
        return piece
    fit = least_squares(examples.x, _response(examples, base), columns, intercept=False)
    weights = dict(zip(fit.columns, fit.weights, strict=True))
    terms = [(name, _round(weights.get(c, 0.0))) for name, c in zip(names, columns, strict=True)]
    exact = Piece((*piece.terms[:base], *terms))
    if examples.explains(exact).all():
        return exact
    terms = [(name, weights.get(c, 0.0)) for name, c in zip(names, columns, strict=True)]
    return Piece((*piece.terms[:base], *terms))


def _round(weight: float) -> float:
    nearest = float(round(weight))
    return nearest if abs(nearest) == 1.0 and abs(weight - nearest) <= ROUNDED else weight


def _determined(piece: Piece, base: bool, members: AxisExamples, spare: int) -> bool:
    """Whether enough examples verify the function, and each of its weights."""
    terms = piece.terms[base:]
    if len(members) < len(terms) + spare:
        return False
    columns = tuple(members.names.index(name) for name, _ in terms)
    for k, (_, weight) in enumerate(terms):
        column = members.x[:, columns[k]]
        others = columns[:k] + columns[k + 1 :]
        own = column - least_squares(members.x, column, others, intercept=False).predict(members.x)
        if np.sort(np.abs(weight * own))[-1 - spare] <= ACTING * members.tolerance:
            return False
    return True


def _equals(piece: Piece, members: AxisExamples) -> list[Piece]:
    """Other functions of as many features that explain all the same examples: ties that stay open."""
    base = len(piece.terms) > 1 and piece.terms[0] == (members.free, 1.0)
    names = {name for name, _ in piece.terms}
    same = []
    for flag, columns in _subsets(members):
        if flag != base or len(columns) != len(piece.terms) - base:
            continue
        other = fitted(_piece(members, flag, columns, np.ones(len(columns))), members)
        if {name for name, _ in other.terms} == names or not all(w for _, w in other.terms):
            continue
        if members.explains(other).all() and other.free_parameters() <= piece.free_parameters():
            same.append(other)
    return same
