"""Description length of laws: what is stated costs bits, and so does what is left unexplained."""

from __future__ import annotations

import math
from collections.abc import Iterable

from relgym.config.constants import EVIDENCE, NUMBER_BITS
from relgym.laws.records import Piece

__all__ = ["CONSTANT_BITS", "EXCEPTION_BITS", "function_bits", "piece_bits", "shorter_apart"]

CONSTANT_BITS = EXCEPTION_BITS = NUMBER_BITS
"""Bits of a fitted constant, beside half a bit for every doubling of the examples that it is fitted to, and of a number
that no law explains."""


def piece_bits(piece: Piece, features: int, examples: int) -> float:
    """Bits of one linear piece: which features, and their weights unless they are 1 or -1."""
    constant = CONSTANT_BITS + 0.5 * math.log2(max(examples, 2))
    return 1.0 + len(piece.terms) * math.log2(max(features, 2)) + constant * piece.free_parameters()


def function_bits(pieces: Iterable[Piece], features: int, examples: int) -> float:
    """Bits of several pieces; whether they are combined by max or min costs one more."""
    parts = [piece_bits(piece, features, examples) for piece in pieces]
    return sum(parts) + (len(parts) > 1)


def shorter_apart(whole: float, early: float, late: float, examples: int) -> bool:
    """Whether the world has changed: two laws, of what came before and what came since, say all in fewer bits than one.

    What comes later may also be what nobody did before: then one law says both as briefly, so that two must be shorter
    by `EVIDENCE`.

    Parameters
    ----------
    whole, early, late
        Bits of the law of all examples, and of those of either part, what they leave unexplained included.
    examples
        How many there are in all; which came first takes the logarithm of that to say.
    """
    return early + late + math.log2(examples) + EVIDENCE < whole
