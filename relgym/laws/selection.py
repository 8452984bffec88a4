"""Which pieces an axis' law consists of, and how they combine: the shortest description wins."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, islice

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import ALIKE, ALTERNATIVES, SAME_DIGITS
from relgym.laws.description import EXCEPTION_BITS, function_bits
from relgym.laws.pieces import AxisExamples, find_pieces, fitted
from relgym.laws.records import ZERO, Operator, Piece, combined

__all__ = ["AxisFit", "fit_axis", "refitted"]


@dataclass(frozen=True, slots=True)
class AxisFit:
    """Pieces, their operator, equally good alternatives, which examples they explain, and the bits of all."""

    pieces: tuple[Piece, ...]
    operator: Operator
    alternatives: tuple[tuple[Operator, tuple[Piece, ...]], ...]
    explained: NDArray[np.bool_]
    bits: float


def fit_axis(examples: AxisExamples, *, rng: np.random.Generator) -> AxisFit:
    """Learn the law of one axis.

    Parameters
    ----------
    examples
        Its examples; all of them are explained or paid for as exceptions.
    rng
        Source of random samples.

    Notes
    -----
    The free motion and rest are always offered as pieces. A law with no piece that leaves the free motion
    alone where no impulse acts pays extra: a body that is let go moves on freely.
    """
    known = [Piece(((examples.free, 1.0),)), ZERO]
    pieces = [*known, *find_pieces(examples, known, rng=rng)]
    values = [examples.values(piece) for piece in pieces]
    scored = []
    least = np.inf
    # More pieces are combined as long as that says it in fewer bits.
    for size in range(1, len(pieces) + 1):
        for operator, chosen in _choices(len(pieces), size):
            after = combined(operator, [values[k] for k in chosen])
            explained = np.abs(examples.y - after) <= examples.tolerance
            scored.append((_score(examples, [pieces[k] for k in chosen], explained), operator, chosen))
        before, least = least, min(score for score, _, _ in scored)
        if least == before:
            break
    best = [(operator, chosen) for score, operator, chosen in scored if score <= least + ALIKE]
    fits = [_refit(examples, operator, tuple(pieces[k] for k in chosen)) for operator, chosen in best]
    first = fits[0]
    alternatives = [f for f in fits[1:] if f.bits <= first.bits + ALIKE and not _same(f, first)]
    return AxisFit(
        first.pieces,
        first.operator,
        tuple((f.operator, f.pieces) for f in islice(alternatives, ALTERNATIVES)),
        first.explained,
        first.bits,
    )


def refitted(examples: AxisExamples, operator: Operator, pieces: tuple[Piece, ...]) -> AxisFit:
    """The same form, its weights fitted to other examples."""
    return _refit(examples, operator, pieces)


def _choices(count: int, size: int) -> Iterator[tuple[Operator, tuple[int, ...]]]:
    """Every way to combine so many of the pieces."""
    for chosen in combinations(range(count), size):
        yield "max", chosen
        if size > 1:
            yield "min", chosen


def _score(examples: AxisExamples, pieces: list[Piece], explained: NDArray[np.bool_]) -> float:
    """Bits of a law and of the examples that it leaves unexplained."""
    bits = function_bits(pieces, len(examples.names), len(examples))
    if not any(piece.releases(examples.free) for piece in pieces):
        bits += 0.5 * EXCEPTION_BITS
    return bits + EXCEPTION_BITS * float((~explained).sum())


def _refit(examples: AxisExamples, operator: Operator, pieces: tuple[Piece, ...]) -> AxisFit:
    """Fit every piece to the examples that it decides."""
    values = np.stack([examples.values(piece) for piece in pieces])
    after = combined(operator, list(values))
    explained = np.abs(examples.y - after) <= examples.tolerance
    better = []
    for k, piece in enumerate(pieces):
        decides = explained & (np.abs(values[k] - after) <= examples.tolerance)
        alone = np.abs(np.delete(values, k, axis=0) - after).min(axis=0, initial=np.inf) > examples.tolerance
        rows = np.flatnonzero(decides & alone)
        told = piece.free_parameters() and len(rows) > len(piece.terms) + 1
        better.append(fitted(piece, examples.rows(rows)) if told else piece)
    again = combined(operator, [examples.values(piece) for piece in better])
    now = np.abs(examples.y - again) <= examples.tolerance
    if now.sum() >= explained.sum():
        pieces, explained = tuple(better), now
    bits = _score(examples, list(pieces), explained)
    return AxisFit(pieces, operator, (), explained, bits)


def _same(a: AxisFit, b: AxisFit) -> bool:
    """Whether two laws are the same function as written."""
    sides = [
        sorted((sorted((n, round(w, SAME_DIGITS)) for n, w in p.terms)) for p in f.pieces) for f in (a, b)
    ]
    return sides[0] == sides[1] and (a.operator == b.operator or len(a.pieces) == 1)
