"""What laws cost, in bits."""

from __future__ import annotations

import pytest

from relgym.laws.description import CONSTANT_BITS, function_bits, piece_bits
from relgym.laws.records import ONE, ZERO, Piece


def test_bits_by_hand() -> None:
    # Which of 8 features: 3 bits each; a weight that is no sign: 33, and 5 for one of 1,024 examples.
    assert CONSTANT_BITS == 33.0
    assert piece_bits(ZERO, 8, 1024) == 1.0
    assert piece_bits(Piece((("u", 1.0), ("v", -1.0))), 8, 1024) == 1.0 + 2 * 3.0
    bounce = Piece((("v", -0.9), (ONE, 0.5)))
    assert piece_bits(bounce, 8, 1024) == 1.0 + 2 * 3.0 + 2 * (33.0 + 5.0)
    assert piece_bits(Piece((("v", 0.5),)), 1, 1) == pytest.approx(1.0 + 1.0 + 33.5)  # never less than of two
    assert function_bits([Piece((("u", 1.0),)), bounce], 8, 1024) == 4.0 + 83.0 + 1.0
    assert function_bits([ZERO], 8, 1024) == 1.0
